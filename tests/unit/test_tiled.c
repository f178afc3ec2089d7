/* The tiled engine: the same bytes on every SIMD path, close to the float64 reference, exact where formulas are
 * known. */
#include "base/cpu.h"
#include "base/random.h"
#include "base/sanitized.h"
#include "core/scene/visible.h"
#include "views.h"

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

/* Plain C against AVX2 and AVX-512, one thread against many: every byte, on noise over the full range and on a phantom.
 */
static void same_bytes(void **state)
{
    CtsVolume *volumes[] = {random_volume(33, 29, 21, 7), phantom_head(48, 44, 40, 20), random_volume(5, 2, 9, 3),
                            random_volume(9, 40, 3, 4)};
    static const char *const names[] = {"noise 33 x 29 x 21", "head 48 x 44 x 40", "noise 5 x 2 x 9",
                                        "noise 9 x 40 x 3"};
    static const char *const runs[] = {"plain C, 1 thread", "plain C, 7 threads", "AVX2, 2 threads",
                                       "all SIMD paths, 1 thread"};
    static const char *const presets[] = {"bone", "skin"};
    for (size_t v = 0; v < 4; v++) {
        volumes[v]->slice_layers = 1 + (int)v; /* gradients over as many layers */
        for (int view = 0; view < N_VIEWS; view++)
            for (int variant = 0; variant < 10; variant++) {
                if ((view + variant + (int)v) % (CTS_SANITIZED ? 24 : 4)) /* each often enough, not all with all */
                    continue;
                CtsPreset preset = preset_named(presets[variant & 1]);
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 61, views[view][0], views[view][1]);
                s.shade = variant & 2 ? CTS_ON : CTS_OFF;
                s.samples = variant == 1 ? 3 : 0;
                s.occlusion = view % 2 ? 0.7 : CTS_OCCLUSION_AS_PRESET;
                s.want_depth = true;
                if (variant == 3 || variant == 5)
                    s.mm_per_pixel = 4; /* pixels far apart: no windows */
                if (variant == 6)       /* it shows a little air: one-sided differences at the border */
                    preset.opacity[0].opacity = 0.01;
                if (variant == 4)
                    s.mm_per_pixel = v == 1 ? 0.4 : 0.2; /* near: several rows to a voxel */
                if (variant >= 7) {                      /* previews, with a depth and without */
                    s.max_error = variant;
                    s.want_depth = variant == 9;
                    s.mm_per_pixel = variant == 8 ? 0.2 : 0.7;
                    s.width = 1 << 17 >> 6; /* most of it is empty */
                    s.height = 64;
                }
                CtsPicture *reference = NULL;
                for (int run = 0; run < 4; run++) {
                    static const int threads[4] = {1, 7, 2, 1};
                    static const unsigned cpu[4] = {0, 0, CTS_CPU_AVX2, ~0u};
                    s.n_threads = threads[run];
                    cts_cpu_set_mask(cpu[run]);
                    CtsPicture *p = render(volumes[v], &preset, &s, NULL);
                    if (reference)
                        assert_same_picture(reference, p, "volume %s, view %g,%g, variant %d, %s", names[v],
                                            views[view][0], views[view][1], variant, runs[run]);
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
 * rays through both faces, and nothing outside. */
static void constant_slab(void **state)
{
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
        /* rays may end with the requested error as remaining transmittance */
        double stopped = opacity > 0.998 ? 0.5 / 255 : 0;
        assert_true(fabs(centre[3] - opacity) <= 1e-6 * opacity + stopped + 1e-9);
        assert_true(fabs(centre[0] - 0.2 * opacity) <= 2e-6 * opacity + stopped + 1e-9);
        assert_true(p->pixels[3] == 0);
        cts_picture_free(&p);

        /* Oblique: by the ray's length within the box. */
        s.azimuth_deg = 45;
        p = render(v, &preset, &s, NULL);
        /* Rays near the middle all pass through the two nearer faces. */
        assert_true(p->info.mm_per_pixel < 19 - 23 * 0.7);
        const double expected = -expm1(-extinctions[e] * 23 * 0.7 * sqrt(2));
        stopped = expected > 0.998 ? 0.5 / 255 : 0;
        centre = p->pixels + 4 * (32 * 64 + 32);
        assert_true(fabs(centre[3] - expected) <= 2e-6 * expected + stopped + 1e-9);
        cts_picture_free(&p);
        cts_volume_free(&v);
    }
}

/* Levels 500 and 501 side by side, and a step at 500.999 that halves light within 0.02 mm, of which there is 0.001: the
 * step's position needs more digits than a float has. In a small picture all pixels are re-rendered. */
static void step_near_level(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 12, 2, 12, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = (uint16_t)(1524 + i / 12 % 2);
    CtsPreset preset = {.name = "step", .unit_distance_mm = 0.02, .n_opacity = 2, .n_colour = 1};
    preset.opacity[0] = (CtsOpacityPoint){500.999, 0};
    preset.opacity[1] = (CtsOpacityPoint){500.999, 0.5};
    preset.colour[0] = (CtsColourPoint){0, {1, 1, 1}};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 16, 0, 0);
    s.shade = CTS_OFF;
    CtsPicture *p = render(v, &preset, &s, NULL);
    const double red = (double)p->pixels[4 * (8 * 16 + 8)], expected = 1 - exp2(-0.05);
    if (!(fabs(red - expected) < 1e-5))
        fail_msg("%g, not %g", red, expected);
    cts_picture_free(&p);
    cts_volume_free(&v);
}

static double rms_between(const CtsPicture *a, const CtsPicture *b)
{
    CtsDifference d;
    CtsError err;
    assert_int_equal(cts_picture_compare(a, b, &d, &err), CTS_OK);
    return d.rmse;
}

/* Renders by tiled and checks the picture against its report: the error against the ray caster's picture must not
 * exceed the reported limit, nor the requested error (1/255, 0.5 by default) unless a warning says so. Returns it. */
static double hold_to_bound(const CtsVolume *v, const CtsPreset *preset, CtsRenderSettings s, const char *what)
{
    CtsReport report = {0};
    s.engine = CTS_ENGINE_RAYCAST;
    CtsPicture *reference = render(v, preset, &s, NULL);
    s.engine = CTS_ENGINE_TILED;
    CtsPicture *p = render(v, preset, &s, &report);
    const double rms = rms_between(reference, p), asked = (s.max_error > 0 ? s.max_error : 0.5) / 255;
    const bool warned = cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_ERROR_BOUND);
    assert_true(report.bound.known);
    if (!(rms <= report.bound.rmse + 2e-6) || !(rms <= asked + 2e-6 || warned))
        fail_msg("%s, %s%s at %g,%g, %g mm a pixel, requested %g: %.3f/255 rms, reported %.3f%s", what, preset->name,
                 s.shade == CTS_ON ? " lit" : "", s.azimuth_deg, s.elevation_deg, s.mm_per_pixel, s.max_error,
                 255 * rms, 255 * report.bound.rmse, warned ? " with a warning" : "");
    cts_picture_free(&p);
    cts_picture_free(&reference);
    cts_report_free(&report);
    return rms;
}

/* A phantom with sharp edges: the default, and the errors that --max-error requests. */
static void near_reference(void **state)
{
    CtsVolume *v = phantom_head(64, 64, 48, 10);
    v->slice_layers = 2;
    for (int lit = 0; lit < 2; lit++)
        for (int view = 0; view < N_VIEWS; view++)
            for (int name = 0; name < 2; name++) {
                if (CTS_SANITIZED && (lit + 2 * name + view) % 4) /* each view once */
                    continue;
                const CtsPreset preset = preset_named(name ? "skin" : "bone");
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 96, views[view][0], views[view][1]);
                s.shade = lit ? CTS_ON : CTS_OFF;
                s.n_threads = 0;
                assert_true(hold_to_bound(v, &preset, s, "phantom") <= 0.5 / 255);
                s.max_error = 0.1;
                if (view % 3 == name && !CTS_SANITIZED)
                    hold_to_bound(v, &preset, s, "phantom");
            }
    cts_volume_free(&v);
}

static uint16_t *voxel(CtsVolume *v, int i, int j, int k)
{
    return &v->grey[(size_t)(k * v->dims[1] + j) * (size_t)v->dims[0] + (size_t)i];
}

/* Soft tissue with plates, wires, dots or a helix of metal in it, one voxel thick, by number; random levels. */
static CtsVolume *thin_things(int kind)
{
    enum { N = 40, METAL = 2500 + 1024, TISSUE = 50 + 1024 };
    CtsVolume *v = kind == 4 ? random_volume(N, N, N, 5) : NULL;
    CtsError err;
    if (v)
        return v;
    assert_int_equal(cts_volume_new(&v, N, N, N, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = TISSUE;
    for (int k = 8; k < 32; k++)
        for (int j = 8; j < 32; j++)
            for (int i = 8; i < 32; i++)
                if ((kind == 0 && k % 8 == 0) || (kind == 1 && k % 8 == 0 && j % 8 == 0) ||
                    (kind == 2 && k % 6 == 0 && j % 6 == 0 && i % 6 == 0))
                    *voxel(v, i, j, k) = METAL;
    for (double turn = 0; kind == 3 && turn < 6 * M_PI; turn += 0.01)
        *voxel(v, (int)lrint(20 + 9 * cos(turn)), (int)lrint(20 + 9 * sin(turn)),
               (int)lrint(8 + turn / (6 * M_PI) * 24)) = METAL;
    return v;
}

/* Opacity that jumps at 1800 HU, at a pixel spacing that leaves several rows to a voxel. */
static void thin_and_hard(void **state)
{
    static const double angles[][2] = {{0, 0}, {30, 20}, {63, -37}, {17, 4}};
    static const char *const names[] = {"plates", "wires", "dots", "helix", "noise"};
    CtsPreset preset = {.name = "step", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 1};
    preset.opacity[0] = (CtsOpacityPoint){1800, 0};
    preset.opacity[1] = (CtsOpacityPoint){1800, 0.9};
    preset.colour[0] = (CtsColourPoint){0, {0.9, 0.8, 0.6}};
    for (int kind = 0; kind < 5; kind++) {
        CtsVolume *v = thin_things(kind);
        for (int view = 0; view < 4; view++)
            for (int scale = CTS_SANITIZED; scale < 2; scale++) {
                CtsRenderSettings s =
                    settings_for(CTS_ENGINE_TILED, scale ? 64 : 144, angles[view][0], angles[view][1]);
                s.mm_per_pixel = scale ? 0.8 : 0.25;
                hold_to_bound(v, &preset, s, names[kind]);
            }
        cts_volume_free(&v);
    }
}

/* Visible only between two grey levels. */
static void between_levels(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 24, 24, 24, &err), CTS_OK);
    for (int k = 0, at = 0; k < 24; k++)
        for (int j = 0; j < 24; j++)
            for (int i = 0; i < 24; i++, at++)
                v->grey[at] = (uint16_t)(1024 + (j >= 12));
    CtsPreset preset = {.name = "peak", .unit_distance_mm = 1, .n_opacity = 3, .n_colour = 1};
    preset.opacity[0] = (CtsOpacityPoint){0.02, 0};
    preset.opacity[1] = (CtsOpacityPoint){0.5, 0.8};
    preset.opacity[2] = (CtsOpacityPoint){0.98, 0};
    preset.colour[0] = (CtsColourPoint){0, {1, 1, 1}};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 33, 0, 0);
    s.shade = CTS_OFF;
    hold_to_bound(v, &preset, s, "between levels");
    CtsPicture *p = render(v, &preset, &s, NULL);
    /* The integral of -log(1 - opacity) over both ramps, along the one layer distance in which the field rises. */
    const double depth =
        0.96 * (1 + 0.25 * log(0.2)); /* mean of -log(1 - x) on 0..0.8 is 1 + (1 - 0.8) log(0.2) / 0.8 */
    if (!(fabs(p->pixels[4 * (16 * 33 + 16)] + expm1(-depth)) < 1e-3))
        fail_msg("%g for %g", (double)p->pixels[4 * (16 * 33 + 16)], -expm1(-depth));
    cts_picture_free(&p);
    cts_volume_free(&v);
}

/* A cell that rays cross along a diagonal, where the field rises and falls again, with equal values at both Gauss
 * points: an opaque medium shows its colour at the rays' entry. */
static void opaque_bump(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 2, 2, 2, &err), CTS_OK);
    for (int at = 0; at < 8; at++)
        v->grey[at] = (uint16_t)(1024 + 400 * ((at & 1) != (at >> 1 & 1)));
    CtsPreset preset = {.name = "opaque", .unit_distance_mm = 1, .n_opacity = 1, .n_colour = 2};
    preset.opacity[0] = (CtsOpacityPoint){-100, 1};
    preset.colour[0] = (CtsColourPoint){0, {0, 0, 0}};
    preset.colour[1] = (CtsColourPoint){400, {1, 1, 1}};
    for (int turned = 0; turned < 4; turned++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 33, 45 + 90 * turned, 0);
        s.shade = CTS_OFF;
        s.mm_per_pixel = 0.02;
        hold_to_bound(v, &preset, s, "bump");
    }
    cts_volume_free(&v);
}

/* Opaque stripes narrower than a level: fields that cross a stripe twice within a cell, or touch its edge at the end of
 * one, where the first crossing determines the colour; and a peak of opacity between two levels, shaded in steps. */
static void narrow_stripes(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 9, 9, 9, &err), CTS_OK);
    for (uint64_t at = 0; at < 9 * 9 * 9; at++)
        v->grey[at] = (uint16_t)(1524 + (cts_random_bits(at + 1) >> 63));
    CtsPreset stripes = {.name = "stripes", .unit_distance_mm = 1, .n_opacity = 4, .n_colour = 3};
    stripes.opacity[0] = (CtsOpacityPoint){500.12305549489855, 0};
    stripes.opacity[1] = (CtsOpacityPoint){500.12305549489855, 1};
    stripes.opacity[2] = (CtsOpacityPoint){500.7191570985, 1};
    stripes.opacity[3] = (CtsOpacityPoint){500.7191570985, 0};
    stripes.colour[0] = (CtsColourPoint){500.4628946090881, {0, 0, 0}};
    stripes.colour[1] = (CtsColourPoint){500.4628946090881, {1, 1, 1}};
    stripes.colour[2] = (CtsColourPoint){500.7191570985, {1, 1, 1}};
    CtsPreset peak = preset_named("bone");
    peak.n_opacity = 3;
    peak.opacity[0] = (CtsOpacityPoint){500.02, 0};
    peak.opacity[1] = (CtsOpacityPoint){500.5, 1};
    peak.opacity[2] = (CtsOpacityPoint){500.98, 0};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 160, 723, -47.63);
    s.mm_per_pixel = 0.03;
    s.shade = CTS_OFF;
    hold_to_bound(v, &stripes, s, "stripes");
    s.width = s.height = 24; /* all pixels are re-rendered */
    s.mm_per_pixel = 0.2;
    s.shade = CTS_ON;
    assert_true(hold_to_bound(v, &peak, s, "peak") < 0.01 / 255);
    cts_volume_free(&v);
}

/* A peak narrower than a level between voxels far apart, in levels of 0.002 as those of a PET: how precise a level is
 * does not depend on its unit. */
static void fine_levels(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 9, 9, 9, &err), CTS_OK);
    v->hu_offset = 0;
    v->hu_step = 0.002;
    for (uint64_t at = 0; at < 9 * 9 * 9; at++)
        v->grey[at] = (uint16_t)(1324 + 400 * (cts_random_bits(at + 1) >> 63));
    CtsPreset peak = preset_named("bone");
    peak.n_opacity = 3;
    for (int i = 0; i < 3; i++)
        peak.opacity[i] = (CtsOpacityPoint){v->hu_step * (1524.02 + 0.48 * i), i == 1};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 160, 723, -47.63);
    s.mm_per_pixel = 0.03;
    s.shade = CTS_OFF;
    assert_true(hold_to_bound(v, &peak, s, "peak") < 0.5 / 255);
    cts_volume_free(&v);
}

/* Steps of opacity depend on the range of the volume's values. */
static void steps_of_quantities(void **state)
{
    const CtsVolume hu = {.quantity = CTS_QUANTITY_HU}, weak = {.quantity = CTS_QUANTITY_STORED, .bright_value = 84},
                    strong = {.quantity = CTS_QUANTITY_STORED, .bright_value = 4200};
    CtsPreset ramp = {.name = "ramp", .unit_distance_mm = 1, .n_opacity = 2};
    ramp.opacity[0] = (CtsOpacityPoint){40, 0};
    ramp.opacity[1] = (CtsOpacityPoint){70, 0.5};
    assert_true(cts_scene_has_step(&ramp, &hu) && cts_scene_has_step(&ramp, &strong));
    assert_false(cts_scene_has_step(&ramp, &weak));
    ramp.opacity[1].hu = 41;
    assert_true(cts_scene_has_step(&ramp, &weak));
}

/* Shells of low opacity whose sides are visible separately: the space between two of them has no gradient, and
 * contributes no light. */
static void faint_shells(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 8, 61, 8, &err), CTS_OK);
    for (int at = 0; at < 8 * 61 * 8; at++)
        v->grey[at] = (uint16_t)(1024 + 600 * (at / 8 % 61 % 12 >= 6));
    CtsPreset preset = preset_named("lung");
    preset.n_opacity = 3;
    preset.opacity[0] = (CtsOpacityPoint){200, 0};
    preset.opacity[1] = (CtsOpacityPoint){300, 0.016};
    preset.opacity[2] = (CtsOpacityPoint){400, 0};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 160, 0, 0);
    s.shade = CTS_ON;
    s.mm_per_pixel = 0.02;
    assert_true(hold_to_bound(v, &preset, s, "shells") <= 0.5 / 255);
    cts_volume_free(&v);
}

/* Every built-in preset at the default: also those whose opacity jumps and whose colours change within a few HU. */
static void hard_presets(void **state)
{
    static const double angles[2][2] = {{0, 0}, {30, 20}};
    CtsVolume *v = phantom_head(40, 40, 32, 10);
    const CtsPreset *preset;
    for (size_t i = 0; (preset = cts_preset_builtin(i)); i += CTS_SANITIZED ? 5 : 1)
        for (int view = 0; view < 2 && preset->mode == CTS_MODE_COMPOSITE && preset->scale == CTS_SCALE_HU; view++) {
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 64, angles[view][0], angles[view][1]);
            s.n_threads = 0;
            s.shade = i % 2 ? CTS_ON : CTS_OFF;
            hold_to_bound(v, preset, s, "phantom");
        }
    cts_volume_free(&v);
}

/* A field of waves and a soft preset: the error falls with the requested one, down to the limits of single
 * precision. */
static void falls_as_asked(void **state)
{
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
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 48, 35, 25);
    s.mm_per_pixel = 0.3;
    static const double asked[] = {8, 0.5, 0.1, 0.02};
    double before = INFINITY;
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        s.max_error = asked[i];
        const double rms = hold_to_bound(v, &preset, s, "waves");
        assert_true(rms <= before);
        before = rms;
    }
    /* More sheets are not worse. */
    s.max_error = 0;
    s.samples = 8;
    const double eight = hold_to_bound(v, &preset, s, "waves");
    s.samples = 64;
    assert_true(hold_to_bound(v, &preset, s, "waves") <= eight + 2e-6);
    cts_volume_free(&v);
}

/* A preview of grain, in which a few reference samples would give an estimate above the requested error: more of them
 * are taken, without a warning. */
static void drafts_work_on(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    CtsReport report = {0};
    enum { SIZE = 48 };
    assert_int_equal(cts_volume_new(&v, SIZE, SIZE, SIZE, &err), CTS_OK);
    for (int at = 0; at < SIZE * SIZE * SIZE; at++) {
        const int x = at % SIZE - SIZE / 2, y = at / SIZE % SIZE - SIZE / 2, z = at / SIZE / SIZE - SIZE / 2;
        int grain = 0;
        for (uint64_t i = 0; i < 4; i++)
            grain += (int)(cts_random_bits(4 * (uint64_t)at + i) >> 56) - 128;
        v->grey[at] = (uint16_t)(x * x + y * y + z * z < 22 * 22 ? 1024 + grain * 2 / 5 : 24);
    }
    CtsPreset preset = preset_named("ct-bone");
    preset.unit_distance_mm /= 2;
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 300, 30, 20);
    s.mm_per_pixel = 0.17;
    s.max_error = 16;
    CtsPicture *p = render(v, &preset, &s, &report);
    /* One pixel of twelve is the most that is re-rendered; what these leave is 1 % here. */
    if (!report.bound.known || !(report.bound.rmse < 1.02 * 16 / 255))
        fail_msg("a draft's error comes to %.2f/255, 16 requested", 255 * report.bound.rmse);
    cts_picture_free(&p);
    cts_report_free(&report);
    cts_volume_free(&v);
}

/* Bright columns between the pixels that a preview samples, every fourth: it detects them, or warns. Balls: similar
 * pixels are interpolated, and the error stays within the requested one. */
static void drafts_between(void **state)
{
    enum { N = 96 };
    CtsVolume *columns = NULL, *ball = phantom_head(N, N, N, 40);
    CtsError err;
    assert_int_equal(cts_volume_new(&columns, N, 8, N, &err), CTS_OK);
    const CtsPreset slab = slab_preset(0.5), bone = preset_named("bone");
    CtsPreset bright = slab;
    bright.colour[0] = (CtsColourPoint){-1000, {0.1, 0.1, 0.1}};
    bright.colour[1] = (CtsColourPoint){1000, {1, 1, 1}};
    for (int at = 0; at < 4; at++) {
        for (int i = 0; i < N * 8 * N; i++)
            columns->grey[i] = i % N % 4 == at ? 2000 : 0;
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, N, 0, 0);
        s.mm_per_pixel = 1;
        s.max_error = 8;
        hold_to_bound(columns, &bright, s, "columns");
        s.max_error = 16;
        s.elevation_deg = 3;
        hold_to_bound(columns, &bright, s, "columns, tilted");
    }
    for (int asked = 6; asked <= 24; asked += 6)
        for (int size = 61; size <= 64; size++) {
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, size, 10 * asked, asked);
            s.max_error = asked;
            s.shade = asked % 12 ? CTS_ON : CTS_OFF;
            assert_true(hold_to_bound(ball, &bone, s, "ball") > 0.1 / 255);
        }
    cts_volume_free(&columns);
    cts_volume_free(&ball);
}

/* Specks of hardly a pixel on an even ground, so few that no reference sample need hit one: the randomly drawn pixels
 * estimate their number. */
static void drafts_miss_specks(void **state)
{
    enum { N = 1024 };
    CtsPreset bright = slab_preset(4);
    bright.colour[0] = (CtsColourPoint){-1000, {0.1, 0.1, 0.1}};
    bright.colour[1] = (CtsColourPoint){1000, {1, 1, 1}};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, N / 2, 0, 0);
    s.mm_per_pixel = 2;
    s.max_error = 8;
    s.shade = CTS_OFF;
    for (uint64_t seed = 1; seed <= (CTS_SANITIZED ? 1 : 4); seed++) {
        CtsVolume *v = NULL;
        CtsError err;
        uint64_t random = seed;
        assert_int_equal(cts_volume_new(&v, N, 2, N, &err), CTS_OK);
        for (int i = 0; i < N * 2 * N; i++)
            v->grey[i] = scene_random(&random) % 4000 == 0 ? 2024 : 24;
        hold_to_bound(v, &bright, s, "specks");
        cts_volume_free(&v);
    }
}

/* Nothing visible, one voxel, one layer: empty pictures, no fault. */
static void degenerate(void **state)
{
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
                hold_to_bound(v, &preset, s, "few voxels");
                cts_volume_free(&v);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bytes),         cmocka_unit_test(constant_slab),   cmocka_unit_test(near_reference),
        cmocka_unit_test(thin_and_hard),      cmocka_unit_test(between_levels),  cmocka_unit_test(opaque_bump),
        cmocka_unit_test(narrow_stripes),     cmocka_unit_test(fine_levels),     cmocka_unit_test(steps_of_quantities),
        cmocka_unit_test(faint_shells),       cmocka_unit_test(hard_presets),    cmocka_unit_test(falls_as_asked),
        cmocka_unit_test(degenerate),         cmocka_unit_test(drafts_between),  cmocka_unit_test(drafts_work_on),
        cmocka_unit_test(drafts_miss_specks), cmocka_unit_test(step_near_level),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
