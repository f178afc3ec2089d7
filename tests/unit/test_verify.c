/* Sampled pixels: where they lie, what they say about a picture of known error. */
#include "ctsplat/render.h"
#include "rays.h"
#include "render/verify.h"
#include <stdlib.h>
#include <string.h>

static void places(int width, int height, int n)
{
    CtsScene scene = {.preset = &(CtsPreset){.name = "p"}, .view = {.width = width, .height = height}};
    int(*xy)[2] = calloc((size_t)n, sizeof *xy);
    double *weight = calloc((size_t)n, sizeof *weight), sum = 0;
    char *taken = calloc((size_t)width, (size_t)height);
    assert_true(xy && weight && taken);
    cts_verify_places(&scene, (size_t)n, xy, weight);
    for (int i = 0; i < n; i++) {
        assert_in_range(xy[i][0], 0, width - 1);
        assert_in_range(xy[i][1], 0, height - 1);
        assert_false(taken[xy[i][1] * width + xy[i][0]]++);
        assert_true(weight[i] > 0);
        sum += weight[i];
    }
    assert_near(sum, 1, 1e-9);
    /* Spread evenly: each quarter of a large picture holds a quarter of many pixels. */
    if (n >= 100 && height >= 100) {
        int quarter[4] = {0};
        for (int i = 0; i < n; i++)
            quarter[(xy[i][0] >= width / 2) + 2 * (xy[i][1] >= height / 2)]++;
        for (int q = 0; q < 4; q++)
            assert_near(quarter[q], n / 4.0, 4);
    }
    int(*again)[2] = calloc((size_t)n, sizeof *again);
    assert_non_null(again);
    cts_verify_places(&scene, (size_t)n, again, weight);
    assert_memory_equal(xy, again, (size_t)n * sizeof *xy);
    free(again);
    free(xy);
    free(weight);
    free(taken);
}

static void test_places(void **state)
{
    (void)state;
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

/* Errors planted by a known law: the estimate must find them, and the interval hold the truth. */
static void test_estimate(void **state)
{
    (void)state;
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
            /* Large on the left, small on the right, sometimes very large. */
            const double e = (random >> 16) / 65536.0 * 0.02 * (i % width < 50) + ((random >> 8) % 97 == 0 ? 0.05 : 0);
            truth += e * e / (width * height);
            for (int c = 0; c < 3; c++)
                picture->pixels[4 * i + c] = (float)(0.5 + e);
            picture->pixels[4 * i + 3] = 1;
        }
        static int xy[1000][2];
        static double weight[1000], rgba[1000][4];
        cts_verify_places(&scene, (size_t)n, xy, weight);
        for (int i = 0; i < n; i++)
            for (int c = 0; c < 4; c++)
                rgba[i][c] = c < 3 ? 0.5 : 1;
        CtsVerified v;
        assert_int_equal(cts_verify_against(&scene, picture, (size_t)n, (const int(*)[2])xy, weight,
                                            (const double(*)[4])rgba, &v, &err),
                         CTS_OK);
        assert_int_equal(v.pixels, n);
        assert_near(v.rmse, sqrt(truth), 0.5 * sqrt(truth));
        inside += v.rmse_low <= sqrt(truth) && sqrt(truth) <= v.rmse_high;
        assert_near(v.max, 0.06, 0.0101);
        assert_near(v.share_above, 0.22, 0.05);
        assert_true(v.p999 <= v.max && v.p999 >= 0.045);
        cts_picture_free(&picture);
    }
    assert_in_range(inside, 51, 60); /* 57 expected */
}

/* The whole way: raycast verified by itself is right, and a spoilt background is seen only where there is one. */
static void test_whole_way(void **state)
{
    (void)state;
    const int dims[3] = {9, 9, 9};
    const double spacing[3] = {1, 1, 1}, c[4] = {0, 100, 10, 20};
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsReport report = {0};
    CtsError err = {0};
    CtsRenderSettings settings;
    CtsPreset preset = cts_check_preset((CtsCheckPoint[]){{200, 0, {1, 0, 0}}, {600, 0.5, {0, 1, 1}}}, 2);
    assert_int_equal(cts_check_volume(&volume, dims, spacing, 1, cts_hu_linear, c, &err), CTS_OK);
    cts_render_defaults(&settings);
    settings.width = settings.height = 40;
    settings.engine = CTS_ENGINE_RAYCAST;
    settings.verify = 100;
    for (int mode = 0; mode < CTS_N_MODES; mode++) {
        settings.mode = mode;
        assert_int_equal(cts_render(volume, &preset, &settings, &picture, &report, &err), CTS_OK);
        assert_int_equal(report.verified.pixels, 100);
        assert_true(report.verified.rmse < 1e-7 && report.verified.max < 1e-6);
        cts_picture_free(&picture);
        cts_report_free(&report);
    }
    settings.verify = 1000000; /* more than there are: all */
    settings.mode = 0;
    assert_int_equal(cts_render(volume, &preset, &settings, &picture, &report, &err), CTS_OK);
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
