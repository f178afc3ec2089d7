/* Depth: how far the first visible surface is from the camera plane, against the formula, from render to file. */
#include "folder.h"
#include "scenes.h"

/* A ball of this radius, its surface where the HU pass 0, in a box whose voxels are no cubes. */
enum { N = 40, SIZE = 48 };
static const double radius_mm = 13;

static CtsVolume *ball(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    double centre[3];
    assert_int_equal(cts_volume_new(&v, N, N, N - 8, &err), CTS_OK);
    v->step_lps[2][2] = 1.25;
    cts_volume_centre_lps(v, centre);
    size_t at = 0;
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++, at++) {
                double r2 = 0;
                for (int c = 0; c < 3; c++) {
                    const double lps = v->origin_lps[c] + i * v->step_lps[0][c] + j * v->step_lps[1][c] +
                                       k * v->step_lps[2][c] - centre[c];
                    r2 += lps * lps;
                }
                const double hu = 300 * (radius_mm - sqrt(r2));
                v->grey[at] = (uint16_t)(1024 + fmin(fmax(hu, -1024), 1500));
            }
    return v;
}

/* Opaque from 0 HU on. */
static CtsPreset opaque(void)
{
    CtsPreset p = preset_named("ct-bone");
    p.shade = false;
    p.n_opacity = 2;
    p.opacity[0] = (CtsOpacityPoint){0, 0};
    p.opacity[1] = (CtsOpacityPoint){0, 1};
    return p;
}

/* Each pixel whose ray meets the ball not too flat within low_mm..high_mm of the formula; rays past it meet nothing. */
static void check_ball(const CtsPicture *p, double low_mm, double high_mm)
{
    const double mm_per_pixel = p->info.mm_per_pixel;
    assert_non_null(p->depth_mm);
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++) {
            const double u = (x + 0.5 - p->width / 2.0) * mm_per_pixel, v = (p->height / 2.0 - y - 0.5) * mm_per_pixel;
            const double past_mm = hypot(u, v) / radius_mm, found = (double)p->depth_mm[y * p->width + x];
            const double expected = p->info.camera_mm - sqrt(fmax(0, radius_mm * radius_mm - u * u - v * v));
            if (past_mm < 0.8 && !(found >= expected + low_mm && found <= expected + high_mm))
                fail_msg("engine %s, pixel %d,%d: depth %g, not %g", p->info.engine, x, y, found, expected);
            if (past_mm > 1.05)
                assert_true(isinf(found) && found > 0);
        }
}

/* The file holds what the picture does. */
static void check_file(const CtsPicture *p)
{
    char folder[64], path[100];
    const CtsExportSettings plain = {.n_threads = 1};
    CtsPicture *back;
    CtsError err;
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.exr", folder);
    assert_int_equal(cts_export(&p, 1, path, &plain, NULL, NULL, &err), CTS_OK);
    assert_int_equal(cts_picture_read(path, &back, &err), CTS_OK);
    assert_non_null(back->depth_mm);
    assert_memory_equal(p->depth_mm, back->depth_mm, (size_t)p->width * (size_t)p->height * sizeof *p->depth_mm);
    cts_picture_free(&back);
    remove_folder(folder);
}

/* From six sides and oblique. The tiled engine splits a layer's slab into parts and reports the middle of one; the
 * paper's engines sample the field on planes only: their surface lies up to one plane behind the true one. */
static void test_ball(void **state)
{
    static const double views[][2] = {{0, 0}, {90, 0}, {180, 0}, {0, 90}, {30, 20}, {-100, -50}};
    CtsVolume *v = ball();
    const CtsPreset preset = opaque();
    for (int run = 0; run <= CTS_N_ENGINES; run++)
        for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
            /* The tiled engine once more with pixels so fine that it fills rows between rays. */
            const bool fine = run == CTS_N_ENGINES;
            const int engine = fine ? CTS_ENGINE_TILED : run, finer = fine ? 3 : 1;
            CtsRenderSettings s = settings_for((CtsEngineId)engine, finer * SIZE, views[i][0], views[i][1]);
            s.mm_per_pixel = 0.7 / finer;
            s.want_depth = true;
            CtsPicture *p = render(v, &preset, &s, NULL);
            const bool exact = engine == CTS_ENGINE_RAYCAST, cut = engine == CTS_ENGINE_TILED;
            check_ball(p, cut ? -0.33 : -0.06, exact ? 0.06 : cut ? 0.1 : 1.25 * sqrt(3) + 0.06);
            if (i == 4)
                check_file(p);
            cts_picture_free(&p);
        }
    cts_volume_free(&v);
}

/* Depth is computed when requested, in the mode with surfaces, and the report says when it is left out. */
static void test_left_out(void **state)
{
    CtsVolume *v = ball();
    const CtsPreset preset = opaque();
    for (int wanted = 0; wanted < 2; wanted++)
        for (int mode = 0; mode < CTS_N_MODES; mode++) {
            CtsReport report = {0};
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 8, 0, 0);
            s.mode = mode;
            s.want_depth = wanted;
            CtsPicture *p = render(v, &preset, &s, &report);
            bool skipped = false;
            for (size_t i = 0; i < report.n_skips; i++)
                skipped |= strcmp(report.skips[i].what, "depth") == 0;
            assert_int_equal(p->depth_mm != NULL, wanted && mode == CTS_MODE_COMPOSITE);
            assert_int_equal(skipped, !p->depth_mm);
            cts_report_free(&report);
            cts_picture_free(&p);
        }
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_ball), cmocka_unit_test(test_left_out)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
