/* Verification: which pixels are chosen, and whether its interval holds the error of the whole picture. */
#include "render/error/verify.h"

#include "base/limits.h"
#include "core/scene/resolve.h"
#include "lab/check/check_scene.h"
#include "scenes.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIZE = 130, PIXELS = 1000, TRIALS = 200 };

typedef struct Case {
    CtsPicture *picture, *truth;
    CtsSceneStore store;
    double rmse, share;
} Case;

static void make_case(Case *c, const CtsVolume *v, CtsPreset preset, double azimuth_deg, double elevation_deg, bool lit)
{
    CtsError err;
    CtsDifference d;
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, azimuth_deg, elevation_deg);
    s.shade = lit ? CTS_ON : CTS_OFF;
    c->picture = render(v, &preset, &s, NULL);
    s.engine = CTS_ENGINE_RAYCAST;
    c->truth = render(v, &preset, &s, NULL);
    assert_int_equal(cts_picture_compare(c->picture, c->truth, &d, &err), CTS_OK);
    c->rmse = d.rmse;
    c->share = d.share;
    assert_int_equal(cts_scene_init(&c->store, MODEL_OF(v), &preset, &s, &err), CTS_OK);
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

/* Chooses n random pixels of a picture for this trial and estimates its error from them. */
static CtsVerified verdict(const Case *c, size_t n, const float *bound, int trial)
{
    CtsVerify verify;
    CtsVerified verified;
    CtsError err;
    cts_verify_begin(&verify, &c->store.scene, n);
    verify.seed += (uint64_t)trial * 7919;
    cts_verify_take(&verify, c->picture, bound);
    assert_int_equal(cts_verify_choose(&verify, &err), CTS_OK);
    double weight = 0;
    for (size_t i = 0; i < verify.reference->n; i++)
        weight += verify.reference->weight[i];
    assert_true(fabs(weight - 1) < 1e-9);
    fill_truth(&verify, c);
    assert_int_equal(cts_reference_evaluate(verify.reference, (const float(*)[4])verify.found, &verified, &err),
                     CTS_OK);
    cts_verify_free(&verify);
    cts_error_limits(&verified);
    assert_true(verified.rmse_low <= verified.rmse && verified.rmse <= verified.rmse_high);
    assert_true(verified.share_above <= verified.share_high);
    return verified;
}

/* Of 200 trials with different pixels, 95 % of the intervals contain the error of the whole picture (counted are those
 * that have a pixel with an error), and estimates have no bias: their mean square is the picture's. */
static void expect_coverage(const Case *c, size_t n, const float *bound, const char *name)
{
    int inside = 0, share_inside = 0, n_found = 0;
    double mean = 0, spread = 0, low = 0, high = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        const CtsVerified v = verdict(c, n, bound, trial);
        n_found += v.rmse > 0;
        inside += v.rmse > 0 && v.rmse_low <= c->rmse && c->rmse <= v.rmse_high;
        share_inside += c->share <= v.share_high;
        mean += v.rmse * v.rmse / TRIALS;
        spread += v.rmse * v.rmse * v.rmse * v.rmse / TRIALS;
        low += v.rmse_low / TRIALS;
        high += v.rmse_high / TRIALS;
    }
    print_message("%s: %d of %d and %d of %d hold, %.3g to %.3g about %.3g\n", name, inside, n_found, share_inside,
                  TRIALS, 255 * low, 255 * high, 255 * c->rmse);
    assert_in_range(inside, 0.95 * n_found, TRIALS);
    assert_in_range(share_inside, 0.975 * TRIALS, TRIALS);
    assert_true(fabs(mean - c->rmse * c->rmse) <= 4 * sqrt((spread - mean * mean) / TRIALS) + 1e-12);
}

static void test_coverage(void **state)
{
    static const struct {
        const char *preset;
        double azimuth_deg, elevation_deg;
        bool lit;
    } rows[] = {{"bone", 30, 20, true}, {"skin", -70, 40, false}, {"vessel", 0, 0, true}};
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    for (size_t row = 0; row < sizeof rows / sizeof *rows; row++) {
        Case c;
        make_case(&c, v, preset_named(rows[row].preset), rows[row].azimuth_deg, rows[row].elevation_deg, rows[row].lit);
        expect_coverage(&c, PIXELS, NULL, rows[row].preset);
        free_case(&c);
    }
    cts_volume_free(&v);
}

/* A hard step of opacity: a pixel in a hundred makes all of the error. */
static void test_coverage_of_steps(void **state)
{
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    const CtsPreset step = cts_check_preset((CtsCheckPoint[]){{300, 0, {1, 1, 1}}, {300, 0.9, {1, 1, 1}}}, 2);
    Case c;
    make_case(&c, v, step, 30, 20, false);
    expect_coverage(&c, PIXELS, NULL, "step");
    expect_coverage(&c, 100, NULL, "step, 100 pixels");
    free_case(&c);
    cts_volume_free(&v);
}

/* Errors without any indication: single white pixels of a black picture where the reference is black. */
static void test_coverage_of_lost_dots(void **state)
{
    for (int every = 50; every <= 5000; every *= 10) {
        Case c = {0};
        CtsError err;
        CtsPreset preset = cts_check_even_preset(0.5, 1, 1, 1);
        const CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
        const double hu = 0;
        CtsVolume *v = NULL;
        assert_int_equal(
            cts_check_volume(&v, (const int[3]){3, 3, 3}, (const double[3]){1, 1, 1}, 1, cts_hu_constant, &hu, &err),
            CTS_OK);
        assert_int_equal(cts_scene_init(&c.store, MODEL_OF(v), &preset, &s, &err), CTS_OK);
        assert_int_equal(cts_picture_new(&c.picture, SIZE, SIZE, 4, &err), CTS_OK);
        assert_int_equal(cts_picture_new(&c.truth, SIZE, SIZE, 4, &err), CTS_OK);
        int n = 0;
        for (int i = 7; i < SIZE * SIZE; i += every, n++)
            for (int k = 0; k < 4; k++)
                c.truth->pixels[4 * i + k] = 1;
        c.share = (double)n / (SIZE * SIZE);
        c.rmse = sqrt(c.share);
        char name[64];
        snprintf(name, sizeof name, "one of %d pixels", every);
        expect_coverage(&c, PIXELS, NULL, name);
        /* Indicators without information do not harm; good ones help. */
        float *bound = calloc(SIZE * SIZE, sizeof *bound);
        assert_non_null(bound);
        expect_coverage(&c, PIXELS, bound, "wrong bounds");
        for (int i = 7; i < SIZE * SIZE; i += every)
            bound[i] = 1;
        double worst = 0;
        for (int trial = 0; trial < TRIALS && n <= 4; trial++)
            worst = fmax(worst, fabs(verdict(&c, PIXELS, bound, trial).rmse - c.rmse));
        assert_true(worst < 0.02 * c.rmse);
        free(bound);
        free_case(&c);
        cts_volume_free(&v);
    }
}

/* The same pixels for any division into bands, each once; all of them where as many are requested, and then the error
 * is that of the picture. */
static void test_chosen(void **state)
{
    CtsVolume *v = phantom_head(32, 32, 24, 10);
    Case c;
    make_case(&c, v, preset_named("bone"), 20, 10, false);
    CtsVerify whole, parts;
    CtsVerified verified;
    CtsError err;
    cts_verify_begin(&whole, &c.store.scene, PIXELS);
    cts_verify_begin(&parts, &c.store.scene, PIXELS);
    cts_verify_take(&whole, c.picture, NULL);
    for (int row = 0; row < SIZE; row += CTS_BAND_ROWS) {
        CtsPicture band = *c.picture;
        band.first_row = row;
        band.height = row + CTS_BAND_ROWS < SIZE ? CTS_BAND_ROWS : SIZE - row;
        band.pixels += (size_t)row * SIZE * (size_t)band.n_channels;
        cts_verify_take(&parts, &band, NULL);
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
    cts_verify_begin(&whole, &c.store.scene, 2 * SIZE * SIZE);
    cts_verify_take(&whole, c.picture, NULL);
    assert_int_equal(cts_verify_choose(&whole, &err), CTS_OK);
    fill_truth(&whole, &c);
    assert_int_equal(cts_reference_evaluate(whole.reference, (const float(*)[4])whole.found, &verified, &err), CTS_OK);
    assert_int_equal(verified.pixels, SIZE * SIZE);
    assert_true(fabs(verified.rmse - c.rmse) < 1e-3 * c.rmse);
    cts_error_limits(&verified);
    assert_true(verified.rmse_low == verified.rmse && verified.rmse_high == verified.rmse);
    cts_verify_free(&whole);
    free_case(&c);
    cts_volume_free(&v);
}

/* The formulas of limits.c in reverse: the probability of c or less of a Poisson law of mean m, summed up, is below the
 * allowed one at the upper limit, and near it. */
static void test_limits(void **state)
{
    static const int counts[] = {0, 1, 5, 40};
    for (int i = 0; i < 4; i++) {
        CtsVerified v = {.pixels = 1000,
                         .unit = 1e-3,
                         .max = 0.1,
                         .rmse = 0.1 * sqrt(counts[i] * 1e-3),
                         .share_above = counts[i] * 1e-3};
        cts_error_limits(&v);
        const double unit = v.unit * v.max * v.max, mean = v.rmse_high * v.rmse_high / unit;
        double chance = 0;
        for (int k = 0; k <= counts[i]; k++)
            chance += exp(k * log(mean) - mean - lgamma(k + 1));
        assert_true(chance <= 0.0250001 && chance > 0.001);
        assert_true(fabs(0.01 * v.share_high / (v.rmse_high * v.rmse_high) - 1) < 1e-9);
        const double least = v.rmse_low * v.rmse_low / unit;
        chance = 1;
        for (int k = 0; k < counts[i]; k++)
            chance -= exp(k * log(least) - least - lgamma(k + 1));
        assert_true(counts[i] == 0 ? least == 0 : chance <= 0.025 && least > 0);
    }
}

/* No difference found is no proof that there is none: the rule of three. */
static void test_nothing_found(void **state)
{
    CtsVolume *v = phantom_head(32, 32, 24, 10);
    Case c;
    make_case(&c, v, preset_named("bone"), 20, 10, false);
    cts_picture_free(&c.picture);
    assert_int_equal(cts_picture_new(&c.picture, SIZE, SIZE, 4, &(CtsError){0}), CTS_OK);
    memcpy(c.picture->pixels, c.truth->pixels, sizeof(float) * 4 * SIZE * SIZE);
    const CtsVerified found = verdict(&c, PIXELS, NULL, 0);
    assert_true(found.rmse == 0 && found.rmse_low == 0 && found.max == 0);
    /* Evenly drawn pixels would leave ln(40) / n; half of them are drawn elsewhere. */
    assert_true(found.share_high >= log(40) / PIXELS && found.share_high <= 2.01 * log(40) / PIXELS);
    assert_true(fabs(found.rmse_high - sqrt(found.share_high) / 255) < 1e-9);
    free_case(&c);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_coverage),
        cmocka_unit_test(test_coverage_of_steps),
        cmocka_unit_test(test_coverage_of_lost_dots),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_nothing_found),
        cmocka_unit_test(test_chosen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
