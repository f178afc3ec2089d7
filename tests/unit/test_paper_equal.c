/* The paper's claim as a theorem: layer reuse and void skipping leave every byte of the picture as classic has it. */
#include "base/cpu.h"
#include "base/sanitized.h"
#include "scenes.h"

static const double views[][2] = {{0, 0}, {90, 0}, {0, 90}, {180, 0}, {-30, 20}, {45, 45}, {100, -35}, {90, 90}};
enum { N_VIEWS = sizeof views / sizeof views[0] };

/* Visible only between two levels, so that a mixture of invisible voxels shows. */
static CtsPreset shell_preset(void)
{
    CtsPreset p = preset_named("bone");
    const CtsOpacityPoint points[] = {{-400, 0}, {-390, 0.7}, {-200, 0.2}, {-190, 0}};
    p.n_opacity = 4;
    for (int i = 0; i < 4; i++)
        p.opacity[i] = points[i];
    return p;
}

typedef struct Case {
    const char *name;
    const CtsVolume *volume;
    CtsPreset preset;
    CtsRenderSettings settings;
} Case;

static void describe_case(const Case *c, const CtsRenderSettings *s, char text[200])
{
    snprintf(text, 200, "%s: %s, view %g,%g, kernel %s, %d samples, %d threads, cpu %x, preset %s%s", c->name,
             cts_engine_names[s->engine], s->azimuth_deg, s->elevation_deg, cts_kernel_names[s->kernel], s->samples,
             s->n_threads, cts_cpu_flags(), c->preset.name, s->shade == CTS_ON ? ", lit" : "");
}

static void fail_case(const Case *c, const CtsRenderSettings *s, const char *what)
{
    char text[200];
    describe_case(c, s, text);
    fail_msg("%s: %s", text, what);
}

static void expect_same(const Case *c, const CtsRenderSettings *s, const CtsPicture *expected)
{
    CtsReport report = {0};
    CtsPicture *p = render(c->volume, &c->preset, s, &report);
    const size_t n = (size_t)p->width * (size_t)p->height;
    char text[200];
    describe_case(c, s, text);
    assert_same_plane(expected->pixels, p->pixels, p->width, n * 4, 4, "colour, expected as by classic", text);
    if (expected->depth_mm)
        assert_same_plane(expected->depth_mm, p->depth_mm, p->width, n, 1, "depth, expected as by classic", text);
    const CtsVoxelCounts *v = &report.voxels;
    if (!v->known || v->total != cts_volume_n_voxels(c->volume) || v->void_voxels + v->reused + v->splatted != v->total)
        fail_case(c, s, "voxels do not add up");
    cts_report_free(&report);
    cts_picture_free(&p);
}

/* The four engines, with each number of threads and each kind of kernel; the picture must not be empty. */
static void check(const Case *c, const int *threads, int n_threads)
{
    CtsRenderSettings s = c->settings;
    s.engine = CTS_ENGINE_CLASSIC;
    s.n_threads = 1;
    cts_cpu_set_mask(0);
    CtsPicture *expected = render(c->volume, &c->preset, &s, NULL);
    for (int engine = CTS_ENGINE_CLASSIC; engine <= CTS_ENGINE_COMBINED; engine++)
        for (int t = 0; t < n_threads; t++)
            for (int mask = 0; mask < 2; mask++) {
                s.engine = (CtsEngineId)engine;
                s.n_threads = threads[t];
                s.no_occlusion_culling = mask;
                s.always_reuse_layers = (t + mask) % 2;
                cts_cpu_set_mask(mask ? ~0u : 0);
                expect_same(c, &s, expected);
            }
    cts_picture_free(&expected);
}

static void all_settings(const char *name, const CtsVolume *volume, int size)
{
    static const int threads[] = {1, 2, 7};
    const CtsPreset presets[] = {preset_named("bone"), preset_named("skin"), shell_preset()};
    for (int view = 0; view < N_VIEWS; view += CTS_SANITIZED ? 3 : 1)
        for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++) {
            /* Settings in turn, of coprime lengths, so that over all views and kernels each meets each. */
            const int turn = view * CTS_N_KERNELS + kernel;
            Case c = {.name = name, .volume = volume, .preset = presets[turn % 3]};
            c.settings = settings_for(CTS_ENGINE_CLASSIC, size, views[view][0], views[view][1]);
            c.settings.kernel = (CtsKernelId)kernel;
            c.settings.kernel_radius = turn % 4 == 0 ? 2.5 : 0;
            c.settings.shade = turn % 2 ? CTS_ON : CTS_OFF;
            c.settings.samples = turn % 7 < 3 ? 3 : 1;
            c.settings.want_depth = turn % 11 < 3;
            check(&c, threads + (turn / 3) % 3, 1);
        }
}

static void test_phantom(void **state)
{
    CtsVolume *v = phantom_head(41, 37, 30, 0);
    all_settings("phantom", v, 61);
    cts_volume_free(&v);
}

static void test_noisy_phantom(void **state)
{
    CtsVolume *v = phantom_head(35, 45, 26, 12);
    v->slice_layers = 6;
    all_settings("noisy phantom", v, 48);
    cts_volume_free(&v);
}

static void test_random(void **state)
{
    CtsVolume *v = random_volume(25, 18, 34, 11);
    all_settings("random", v, 52);
    cts_volume_free(&v);
}

/* Layers, rows and tiles of one voxel, and steps that are neither square nor at right angles. */
static void test_odd_shapes(void **state)
{
    static const int shapes[][3] = {{1, 20, 12}, {20, 1, 12}, {20, 12, 1}, {1, 1, 30},
                                    {2, 9, 17},  {8, 16, 3},  {1, 1, 1}};
    static const int threads[] = {1, 2};
    for (int i = 0; i < 7; i++) {
        CtsVolume *v = random_volume(shapes[i][0], shapes[i][1], shapes[i][2], 3);
        v->step_lps[0][0] = 0.4;
        v->step_lps[2][1] = 0.5;
        v->step_lps[2][2] = 3;
        for (int view = 0; view < N_VIEWS; view++) {
            Case c = {.name = "odd shape", .volume = v, .preset = preset_named("skin")};
            c.settings = settings_for(CTS_ENGINE_CLASSIC, 40, views[view][0], views[view][1]);
            c.settings.kernel = (CtsKernelId)(view % CTS_N_KERNELS);
            c.settings.samples = 1 + view % 2;
            check(&c, threads, 2);
        }
        cts_volume_free(&v);
    }
}

/* Enough rows for seven threads to process bands of them through all layers, in level and other views. */
static void test_many_bands(void **state)
{
    static const int threads[] = {1, 2, 7};
    static const double level[][2] = {{0, 0}, {90, 0}, {-90, 0}, {180, 0}, {30, 0}, {-75, 0}, {20, 10}};
    CtsVolume *volumes[] = {phantom_head(14, 40, 190, 6), random_volume(39, 12, 181, 4)};
    volumes[0]->slice_layers = 8;
    for (int i = 0; i < 2; i++)
        for (int view = 0; view < 7; view += CTS_SANITIZED ? 3 : 1) {
            Case c = {.name = i ? "many bands, random" : "many bands", .volume = volumes[i], .preset = shell_preset()};
            c.settings = settings_for(CTS_ENGINE_CLASSIC, 90, level[view][0], level[view][1]);
            c.settings.kernel = view % 2 ? CTS_KERNEL_BSPLINE : CTS_KERNEL_TENT;
            c.settings.mm_per_pixel = view % 2 == i ? 0.6 : 0; /* bands that the picture does not reach */
            c.settings.shade = view % 3 == 0 ? CTS_ON : CTS_OFF;
            c.settings.samples = view % 4 == 2 ? 2 : 1;
            c.settings.want_depth = view % 3 == 1;
            check(&c, threads, 3);
        }
    for (int i = 0; i < 2; i++)
        cts_volume_free(&volumes[i]);
}

/* Everything or nothing to see. */
static void test_extremes(void **state)
{
    static const int threads[] = {2};
    CtsVolume *v = phantom_head(20, 20, 20, 0);
    for (int i = 0; i < 2; i++) {
        Case c = {.name = i ? "all seen" : "nothing seen", .volume = v, .preset = preset_named("bone")};
        c.preset.n_opacity = 1;
        c.preset.opacity[0] = (CtsOpacityPoint){0, i ? 0.1 : 0};
        c.settings = settings_for(CTS_ENGINE_CLASSIC, 40, 30, 10);
        check(&c, threads, 1);
    }
    cts_volume_free(&v);
}

/* A tolerance changes the picture, but the same way with and without void skipping. */
static void test_tolerance(void **state)
{
    CtsVolume *v = phantom_head(40, 36, 44, 2);
    for (int view = 0; view < N_VIEWS; view++)
        for (int samples = 1; samples < 3; samples++) {
            Case c = {.name = "tolerance", .volume = v, .preset = preset_named("skin")};
            c.settings = settings_for(CTS_ENGINE_LAYERS, 64, views[view][0], views[view][1]);
            c.settings.tolerance_hu = 3;
            c.settings.samples = samples;
            CtsReport report = {0};
            CtsPicture *expected = render(v, &c.preset, &c.settings, &report);
            assert_true(report.voxels.reused > 0);
            for (int threads = 1; threads < 4; threads++) {
                c.settings.engine = CTS_ENGINE_COMBINED;
                c.settings.n_threads = threads;
                cts_cpu_set_mask(threads == 2 ? 0 : ~0u);
                expect_same(&c, &c.settings, expected);
            }
            cts_report_free(&report);
            cts_picture_free(&expected);
        }
    cts_volume_free(&v);
}

static void test_real_head(void **state)
{
    static const int threads[] = {2};
    CtsVolume *v = real_head();
    if (!v) {
        print_message("no real head: the Debian package invesalius-examples is not installed\n");
        skip();
    }
    for (int i = 0; i < 4; i++) {
        Case c = {.name = "real head", .volume = v, .preset = preset_named(i & 1 ? "skin" : "bone")};
        c.settings = settings_for(CTS_ENGINE_CLASSIC, 160, i < 2 ? 0 : -60, i < 2 ? 0 : 25);
        c.settings.kernel = i == 2 ? CTS_KERNEL_GAUSSIAN : CTS_KERNEL_TENT;
        check(&c, threads, 1);
    }
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_phantom),    cmocka_unit_test(test_noisy_phantom), cmocka_unit_test(test_random),
        cmocka_unit_test(test_odd_shapes), cmocka_unit_test(test_extremes),      cmocka_unit_test(test_tolerance),
        cmocka_unit_test(test_real_head),  cmocka_unit_test(test_many_bands),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
