/* Sampled pixels: their distribution, and their estimates for a picture of known error. */
#include "ctsplat/render.h"
#include "rays.h"
#include "render/error/reference_samples.h"
#include <stdlib.h>

static void places(int width, int height, int n)
{
    CtsScene scene = {.preset = &(CtsPreset){.name = "p"}, .view = {.width = width, .height = height}};
    CtsReference *r = NULL, *again = NULL;
    CtsError err;
    char *taken = calloc((size_t)width, (size_t)height);
    double sum = 0;
    assert_non_null(taken);
    assert_int_equal(cts_reference_place(&r, &scene, (size_t)n, &err), CTS_OK);
    for (int i = 0; i < n; i++) {
        assert_in_range(r->xy[i][0], 0, width - 1);
        assert_in_range(r->xy[i][1], 0, height - 1);
        assert_false(taken[r->xy[i][1] * width + r->xy[i][0]]++);
        assert_true(r->weight[i] > 0);
        sum += r->weight[i];
    }
    assert_near(sum, 1, 1e-9);
    /* Spread evenly: each quarter of a large picture holds a quarter of many pixels. */
    if (n >= 100 && height >= 100) {
        int quarter[4] = {0};
        for (int i = 0; i < n; i++)
            quarter[(r->xy[i][0] >= width / 2) + 2 * (r->xy[i][1] >= height / 2)]++;
        for (int q = 0; q < 4; q++)
            assert_near(quarter[q], n / 4.0, 4);
    }
    assert_int_equal(cts_reference_place(&again, &scene, (size_t)n, &err), CTS_OK);
    assert_memory_equal(r->xy, again->xy, (size_t)n * sizeof *r->xy);
    cts_reference_free(&again);
    cts_reference_free(&r);
    free(taken);
}

static void test_places(void **state)
{
    places(512, 512, 1000);
    places(1024, 700, 512);
    places(640, 480, 1);
    places(640, 480, 2);
    places(640, 480, 3);
    places(30000, 2, 999);
    places(7, 5, 35);
    places(7, 5, 34);
    places(5, 3, 13);
    places(1, 1, 1);
    places(1, 9, 8);
}

/* Large on the left, small on the right, sometimes very large. */
static double even_error(int x, unsigned random)
{
    return (random >> 16) / 65536.0 * 0.02 * (x < 50) + ((random >> 8) % 97 == 0 ? 0.05 : 0);
}

/* A few pixels make most of the error, as where rays graze a surface. */
static double rare_error(int x, unsigned random)
{
    return 0.0005 * pow((random >> 8) / 16777216.0 + 1e-5, -0.42);
}

/* Errors planted by a known law: the interval must contain their rmse in so many of 60 trials. */
static void estimate(double (*law)(int x, unsigned random), int least_inside)
{
    const int n = 1000, width = 200, height = 150;
    int inside = 0;
    for (int trial = 0; trial < 60; trial++) {
        CtsPreset preset = cts_check_even_preset(0.5, 1, 1, 1);
        CtsScene scene = {.preset = &preset, .view = {.width = width, .height = height, .azimuth_deg = trial}};
        CtsPicture *picture = NULL;
        CtsError err;
        assert_int_equal(cts_picture_new(&picture, width, height, 4, &err), CTS_OK);
        double truth = 0;
        unsigned random = (unsigned)trial + 1;
        for (int i = 0; i < width * height; i++) {
            random = random * 1664525u + 1013904223u;
            const double e = law(i % width, random);
            truth += e * e / (width * height);
            for (int c = 0; c < 3; c++)
                picture->pixels[4 * i + c] = (float)(0.5 + e);
            picture->pixels[4 * i + 3] = 1;
        }
        CtsReference *r = NULL;
        CtsVerified v;
        assert_int_equal(cts_reference_place(&r, &scene, (size_t)n, &err), CTS_OK);
        for (int i = 0; i < n; i++)
            for (int c = 0; c < 4; c++)
                r->rgba[i][c] = c < 3 ? 0.5 : 1;
        assert_int_equal(cts_reference_compare(r, picture, &v, &err), CTS_OK);
        cts_reference_free(&r);
        assert_int_equal(v.pixels, n);
        assert_near(v.rmse, sqrt(truth), (law == even_error ? 0.5 : 2) * sqrt(truth));
        inside += v.rmse_low <= sqrt(truth) && sqrt(truth) <= v.rmse_high;
        assert_true(v.p999 <= v.max);
        if (law == even_error) {
            assert_near(v.max, 0.06, 0.0101);
            assert_near(v.share_above, 0.22, 0.05);
            assert_true(v.p999 >= 0.045);
        }
        cts_picture_free(&picture);
    }
    assert_in_range(inside, least_inside, 60); /* 57 hoped for */
}

static void test_estimate(void **state)
{
    estimate(even_error, 53);
    estimate(rare_error, 46);
}

/* End to end: raycast verified by itself is correct, and a corrupted background counts only where it is visible. */
static void test_whole_way(void **state)
{
    const int dims[3] = {9, 9, 9};
    const double spacing[3] = {1, 1, 1}, slopes[4] = {0, 100, 10, 20};
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsReport report = {0};
    CtsError err = {0};
    CtsRenderSettings settings;
    CtsPreset preset = cts_check_preset((CtsCheckPoint[]){{200, 0, {1, 0, 0}}, {600, 0.5, {0, 1, 1}}}, 2);
    assert_int_equal(cts_check_volume(&volume, dims, spacing, 1, cts_hu_linear, slopes, &err), CTS_OK);
    cts_render_defaults(&settings);
    settings.width = settings.height = 40;
    settings.engine = CTS_ENGINE_RAYCAST;
    settings.verify = 100;
    for (int mode = 0; mode < CTS_N_MODES; mode++) {
        settings.mode = mode;
        assert_int_equal(cts_render(&(CtsModel){.volume = volume}, &preset, &settings, &picture, &report, &err),
                         CTS_OK);
        assert_int_equal(report.verified.pixels, 100);
        assert_true(report.verified.rmse < 1e-7 && report.verified.max < 1e-6);
        cts_picture_free(&picture);
        cts_report_free(&report);
    }
    /* Blended over the preset's background before comparing. */
    CtsReference *reference = NULL;
    CtsVerified v;
    settings.mode = 0;
    settings.verify = 0;
    for (int none = 0; none < 2; none++) {
        preset.background[0] = 0.5;
        preset.background_none = none;
        assert_int_equal(cts_reference_new(&reference, &(CtsModel){.volume = volume}, &preset, &settings, 1600, &err),
                         CTS_OK);
        assert_int_equal(cts_picture_new(&picture, 40, 40, 4, &err), CTS_OK);
        for (size_t i = 0; i < 1600; i++)
            for (int c = 0; c < 4; c++)
                picture->pixels[4 * (reference->xy[i][1] * 40 + reference->xy[i][0]) + c] =
                    (float)reference->rgba[i][c];
        for (int i = 0; i < 1600; i++)
            picture->pixels[4 * i + 3] *= 0.5f;
        assert_int_equal(cts_reference_compare(reference, picture, &v, &err), CTS_OK);
        assert_true(none ? v.max < 1e-7 : v.max > 0.1 && v.max < 0.25);
        cts_picture_free(&picture);
        assert_int_equal(cts_picture_new(&picture, 41, 40, 4, &err), CTS_OK);
        assert_int_equal(cts_reference_compare(reference, picture, &v, &err), CTS_ERR_USAGE);
        cts_picture_free(&picture);
        cts_reference_free(&reference);
    }
    settings.verify = 1000000; /* more than there are: all */
    settings.mode = 0;
    assert_int_equal(cts_render(&(CtsModel){.volume = volume}, &preset, &settings, &picture, &report, &err), CTS_OK);
    assert_int_equal(report.verified.pixels, 1600);
    assert_true(report.verified.rmse_low == report.verified.rmse && report.verified.rmse_high == report.verified.rmse);
    cts_picture_free(&picture);
    cts_report_free(&report);
    cts_volume_free(&volume);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_estimate),
        cmocka_unit_test(test_whole_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
