/* Verification: which pixels are chosen, and whether its interval holds the error of the whole picture. */
#include "render/verify.h"
#include "scene/resolve.h"
#include "scenes.h"

enum { SIZE = 130, PIXELS = 1000, TRIALS = 100 };

typedef struct Case {
    CtsPicture *picture, *truth;
    CtsSceneStore store;
    double rmse;
} Case;

static void make_case(Case *c, const CtsVolume *v, const char *preset_name, double azimuth_deg, double elevation_deg,
                      bool lit)
{
    CtsError err;
    CtsDifference d;
    const CtsPreset preset = preset_named(preset_name);
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, azimuth_deg, elevation_deg);
    s.shade = lit ? CTS_ON : CTS_OFF;
    c->picture = render(v, &preset, &s, NULL);
    s.engine = CTS_ENGINE_RAYCAST;
    c->truth = render(v, &preset, &s, NULL);
    assert_int_equal(cts_picture_compare(c->picture, c->truth, &d, &err), CTS_OK);
    c->rmse = d.rmse;
    assert_int_equal(cts_scene_init(&c->store, v, &preset, &s, &err), CTS_OK);
}

/* The true values of the chosen pixels, from the whole picture of them. */
static void fill_truth(CtsVerify *verify, const Case *c)
{
    for (size_t i = 0; i < verify->reference->n; i++) {
        const int *at = verify->reference->xy[i];
        for (int k = 0; k < 4; k++)
            verify->reference->rgba[i][k] = (double)c->truth->pixels[4 * (at[1] * SIZE + at[0]) + k];
    }
}

static void free_case(Case *c)
{
    cts_picture_free(&c->picture);
    cts_picture_free(&c->truth);
}

/* Of 100 trials with other pixels, 95 intervals should hold the error of the whole picture. */
static void coverage(void **state)
{
    (void)state;
    static const struct {
        const char *preset;
        double azimuth_deg, elevation_deg;
        bool lit;
    } rows[] = {{"bone", 30, 20, true}, {"skin", -70, 40, false}, {"muscle", 30, 20, false}, {"vessel", 0, 0, true}};
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    for (size_t row = 0; row < sizeof rows / sizeof *rows; row++) {
        Case c;
        make_case(&c, v, rows[row].preset, rows[row].azimuth_deg, rows[row].elevation_deg, rows[row].lit);
        int inside = 0;
        double weight = 0;
        for (int trial = 0; trial < TRIALS; trial++) {
            CtsVerify verify;
            CtsVerified verified;
            CtsError err;
            assert_int_equal(cts_verify_begin(&verify, &c.store.scene, PIXELS, &err), CTS_OK);
            verify.seed += (uint64_t)trial * 7919;
            cts_verify_take(&verify, c.picture);
            assert_int_equal(cts_verify_choose(&verify, &err), CTS_OK);
            fill_truth(&verify, &c);
            assert_int_equal(cts_verify_judge(&verify, &verified, &err), CTS_OK);
            inside += verified.rmse_low <= c.rmse && c.rmse <= verified.rmse_high;
            for (size_t i = 0; i < verify.reference->n; i++)
                weight += verify.reference->weight[i] / TRIALS;
            cts_verify_free(&verify);
        }
        if (inside < 90)
            fail_msg("%s at %g,%g: %d of %d intervals hold %.3f/255", rows[row].preset, rows[row].azimuth_deg,
                     rows[row].elevation_deg, inside, TRIALS, 255 * c.rmse);
        assert_true(fabs(weight - 1) < 0.1);
        free_case(&c);
    }
    cts_volume_free(&v);
}

/* The same pixels however the picture comes, each once; all of them where as many are asked for, and then the error is
 * that of the picture. */
static void chosen(void **state)
{
    (void)state;
    CtsVolume *v = phantom_head(32, 32, 24, 10);
    Case c;
    make_case(&c, v, "bone", 20, 10, false);
    CtsVerify whole, parts;
    CtsVerified verified;
    CtsError err;
    assert_int_equal(cts_verify_begin(&whole, &c.store.scene, PIXELS, &err), CTS_OK);
    assert_int_equal(cts_verify_begin(&parts, &c.store.scene, PIXELS, &err), CTS_OK);
    cts_verify_take(&whole, c.picture);
    for (int row = 0; row < SIZE; row += CTS_BAND_ROWS) {
        CtsPicture band = *c.picture;
        band.first_row = row;
        band.height = row + CTS_BAND_ROWS < SIZE ? CTS_BAND_ROWS : SIZE - row;
        band.pixels += (size_t)row * SIZE * (size_t)band.n_channels;
        cts_verify_take(&parts, &band);
    }
    assert_int_equal(cts_verify_choose(&whole, &err), CTS_OK);
    assert_int_equal(cts_verify_choose(&parts, &err), CTS_OK);
    assert_int_equal(whole.reference->n, PIXELS);
    assert_memory_equal(whole.reference->xy, parts.reference->xy, PIXELS * sizeof *whole.reference->xy);
    assert_memory_equal(whole.found, parts.found, PIXELS * sizeof *whole.found);
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < i; k++)
            assert_true(memcmp(whole.reference->xy[i], whole.reference->xy[k], sizeof whole.reference->xy[i]) != 0);
    cts_verify_free(&whole);
    cts_verify_free(&parts);
    assert_int_equal(cts_verify_begin(&whole, &c.store.scene, 2 * SIZE * SIZE, &err), CTS_OK);
    cts_verify_take(&whole, c.picture);
    assert_int_equal(cts_verify_choose(&whole, &err), CTS_OK);
    fill_truth(&whole, &c);
    assert_int_equal(cts_verify_judge(&whole, &verified, &err), CTS_OK);
    assert_int_equal(verified.pixels, SIZE * SIZE);
    assert_true(fabs(verified.rmse - c.rmse) < 1e-3 * c.rmse);
    assert_true(verified.rmse_low == verified.rmse && verified.rmse_high == verified.rmse);
    cts_verify_free(&whole);
    free_case(&c);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(coverage), cmocka_unit_test(chosen)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
