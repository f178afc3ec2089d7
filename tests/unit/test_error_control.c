/* Error control against marches whose errors are known. */
#include "render/error/error_control.h"
#include "unit.h"

enum { SIDE = 64 };
/* Values of the pixels, those that a fast march finds, and those of the frame. */
static const float TRUTH = 0.25F, FAST = 0.5F, RENDERED = 0.3F;

/* At reference precision the truth; else FAST, with a bound for the first row that says how wrong it is. */
static CtsStatus march_pixels(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n,
                              double error, float (*rgba)[4], float *off, CtsError *err)
{
    for (size_t i = 0; i < n; i++) {
        const bool doubtful = place[i] < (uint32_t)band->width;
        for (int c = 0; c < 3; c++)
            rgba[i][c] = error > 0 && doubtful ? FAST : TRUTH;
        rgba[i][3] = 1;
        off[i] = error > 0 && doubtful ? FAST : 0;
    }
    return CTS_OK;
}

/* Pixels whose re-rendering is doubtful get the value of the reference, not of the fast march. */
static void reference_where_doubtful(void **state)
{
    const CtsEngine march = {.name = "march", .render_pixels = march_pixels, .indicator = CTS_INDICATOR_BOUND},
                    engine = {.name = "sheets", .indicator = CTS_INDICATOR_ESTIMATE};
    const CtsRenderSettings settings = {.n_threads = 1};
    CtsPreset preset = {0};
    CtsErrorControl control = {.engine = &engine, .march = &march};
    control.scene.preset = &preset;
    control.scene.settings = &settings;
    control.scene.plan.max_error = 4;
    control.scene.view.width = control.scene.view.height = SIDE;
    CtsPicture *picture;
    CtsError err;
    assert_int_equal(cts_picture_new(&picture, SIDE, SIDE, 4, &err), CTS_OK);
    static float indicator[SIDE * SIDE];
    static uint8_t origin[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; i++) {
        for (int c = 0; c < 4; c++)
            picture->pixels[4 * i + c] = c == 3 ? 1 : RENDERED;
        indicator[i] = i < 2 * SIDE ? 1 : 0; /* of the first two rows all pixels are re-rendered */
    }
    CtsErrorMap errors = {origin, indicator, 0, 0};
    assert_int_equal(cts_error_control_enforce(&control, picture, &errors, &err), CTS_OK);
    for (int i = 0; i < 2 * SIDE; i++)
        if (picture->pixels[4 * i] != TRUTH)
            fail_msg("expected %g, actual %g: pixel %d of row %d", (double)TRUTH, (double)picture->pixels[4 * i],
                     i % SIDE, i / SIDE);
    cts_picture_free(&picture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(reference_where_doubtful)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
