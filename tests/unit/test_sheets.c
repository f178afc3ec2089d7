/* The engine sheets and the request auto: the same bytes on every path and in bands, close to the float64 reference at
 * each level, and the exact march where sheets cannot be relied on. */
#include "base/cpu.h"
#include "base/random.h"
#include "base/sanitized.h"
#include "scenes.h"

static const double views[][2] = {{0, 0},    {90, 0},  {180, 0},    {0, 90},      {0, -90},   {30, 20}, {44.9, 0},
                                  {45.1, 0}, {45, 35}, {-120, -50}, {1e-9, 1e-9}, {100, -20}, {-75, 10}};
enum { N_VIEWS = sizeof views / sizeof views[0] };

/* Plain C against AVX2 and AVX-512, one thread against many. Noise over all 65536 levels, volumes thinner than a
 * window, pixels far apart (no windows), near (many to a voxel), slabs of the volume, and each level. */
static void same_bytes(void **state)
{
    CtsVolume *volumes[] = {random_volume(33, 29, 21, 7), phantom_head(48, 44, 40, 20), random_volume(5, 2, 9, 3),
                            random_volume(9, 40, 3, 4)};
    static const char *const names[] = {"noise 33 x 29 x 21", "head 48 x 44 x 40", "noise 5 x 2 x 9",
                                        "noise 9 x 40 x 3"};
    for (int v = 0; v < 4; v++) {
        volumes[v]->slice_layers = 1 + v;
        for (int view = 0; view < N_VIEWS; view++)
            for (int variant = 0; variant < 8; variant++) {
                if ((view + variant + v) % (CTS_SANITIZED ? 24 : 4))
                    continue;
                CtsPreset preset = preset_named(variant & 1 ? "skin" : "bone");
                CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 61, views[view][0], views[view][1]);
                s.level = (variant + v) % 3 == 0
                              ? view % 2 ? CTS_LEVEL_AUTO : CTS_LEVEL_LATTICE /* auto: a coarse one */
                          : (variant + v) % 3 == 1 ? CTS_LEVEL_SHEETS
                                                   : CTS_LEVEL_HALF_SHEETS;
                s.shade = variant & 2 ? CTS_ON : CTS_OFF;
                s.want_depth = variant != 5;
                s.max_error = 100;            /* hardly a pixel is re-rendered */
                if ((variant + v) % 6 == 5) { /* here groups are marched */
                    s.level = CTS_LEVEL_HYBRID;
                    s.max_error = 0.5;
                }
                s.occlusion = view % 2 ? 0.7 : CTS_OCCLUSION_AS_PRESET;
                s.mm_per_pixel = variant == 3 ? 4 : variant == 4 ? 0.2 : 0;
                if (variant == 6)
                    preset.opacity[0].opacity = 0.01; /* air is visible: one-sided differences at the border */
                if (variant == 7)
                    s.slab_mm = 7.3;
                CtsPicture *reference = NULL;
                for (int run = 0; run < 4; run++) {
                    static const int threads[4] = {1, 7, 2, 1};
                    static const unsigned cpu[4] = {0, 0, CTS_CPU_AVX2, ~0u};
                    static const char *const runs[4] = {"plain C, 1 thread", "plain C, 7 threads", "AVX2, 2 threads",
                                                        "all SIMD paths, 1 thread"};
                    s.n_threads = threads[run];
                    cts_cpu_set_mask(cpu[run]);
                    CtsPicture *p = render(volumes[v], &preset, &s, NULL);
                    if (run > 0)
                        assert_same_picture(reference, p, "volume %s, view %g,%g, variant %d, %s", names[v],
                                            views[view][0], views[view][1], variant, runs[run]);
                    if (run > 0)
                        cts_picture_free(&p);
                    else
                        reference = p;
                }
                cts_picture_free(&reference);
            }
        cts_volume_free(&volumes[v]);
    }
    cts_cpu_set_mask(~0u);
}

/* Rms error of a level, of all pixels, against the ray caster. */
static double rms_255(const CtsVolume *v, const CtsPreset *preset, const CtsRenderSettings *settings)
{
    CtsRenderSettings truth = *settings;
    truth.engine = CTS_ENGINE_RAYCAST;
    truth.level = CTS_LEVEL_AUTO;
    CtsPicture *a = render(v, preset, settings, NULL), *b = render(v, preset, &truth, NULL);
    CtsDifference d;
    CtsError err = {0};
    assert_int_equal(cts_picture_compare(a, b, &d, &err), CTS_OK);
    cts_picture_free(&a);
    cts_picture_free(&b);
    return 255 * d.rmse;
}

/* Levels against the reference on a smooth head that the volume's faces cut (its box ends inside the head), from the
 * front, oblique and from the side. A sheet's error is of second order along the ray: half-sheets are well below it. */
static void levels_against_reference(void **state)
{
    CtsVolume *v = phantom_head(56, 52, 48, 0);
    CtsError err = {0};
    double low[3], high[3];
    cts_volume_box_lps(v, low, high);
    for (int a = 0; a < 3; a++) {
        const double third = (high[a] - low[a]) / 3;
        low[a] += third;
        high[a] -= a == 1 ? 0 : third / 4;
    }
    assert_int_equal(cts_volume_crop(v, low, high, NULL, &err), CTS_OK);
    const CtsPreset preset = preset_named("bone");
    static const double from[][2] = {{0, 0}, {30, 20}, {75, -15}, {-40, 70}};
    for (size_t i = 0; i < sizeof from / sizeof *from; i++)
        for (int lit = 0; lit < 2; lit++) {
            CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 96, from[i][0], from[i][1]);
            s.shade = lit ? CTS_ON : CTS_OFF;
            s.max_error = 100;
            s.level = CTS_LEVEL_SHEETS;
            const double sheets = rms_255(v, &preset, &s);
            s.level = CTS_LEVEL_HALF_SHEETS;
            const double half = rms_255(v, &preset, &s);
            s.level = CTS_LEVEL_LATTICE;
            s.max_error = 2; /* pixels beside a difference of 24 of 255 are marched */
            const double lattice = rms_255(v, &preset, &s);
            /* The largest errors of the prototype, bone at 45,35: 4.5 and 1.4 unlit. */
            const double most = 1.5;
            if (half > most || sheets > 3 * most || (!lit && half > 0.75 * sheets + 0.05) || lattice > sheets + 2)
                fail_msg("view %g,%g, lit %d: rms of sheets %.3f, of half-sheets %.3f, of a lattice %.3f", from[i][0],
                         from[i][1], lit, sheets, half, lattice);
        }
    cts_volume_free(&v);
}

/* Along an axis of the volume a sheet has errors of the levels' bins and of light alone, however opaque a slab is. */
static void straight_views(void **state)
{
    CtsVolume *v = phantom_head(56, 52, 48, 0);
    for (int i = 0; i < CTS_N_VIEWS; i++)
        for (int lit = 0; lit < 2; lit++) {
            const CtsPreset preset = preset_named(i % 2 ? "skin" : "bone");
            CtsRenderSettings s =
                settings_for(CTS_ENGINE_SHEETS, 96, cts_views[i].azimuth_deg, cts_views[i].elevation_deg);
            s.shade = lit ? CTS_ON : CTS_OFF;
            s.level = CTS_LEVEL_SHEETS;
            s.max_error = 2;
            const double sheets = rms_255(v, &preset, &s), most = lit ? 0.3 : 0.15;
            if (sheets > most)
                fail_msg("view %s, lit %d: rms of sheets %.3f, at most %.3f expected", cts_views[i].name, lit, sheets,
                         most);
        }
    cts_volume_free(&v);
}

/* A visible range as wide as all grey levels, and one of few levels above many: each level of the table has its place.
 */
/* Single voxels of about 70 pixels each, between the points of a lattice, coarse and not: what sheets see of them is
 * seen, but pixels at edges. */
static void specks_in_lattice(void **state)
{
    CtsVolume *v = random_volume(40, 36, 32, 5);
    const size_t n_voxels = (size_t)cts_volume_n_voxels(v);
    memset(v->grey, 0, n_voxels * sizeof *v->grey);
    for (uint64_t i = 0; i < 40; i++)
        v->grey[cts_random_bits(i) % n_voxels] = UINT16_MAX;
    /* Odd views show the middle of each, a third as wide and steep, in a haze. */
    CtsPreset presets[2] = {preset_named("bone"), preset_named("bone")};
    presets[1].n_opacity = 4;
    presets[1].opacity[0] = (CtsOpacityPoint){-1000, 0};
    presets[1].opacity[1] = (CtsOpacityPoint){0, 0.02};
    presets[1].opacity[2] = (CtsOpacityPoint){30000, 0.02};
    presets[1].opacity[3] = (CtsOpacityPoint){36000, 0.9};
    for (int view = 0; view < N_VIEWS; view++)
        for (int coarse = 0; coarse < 2; coarse++) {
            const CtsPreset *const preset = &presets[view % 2];
            CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 260, views[view][0], views[view][1]);
            s.mm_per_pixel = 0.2 * cts_volume_spacing_mm(v, 0);
            s.max_error = 100;
            s.level = CTS_LEVEL_SHEETS;
            CtsPicture *sheets = render(v, preset, &s, NULL);
            s.level = coarse ? CTS_LEVEL_AUTO : CTS_LEVEL_LATTICE;
            CtsPicture *lattice = render(v, preset, &s, NULL);
            int n = 0, n_lost = 0;
            for (size_t i = 3; i < 4 * (size_t)s.width * (size_t)s.height; i += 4) {
                n += sheets->pixels[i] > 0.5f;
                n_lost += sheets->pixels[i] > 0.5f && lattice->pixels[i] < 0.1f;
            }
            if (n < 100 || (view % 2 ? 10 : 100) * n_lost > n)
                fail_msg("view %g,%g, %s lattice: %d of %d pixels of specks are lost", views[view][0], views[view][1],
                         coarse ? "coarse" : "fine", n_lost, n);
            cts_picture_free(&sheets);
            cts_picture_free(&lattice);
        }
    cts_volume_free(&v);
}

static void widths_of_ranges(void **state)
{
    CtsVolume *v = phantom_head(56, 52, 48, 0);
    static const char *const presets[] = {"ct-mip", "ct-chest-contrast-enhanced", "ct-bone", "bone", "skin"};
    for (size_t i = 0; i < sizeof presets / sizeof *presets; i++) {
        const CtsPreset preset = preset_named(presets[i]);
        CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 96, 30, 20);
        s.level = CTS_LEVEL_HALF_SHEETS;
        s.shade = CTS_OFF;
        s.max_error = 100;
        const double rms = rms_255(v, &preset, &s);
        if (rms > 3)
            fail_msg("preset %s: rms %.3f of 255, 3 expected at most", presets[i], rms);
    }
    cts_volume_free(&v);
}

/* A homogeneous medium that fills the volume to its faces: opacity by the length of each ray in the box, in any view,
 * with slabs of the volume. Every pixel at the faces has its own part of a slab. */
static void homogeneous_box(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 19, 23, 17, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = 1524;
    v->step_lps[1][1] = 0.7;
    v->step_lps[2][0] = 0.3; /* leaning slices */
    CtsPreset preset = {.name = "haze", .unit_distance_mm = 1, .n_opacity = 1, .n_colour = 1};
    preset.opacity[0] = (CtsOpacityPoint){0, 0.07};
    preset.colour[0] = (CtsColourPoint){0, {1, 0.5, 0.25}};
    for (int view = 0; view < N_VIEWS; view++)
        for (int slab = 0; slab < 2; slab++) {
            CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 80, views[view][0], views[view][1]);
            s.level = CTS_LEVEL_HALF_SHEETS;
            s.max_error = 100;
            s.slab_mm = slab ? 6.1 : 0;
            const double rms = rms_255(v, &preset, &s);
            if (rms > 0.06) /* numbers of the table have 12 bits: a step of it is 0.06 of 255 */
                fail_msg("view %g,%g, slab %g mm: rms %.4f of 255, 0.06 expected at most", views[view][0],
                         views[view][1], s.slab_mm, rms);
        }
    cts_volume_free(&v);
}

/* A picture in bands is the picture as a whole, auto is the level that it chose, and a frame of a rotation the view
 * alone. */
typedef struct Rows {
    float *pixels;
    size_t n;
} Rows;

static CtsStatus take_rows(void *context, CtsPicture *band, CtsError *err)
{
    Rows *const rows = context;
    const size_t n = (size_t)band->width * (size_t)band->height * 4;
    memcpy(rows->pixels + rows->n, band->pixels, n * sizeof *band->pixels);
    rows->n += n;
    return CTS_OK;
}

static void bands_and_rotations(void **state)
{
    CtsVolume *v = phantom_head(48, 44, 40, 10);
    const CtsPreset bone = preset_named("bone");
    static const CtsEngineId engines[] = {CTS_ENGINE_AUTO, CTS_ENGINE_SHEETS, CTS_ENGINE_SHEETS, CTS_ENGINE_SHEETS};
    static const CtsEngineLevel levels[] = {CTS_LEVEL_AUTO, CTS_LEVEL_AUTO, CTS_LEVEL_LATTICE, CTS_LEVEL_HYBRID};
    for (size_t e = 0; e < 4; e++)
        for (int lit = 0; lit < 2; lit++) {
            CtsRenderSettings s = settings_for(engines[e], 150, 30, 20);
            s.level = levels[e];
            enlarge_to_two_strips(&s);
            s.max_error = levels[e] == CTS_LEVEL_HYBRID ? 0.2 : lit ? 8 : 2;
            s.shade = lit ? CTS_ON : CTS_OFF;
            CtsPicture *whole = render(v, &bone, &s, NULL);
            Rows rows = {calloc((size_t)s.width * (size_t)s.height * 4, sizeof(float)), 0};
            const CtsBandSink sink = {take_rows, &rows, .max_rows = 64};
            CtsRenderer *renderer = NULL;
            CtsError err = {0};
            s.rotation_frames = 2; /* whose memory is used again */
            assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_OK);
            for (int turn = 0; turn < 2; turn++) { /* first another side, then this one */
                rows.n = 0;
                assert_int_equal(cts_render_bands(renderer, turn ? 30 : 120, 20, &sink, NULL, &err), CTS_OK);
            }
            assert_same_plane(whole->pixels, rows.pixels, s.width, rows.n, 4, "colour", lit ? "bands, lit" : "bands");
            cts_render_end(&renderer);
            free(rows.pixels);
            if (engines[e] == CTS_ENGINE_AUTO && !strcmp(whole->info.engine, "auto"))
                fail_msg("a picture says that engine auto made it");
            cts_picture_free(&whole);
        }
    cts_volume_free(&v);
}

/* Level hybrid meets a request that half-sheets miss: noise, whose rays pass hundreds of faint voxels. It marches part
 * of the pixels, not all. */
static void hybrid_meets_request(void **state)
{
    CtsVolume *v = phantom_head(64, 60, 56, 60);
    const CtsPreset preset = preset_named("bone");
    for (int lit = 0; lit < 2; lit++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 160, 30, 20);
        s.shade = lit ? CTS_ON : CTS_OFF;
        s.level = CTS_LEVEL_HALF_SHEETS;
        s.max_error = 100;
        const double half = rms_255(v, &preset, &s);
        s.level = CTS_LEVEL_HYBRID;
        s.max_error = half / 3;
        const double hybrid = rms_255(v, &preset, &s);
        CtsReport report = {0};
        CtsPicture *p = render(v, &preset, &s, &report);
        long long marched = 0;
        if (report.voxels.total != cts_volume_n_voxels(v) || report.voxels.splatted == 0 ||
            report.voxels.splatted + report.voxels.void_voxels != report.voxels.total)
            fail_msg("%llu voxels, %llu splatted, %llu void", (unsigned long long)report.voxels.total,
                     (unsigned long long)report.voxels.splatted, (unsigned long long)report.voxels.void_voxels);
        const char *const line = strstr(report.plan, " pixels rendered by the exact march");
        for (const char *c = line; c && c > report.plan && c[-1] != '\n';)
            marched = strtoll(--c, NULL, 10);
        const long long all = (long long)p->width * p->height;
        if (half < 0.3 || hybrid > s.max_error || marched < all / 100 || marched > all * 3 / 4)
            fail_msg("lit %d: rms %.3f requested, %.3f found, at most %.3f reported; half-sheets %.3f; %lld of %lld "
                     "pixels marched",
                     lit, s.max_error, hybrid, 255 * report.bound.rmse, half, marched, all);
        cts_report_free(&report);
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
}

/* On a lit plane of metal that occlusion darkens the march errs alike everywhere, by 0.2 to 0.3 of 255 whatever is
 * asked, so that it cannot measure another engine's error. */
static void march_that_misses(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    const CtsPreset skin = preset_named("skin");
    CtsRenderSettings s = settings_for(CTS_ENGINE_AUTO, 160, 82.16, 27.14);
    assert_int_equal(cts_volume_new(&v, 23, 33, 30, &err), CTS_OK);
    v->step_lps[0][0] = v->step_lps[1][1] = 0.7;
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = (uint16_t)(i % 23 >= 17 ? 4024 : 1044 + cts_random_bits(i) % 41);
    s.max_error = 0.5;
    s.mm_per_pixel = 0.07;
    for (int lit = 0; lit < 2; lit++) {
        s.occlusion = lit ? CTS_OCCLUSION_AS_PRESET : 0;
        CtsPicture *p = render(v, &skin, &s, NULL);
        if (strcmp(p->info.engine, lit ? "tiled" : "sheets"))
            fail_msg("%s: engine %s expected, %s found", lit ? "occlusion" : "no occlusion", lit ? "tiled" : "sheets",
                     p->info.engine);
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
    (void)state;
}

/* The choice of auto: sheets for a smooth preset; the exact march, byte for byte, where opacity has a step, in other
 * modes, and where the requested error is too small for any level. */
static void choice_of_auto(void **state)
{
    CtsVolume *v = phantom_head(64, 60, 56, 0);
    const CtsPreset skin = preset_named("skin");
    CtsPreset step = preset_named("bone");
    step.n_opacity = 2;
    step.opacity[0] = (CtsOpacityPoint){180, 0};
    step.opacity[1] = (CtsOpacityPoint){180, 0.9};
    const struct {
        const char *what;
        const CtsPreset *preset;
        double max_error;
        int mode, size;
        double mm_per_pixel; /* voxels of 1, 1 and 1.5 mm; 0: the whole volume */
        const char *engine;
    } cases[] = {{"smooth", &skin, 8, CTS_MODE_COMPOSITE, 128, 0, "sheets"},
                 {"a step", &step, 8, CTS_MODE_COMPOSITE, 128, 0, "tiled"},
                 {"mip", &skin, 8, CTS_MODE_MIP, 128, 0, "tiled"},
                 {"0.1 asked", &skin, 0.1, CTS_MODE_COMPOSITE, 128, 0, "tiled"},
                 {"few pixels", &skin, 2, CTS_MODE_COMPOSITE, 99, 0, "tiled"},
                 {"preview of coarse pixels", &skin, 8, CTS_MODE_COMPOSITE, 128, 2.5, "tiled"},
                 {"coarse pixels", &skin, 2, CTS_MODE_COMPOSITE, 128, 2.5, "sheets"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_AUTO, cases[i].size, 20, 10);
        s.max_error = cases[i].max_error;
        s.mm_per_pixel = cases[i].mm_per_pixel;
        s.mode = cases[i].mode;
        s.shade = CTS_OFF;
        CtsPicture *p = render(v, cases[i].preset, &s, NULL);
        if (strcmp(p->info.engine, cases[i].engine))
            fail_msg("%s: engine %s expected, %s found", cases[i].what, cases[i].engine, p->info.engine);
        if (!strcmp(cases[i].engine, "tiled")) {
            s.engine = CTS_ENGINE_TILED;
            CtsPicture *march = render(v, cases[i].preset, &s, NULL);
            assert_same_plane(march->pixels, p->pixels, p->width, (size_t)p->width * (size_t)p->height * 4, 4, "colour",
                              cases[i].what);
            cts_picture_free(&march);
        }
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
}

/* Depth of a surface: within a slab of the exact march's, a half one or a whole one. */
static void depth_of_surfaces(void **state)
{
    CtsVolume *v = phantom_head(64, 60, 56, 0);
    const CtsPreset skin = preset_named("skin");
    static const double from[][2] = {{0, 0}, {35, 25}, {80, 5}};
    for (size_t i = 0; i < 3; i++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 80, from[i][0], from[i][1]), march = s;
        march.engine = CTS_ENGINE_TILED;
        s.level = i == 1 ? CTS_LEVEL_LATTICE : CTS_LEVEL_HALF_SHEETS;
        s.max_error = i == 1 ? 2 : 100;
        s.want_depth = march.want_depth = true;
        CtsPicture *a = render(v, &skin, &s, NULL), *b = render(v, &skin, &march, NULL);
        const float max_mm = (i == 1 ? 1 : 0.5f) * (float)cts_volume_spacing_mm(v, 1);
        int n = 0, n_off = 0;
        for (int at = 0; at < a->width * a->height; at++)
            if (b->pixels[4 * at + 3] > 0.9f) {
                n++;
                n_off += !(fabsf(a->depth_mm[at] - b->depth_mm[at]) <= max_mm);
            }
        if (n < 500 || n_off > n / 100)
            fail_msg("view %g,%g: depth of %d of %d opaque pixels is off by more than %g mm", from[i][0], from[i][1],
                     n_off, n, (double)max_mm);
        cts_picture_free(&a);
        cts_picture_free(&b);
    }
    cts_volume_free(&v);
}

/* Volumes of one voxel along an axis are refused with what to do; auto renders them. */
static void thin_volumes(void **state)
{
    CtsVolume *v = random_volume(9, 1, 8, 5);
    const CtsPreset bone = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, 16, 0, 0);
    CtsPicture *p = NULL;
    CtsError err = {0};
    assert_int_equal(cts_render(MODEL_OF(v), &bone, &s, &p, NULL, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "engine tiled"));
    assert_null(p);
    s.engine = CTS_ENGINE_AUTO;
    assert_int_equal(cts_render(MODEL_OF(v), &bone, &s, &p, NULL, &err), CTS_OK);
    cts_picture_free(&p);
    cts_volume_free(&v);
    v = random_volume(9, 7, 8, 5); /* and pixels of 1000 voxels */
    s.mm_per_pixel = 1000;
    assert_int_equal(cts_render(MODEL_OF(v), &bone, &s, &p, NULL, &err), CTS_OK);
    cts_picture_free(&p);
    s.engine = CTS_ENGINE_SHEETS;
    assert_int_equal(cts_render(MODEL_OF(v), &bone, &s, &p, NULL, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "too coarse"));
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_bytes),           cmocka_unit_test(levels_against_reference),
        cmocka_unit_test(homogeneous_box),      cmocka_unit_test(bands_and_rotations),
        cmocka_unit_test(hybrid_meets_request), cmocka_unit_test(choice_of_auto),
        cmocka_unit_test(march_that_misses),    cmocka_unit_test(depth_of_surfaces),
        cmocka_unit_test(thin_volumes),         cmocka_unit_test(widths_of_ranges),
        cmocka_unit_test(straight_views),       cmocka_unit_test(specks_in_lattice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
