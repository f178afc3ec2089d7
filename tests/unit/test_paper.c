/* The paper's engines against formulas and the reference ray caster. */
#include "lab/check/check_scene.h"
#include "scenes.h"

static const double *centre_pixel(const CtsPicture *p, double rgba[4])
{
    const float *v = p->pixels + 4 * ((size_t)(p->height / 2) * (size_t)p->width + (size_t)(p->width / 2));
    for (int c = 0; c < 4; c++)
        rgba[c] = v[c];
    return rgba;
}

/* n layers of constant extinction are a slab of n - 1 layer distances, for every normalised kernel and any samples. */
static void test_slab(void **state)
{
    static const double opacities[] = {1e-6, 1e-3, 0.05, 0.5, 1};
    static const struct {
        double azimuth_deg, elevation_deg, length_mm;
    } views[] = {{0, 0, 20 * 0.7}, {90, 0, 16 * 1.1}, {0, 90, 12 * 2}, {180, 0, 20 * 0.7}};
    const int dims[3] = {17, 21, 13};
    const double spacing_mm[3] = {1.1, 0.7, 2}, hu = 500;
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_check_volume(&v, dims, spacing_mm, 1, cts_hu_constant, &hu, &err), CTS_OK);
    for (int o = 0; o < 5; o++)
        for (int view = 0; view < 4; view++)
            for (int kernel = 0; kernel < CTS_KERNEL_CONE_PAPER; kernel++)
                for (int samples = 1; samples < 4; samples += 2) {
                    const CtsPreset preset = cts_check_even_preset(opacities[o], 0.2, 0.5, 1);
                    CtsRenderSettings s =
                        settings_for(CTS_ENGINE_CLASSIC, 32, views[view].azimuth_deg, views[view].elevation_deg);
                    s.kernel = (CtsKernelId)kernel;
                    s.samples = samples;
                    CtsPicture *p = render(v, &preset, &s, NULL);
                    const double extinction = opacities[o] < 1 ? -log1p(-opacities[o]) : CTS_MAX_EXTINCTION_PER_MM;
                    const double alpha = -expm1(-extinction * views[view].length_mm);
                    double found[4];
                    centre_pixel(p, found);
                    /* float32: alpha is 1 less a transmittance near 1, so its error does not shrink with it. */
                    assert_true(fabs(found[3] - alpha) < 1e-6);
                    assert_true(fabs(found[0] - 0.2 * alpha) < 2e-6 * alpha + 1e-12);
                    assert_true(fabs(found[2] - alpha) < 4e-6 * alpha + 1e-12);
                    cts_picture_free(&p);
                }
    cts_volume_free(&v);
}

/* Outside the box nothing is visible: the front view of a box is a rectangle of its size in mm. */
static void test_box_outline(void **state)
{
    const int dims[3] = {11, 5, 7};
    const double spacing_mm[3] = {2, 1, 3}, hu = 1000;
    const CtsPreset preset = cts_check_even_preset(1, 1, 1, 1);
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_check_volume(&v, dims, spacing_mm, 1, cts_hu_constant, &hu, &err), CTS_OK);
    CtsRenderSettings s = settings_for(CTS_ENGINE_CLASSIC, 64, 0, 0);
    s.mm_per_pixel = 0.5;
    CtsPicture *p = render(v, &preset, &s, NULL);
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++) {
            const bool inside = fabs((x + 0.5 - 32) * 0.5) <= 10 && fabs((32 - y - 0.5) * 0.5) <= 9;
            assert_true((p->pixels[4 * (y * 64 + x) + 3] == 1) == inside);
        }
    cts_picture_free(&p);
    cts_volume_free(&v);
}

/* With the tent kernel classic samples the field that raycast integrates: more planes come nearer to it. */
static void test_raycast(void **state)
{
    static const double views[][2] = {{0, 0}, {90, 0}, {0, 90}, {-30, 20}, {45, 35}, {200, -50}};
    CtsVolume *v = phantom_head(40, 44, 32, 0);
    const double black[3] = {0, 0, 0};
    for (int shade = 0; shade < 2; shade++)
        for (int view = 0; view < 6; view++) {
            v->slice_layers = 1 + view % 3;
            const CtsPreset preset = preset_named("skin");
            CtsRenderSettings s = settings_for(CTS_ENGINE_RAYCAST, 72, views[view][0], views[view][1]);
            s.shade = shade ? CTS_ON : CTS_OFF;
            CtsPicture *truth = render(v, &preset, &s, NULL);
            cts_picture_over(truth, black, 1);
            double rmse[2];
            for (int i = 0; i < 2; i++) {
                CtsDifference d;
                CtsError err;
                s.engine = CTS_ENGINE_CLASSIC;
                s.samples = i ? 8 : 1;
                CtsPicture *p = render(v, &preset, &s, NULL);
                cts_picture_over(p, black, 1);
                assert_int_equal(cts_picture_compare(p, truth, &d, &err), CTS_OK);
                rmse[i] = d.rmse;
                cts_picture_free(&p);
            }
            print_message("classic, view %g,%g, %s: rmse %.5f, with 8 planes a layer %.5f\n", views[view][0],
                          views[view][1], shade ? "lit" : "unlit", rmse[0], rmse[1]);
            assert_true(rmse[0] < 0.06);
            assert_true(rmse[1] < 0.008);
            cts_picture_free(&truth);
        }
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slab),
        cmocka_unit_test(test_box_outline),
        cmocka_unit_test(test_raycast),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
