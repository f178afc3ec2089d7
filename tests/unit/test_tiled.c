/* The tiled engine: the same bytes on every path, close to the float64 reference, exact where formulas are known. */
#include "base/cpu.h"
#include "ctsplat/reference.h"
#include "scenes.h"

static const double views[][2] = {
    {0, 0},      {90, 0},      {180, 0}, {-90, 0}, {0, 90}, {0, -90}, {30, 20}, {45, 0}, {45, 35.26438968275466},
    {-120, -50}, {1e-9, 1e-9}, {7, 3}};
enum { N_VIEWS = sizeof views / sizeof views[0] };

static CtsPreset slab_preset(double extinction_per_mm)
{
    CtsPreset p = {.name = "slab", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
    const double opacity = -expm1(-extinction_per_mm);
    p.opacity[0] = (CtsOpacityPoint){-1000, opacity};
    p.opacity[1] = (CtsOpacityPoint){1000, opacity};
    p.colour[0] = (CtsColourPoint){-1000, {0.2, 0.4, 0.6}};
    p.colour[1] = (CtsColourPoint){1000, {0.2, 0.4, 0.6}};
    return p;
}

static void assert_same(const CtsPicture *a, const CtsPicture *b)
{
    assert_memory_equal(a->pixels, b->pixels, (size_t)a->width * (size_t)a->height * 4 * sizeof *a->pixels);
    if (a->depth_mm)
        assert_memory_equal(a->depth_mm, b->depth_mm, (size_t)a->width * (size_t)a->height * sizeof *a->depth_mm);
}

/* Plain C against AVX2 and AVX-512, one thread against many: every byte, on noise over the full range and on a phantom.
 */
static void same_bytes(void **state)
{
    (void)state;
    CtsVolume *volumes[] = {random_volume(33, 29, 21, 7), phantom_head(48, 44, 40, 20), random_volume(5, 2, 9, 3),
                            random_volume(9, 40, 3, 4)};
    static const char *const presets[] = {"bone", "skin"};
    for (size_t v = 0; v < 4; v++) {
        for (int view = 0; view < N_VIEWS; view++)
            for (int variant = 0; variant < 6; variant++) {
                const CtsPreset preset = preset_named(presets[variant & 1]);
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 61, views[view][0], views[view][1]);
                s.shade = variant & 2 ? CTS_ON : CTS_OFF;
                s.samples = variant == 1 ? 3 : 0;
                s.want_depth = true;
                if (variant == 3 || variant == 5)
                    s.mm_per_pixel = 4; /* pixels far apart: no windows */
                if (variant == 4)
                    s.mm_per_pixel = v == 1 ? 0.4 : 0.2; /* near: rows between are filled */
                CtsPicture *reference = NULL;
                for (int run = 0; run < 4; run++) {
                    static const int threads[4] = {1, 7, 2, 1};
                    static const unsigned cpu[4] = {0, 0, CTS_CPU_AVX2, ~0u};
                    s.n_threads = threads[run];
                    cts_cpu_set_mask(cpu[run]);
                    CtsPicture *p = render(volumes[v], &preset, &s, NULL);
                    if (reference)
                        assert_same(reference, p);
                    else
                        reference = p;
                    if (p != reference)
                        cts_picture_free(&p);
                }
                cts_picture_free(&reference);
            }
        cts_volume_free(&volumes[v]);
    }
}

/* A constant slab of n layers: opacity 1 - exp(-extinction * length), length from face to face of voxel centres, for
 * rays that leave by the faces they should, and no light outside. */
static void constant_slab(void **state)
{
    (void)state;
    static const double extinctions[] = {1e-8, 1e-4, 0.01, 0.3, 4, 40};
    for (size_t e = 0; e < sizeof extinctions / sizeof *extinctions; e++) {
        CtsVolume *v = NULL;
        CtsError err;
        assert_int_equal(cts_volume_new(&v, 20, 24, 30, &err), CTS_OK);
        for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
            v->grey[i] = 1024;
        v->step_lps[1][1] = 0.7;
        const CtsPreset preset = slab_preset(extinctions[e]);
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 64, 0, 0);
        CtsPicture *p = render(v, &preset, &s, NULL);
        const float *centre = p->pixels + 4 * (32 * 64 + 32);
        const double opacity = -expm1(-extinctions[e] * 23 * 0.7);
        const double stopped = opacity > 1 - 1.0 / 128 ? 1.0 / 128 : 0; /* rays may end that early */
        assert_true(fabs(centre[3] - opacity) <= 1e-6 * opacity + stopped + 1e-9);
        assert_true(fabs(centre[0] - 0.2 * opacity) <= 2e-6 * opacity + stopped + 1e-9);
        assert_true(p->pixels[3] == 0);
        cts_picture_free(&p);

        /* Oblique: from the ray's own way through the box. */
        s.azimuth_deg = 45;
        p = render(v, &preset, &s, NULL);
        const double way = 19 * sqrt(2) < 23 * 0.7 * sqrt(2) ? 19 * sqrt(2) : 23 * 0.7 * sqrt(2);
        const double mm = p->info.mm_per_pixel / 2; /* the middle pixels lie half a pixel off the centre */
        const double expected = -expm1(-extinctions[e] * way);
        centre = p->pixels + 4 * (32 * 64 + 32);
        assert_true(fabs(centre[3] - expected) <= extinctions[e] * 2 * mm + stopped + 1e-9);
        cts_picture_free(&p);
        cts_volume_free(&v);
    }
}

static double rms_between(const CtsPicture *a, const CtsPicture *b)
{
    CtsDifference d;
    CtsError err;
    assert_int_equal(cts_picture_compare(a, b, &d, &err), CTS_OK);
    return d.rmse;
}

/* Against the reference on a phantom with sharp edges: the default, and what --max-error asks for. */
static void near_reference(void **state)
{
    (void)state;
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    static const double bounds[2][2] = {{1.6, 0.125}, {2, 0.125}}; /* unlit, lit; in 1/255: default, --max-error 0.1 */
    for (int lit = 0; lit < 2; lit++)
        for (int view = 0; view < N_VIEWS; view++)
            for (int name = 0; name < 2; name++) {
                const CtsPreset preset = preset_named(name ? "skin" : "bone");
                CtsRenderSettings s = settings_for(CTS_ENGINE_RAYCAST, 96, views[view][0], views[view][1]);
                s.shade = lit ? CTS_ON : CTS_OFF;
                s.n_threads = 0;
                CtsPicture *reference = render(v, &preset, &s, NULL);
                s.engine = CTS_ENGINE_TILED;
                for (int precise = 0; precise < (view % 3 == name ? 2 : 1); precise++) {
                    s.max_error = precise ? 0.1 : 0;
                    CtsPicture *p = render(v, &preset, &s, NULL);
                    const double rms = 255 * rms_between(reference, p);
                    if (!(rms < bounds[lit][precise]))
                        fail_msg("%s at %g,%g lit %d precise %d: rms %.3f/255", preset.name, views[view][0],
                                 views[view][1], lit, precise, rms);
                    cts_picture_free(&p);
                }
                cts_picture_free(&reference);
            }
    cts_volume_free(&v);
}

/* Rows between rays: within the error, whatever way the rows run; the same colours with and without depth. */
static void filled_rows(void **state)
{
    (void)state;
    static const double turned[][2] = {{0, 0}, {90, 0}, {180, 0}, {0, 90}, {30, 20}, {-120, -50}, {7, 3}};
    CtsVolume *v = phantom_head(32, 32, 24, 10);
    for (int view = 0; view < (int)(sizeof turned / sizeof *turned); view++)
        for (int levels = 1; levels <= 3; levels++) {
            const CtsPreset preset = preset_named(view & 1 ? "skin" : "bone");
            CtsReport report = {0};
            CtsRenderSettings s = settings_for(CTS_ENGINE_RAYCAST, 150, turned[view][0], turned[view][1]);
            s.shade = CTS_OFF;
            s.n_threads = 0;
            s.mm_per_pixel = 1.0 / (1 << levels);
            CtsPicture *reference = render(v, &preset, &s, NULL);
            s.engine = CTS_ENGINE_TILED;
            s.samples = 2;
            CtsPicture *marched = render(v, &preset, &s, NULL);
            s.samples = 0;
            CtsPicture *filled = render(v, &preset, &s, &report);
            char plan[40];
            snprintf(plan, sizeof plan, "rows: 1 of %d marched", 1 << levels);
            assert_non_null(strstr(report.plan, plan));
            const double with = 255 * rms_between(reference, filled), without = 255 * rms_between(reference, marched);
            if (!(with < without + 0.5))
                fail_msg("%s at %g,%g, %d levels: rms %.3f/255, all marched %.3f", preset.name, turned[view][0],
                         turned[view][1], levels, with, without);
            s.want_depth = true;
            CtsPicture *deep = render(v, &preset, &s, NULL);
            assert_same(filled, deep);
            cts_picture_free(&deep);
            cts_picture_free(&filled);
            cts_picture_free(&marched);
            cts_picture_free(&reference);
            cts_report_free(&report);
        }
    cts_volume_free(&v);
}

/* Every built-in preset, unlit, at the default: also those whose opacity jumps and whose colours change within a few
 * HU, where what one slab's colours hide of one another would show. */
static void hard_presets(void **state)
{
    (void)state;
    static const double angles[2][2] = {{0, 0}, {30, 20}}, bounds[2] = {0.5, 1.1};
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    const CtsPreset *preset;
    for (size_t i = 0; (preset = cts_preset_builtin(i)); i++)
        for (int view = 0; view < 2 && preset->mode == CTS_MODE_COMPOSITE; view++) {
            CtsReference *reference;
            CtsVerified verified;
            CtsError err;
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 128, angles[view][0], angles[view][1]);
            s.shade = CTS_OFF;
            assert_int_equal(cts_reference_new(&reference, v, preset, &s, 400, &err), CTS_OK);
            CtsPicture *p = render(v, preset, &s, NULL);
            assert_int_equal(cts_reference_compare(reference, p, &verified, &err), CTS_OK);
            if (!(255 * verified.rmse < bounds[view]))
                fail_msg("%s at %g,%g: rms %.3f/255", preset->name, angles[view][0], angles[view][1],
                         255 * verified.rmse);
            cts_picture_free(&p);
            cts_reference_free(&reference);
        }
    cts_volume_free(&v);
}

/* With a fixed number of sheets the error falls with the square of their distance. */
static void second_order(void **state)
{
    (void)state;
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 24, 24, 24, &err), CTS_OK);
    for (int k = 0, at = 0; k < 24; k++)
        for (int j = 0; j < 24; j++)
            for (int i = 0; i < 24; i++, at++)
                v->grey[at] = (uint16_t)lrint(10000 + 6000 * sin(0.5 * i) * cos(0.4 * j + 0.3) * cos(0.45 * k));
    v->hu_step = 0.0625;
    CtsPreset preset = {.name = "soft", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
    preset.opacity[0] = (CtsOpacityPoint){-1000, 0};
    preset.opacity[1] = (CtsOpacityPoint){0, 0.4};
    preset.colour[0] = (CtsColourPoint){-1000, {0, 0.5, 1}};
    preset.colour[1] = (CtsColourPoint){0, {1, 0.5, 0}};
    CtsRenderSettings s = settings_for(CTS_ENGINE_RAYCAST, 48, 35, 25);
    s.mm_per_pixel = 0.3;
    CtsPicture *reference = render(v, &preset, &s, NULL);
    double error[3];
    s.engine = CTS_ENGINE_TILED;
    s.max_error = 0.001;
    for (int i = 0; i < 3; i++) {
        s.samples = 2 << i;
        CtsPicture *p = render(v, &preset, &s, NULL);
        error[i] = rms_between(reference, p);
        cts_picture_free(&p);
    }
    const double order = log2(error[0] / error[1]);
    if (!(fabs(order - 2) < 0.15))
        fail_msg("order %.3f (errors %g %g %g)", order, error[0], error[1], error[2]);
    cts_picture_free(&reference);
    cts_volume_free(&v);
}

/* Nothing visible, one voxel, one layer: empty pictures, no fault. */
static void degenerate(void **state)
{
    (void)state;
    static const int sizes[][3] = {{1, 1, 1}, {1, 1, 9}, {9, 1, 1}, {1, 9, 9}, {2, 2, 2}, {3, 1, 4}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int view = 0; view < N_VIEWS; view++)
            for (int lit = 0; lit < 2; lit++) {
                CtsVolume *v = random_volume(sizes[i][0], sizes[i][1], sizes[i][2], 11);
                const CtsPreset preset = preset_named("bone");
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 17, views[view][0], views[view][1]);
                s.shade = lit ? CTS_ON : CTS_OFF;
                s.mm_per_pixel = 0.3;
                CtsPicture *p = render(v, &preset, &s, NULL);
                for (int at = 0; at < 17 * 17 * 4; at++)
                    assert_true(isfinite(p->pixels[at]) && p->pixels[at] >= 0);
                cts_picture_free(&p);
                cts_volume_free(&v);
            }
}

/* mip, minip and average against the reference, to half a grey level of 16 bits over the whole range of HU. */
static void modes_exact(void **state)
{
    (void)state;
    CtsVolume *volumes[] = {random_volume(23, 19, 17, 5), phantom_head(40, 36, 30, 30), random_volume(1, 6, 9, 2)};
    for (int i = 0; i < 3; i++) {
        CtsPreset preset = preset_named("bone");
        preset.window_low_hu = -1024;
        preset.window_high_hu = 64511;
        for (int view = 0; view < N_VIEWS; view++)
            for (int mode = CTS_MODE_MIP; mode < CTS_N_MODES; mode++) {
                CtsRenderSettings s = settings_for(CTS_ENGINE_RAYCAST, 33, views[view][0], views[view][1]);
                s.mode = mode;
                CtsPicture *reference = render(volumes[i], &preset, &s, NULL);
                s.engine = CTS_ENGINE_TILED;
                s.n_threads = 2;
                CtsPicture *p = render(volumes[i], &preset, &s, NULL);
                for (size_t at = 0; at < 4 * 33 * 33; at++)
                    if (!(fabs(p->pixels[at] - reference->pixels[at]) < 0.5 / 65535))
                        fail_msg("%s at %g,%g: %.9g, not %.9g", cts_mode_names[mode], views[view][0], views[view][1],
                                 (double)p->pixels[at], (double)reference->pixels[at]);
                cts_picture_free(&p);
                cts_picture_free(&reference);
            }
        cts_volume_free(&volumes[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bytes),  cmocka_unit_test(constant_slab), cmocka_unit_test(near_reference),
        cmocka_unit_test(filled_rows), cmocka_unit_test(hard_presets),  cmocka_unit_test(second_order),
        cmocka_unit_test(degenerate),  cmocka_unit_test(modes_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
