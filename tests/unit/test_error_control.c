/* Error control against marches whose errors are known. */
#include "render/error/error_control.h"
#include "unit.h"
#include <math.h>
#include <string.h>

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
    CtsErrorMap errors = {.origin = origin, .indicator = indicator};
    assert_int_equal(cts_error_control_enforce(&control, picture, &errors, &err), CTS_OK);
    for (int i = 0; i < 2 * SIDE; i++)
        if (picture->pixels[4 * i] != TRUTH)
            fail_msg("expected %g, actual %g: pixel %d of row %d", (double)TRUTH, (double)picture->pixels[4 * i],
                     i % SIDE, i / SIDE);
    cts_picture_free(&picture);
}

/* The reference of expected_error(). */
static CtsStatus march_black(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n,
                             double error, float (*rgba)[4], float *off, CtsError *err)
{
    memset(rgba, 0, n * sizeof *rgba);
    memset(off, 0, n * sizeof *off);
    return CTS_OK;
}

/* The estimate's expectation is the squared error of the pixels that were not re-rendered: each pixel is drawn with the
 * probability that its estimate assumes, alone or together with others, beside interpolated pixels, and among the last
 * few pixels. The requested error is so large that one round suffices: low estimates end the rounds. */
static void expected_error(void **state)
{
    enum { WIDTH = 37, HEIGHT = 61, N = WIDTH * HEIGHT, PICTURES = 1000 };
    const CtsEngine engine = {.name = "tiled", .render_pixels = march_black, .indicator = CTS_INDICATOR_ESTIMATE};
    const CtsRenderSettings settings = {.n_threads = 1};
    CtsPreset preset = {0};
    CtsPicture *picture;
    CtsError err;
    static float indicator[N];
    static uint8_t origin[N];
    CtsErrorMap errors = {.origin = origin, .indicator = indicator};
    double sum_estimated = 0, sum_actual = 0, variance = 0;
    assert_int_equal(cts_picture_new(&picture, WIDTH, HEIGHT, 4, &err), CTS_OK);
    for (int number = 0; number < PICTURES; number++) {
        CtsErrorControl control = {.engine = &engine, .march = &engine};
        control.scene.preset = &preset;
        control.scene.settings = &settings;
        control.scene.plan.max_error = 48;
        control.scene.view.width = WIDTH;
        control.scene.view.height = 8 * HEIGHT;
        picture->first_row = number * HEIGHT; /* another sample */
        for (size_t i = 0; i < N; i++) {
            const bool is_likely = i % 1000 < 50;
            const float error = is_likely ? 0.1F : 0.02F * (float)(i % 4);
            for (size_t c = 0; c < 4; c++)
                picture->pixels[4 * i + c] = c == 3 ? 0 : error;
            indicator[i] = i % 500 == 7 ? 3 : is_likely ? 1 : error;
            origin[i] = i > N / 2 && i % 5 == 0 ? CTS_PIXEL_INTERPOLATED : CTS_PIXEL_RENDERED;
        }
        assert_int_equal(cts_error_control_enforce(&control, picture, &errors, &err), CTS_OK);
        double actual = 0;
        for (size_t i = 0; i < N; i++)
            if (origin[i] == CTS_PIXEL_RENDERED)
                actual += (double)picture->pixels[4 * i] * (double)picture->pixels[4 * i];
        sum_estimated += control.terms.sum;
        sum_actual += actual;
        variance += (control.terms.sum - actual) * (control.terms.sum - actual);
    }
    const double deviation = sqrt(variance);
    if (fabs(sum_estimated - sum_actual) > 4 * deviation || deviation > 0.005 * sum_actual)
        fail_msg("sum of squared errors of %d pictures: expected %g, actual %g (standard deviation %g)", PICTURES,
                 sum_actual, sum_estimated, deviation);
    cts_picture_free(&picture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(reference_where_doubtful), cmocka_unit_test(expected_error)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
