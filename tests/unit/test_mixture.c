/* The mixture model against histograms of known mixtures, and the void key against its promised loss. */
#include "base/cpu.h"
#include "ctsplat/mixture.h"
#include "scenes.h"

enum { N_GREY = 65536 };

static uint64_t *new_counts(void)
{
    uint64_t *count = calloc(N_GREY, sizeof *count);
    assert_non_null(count);
    return count;
}

static void add_normal(uint64_t *count, double n, double mean_hu, double sd_hu)
{
    for (int g = 1; g < N_GREY; g++) {
        const double z = (g - 1024 - mean_hu) / sd_hu;
        if (fabs(z) < 8)
            count[g] += (uint64_t)floor(n * exp(-0.5 * z * z) / (sd_hu * sqrt(2 * M_PI)) + 0.5);
    }
}

/* Every share of two tissues of so much noise. */
static void add_mixed(uint64_t *count, double n, double low_hu, double high_hu, double sd_hu)
{
    for (int share = 0; share < 1000; share++)
        add_normal(count, n / 1000, low_hu + (high_hu - low_hu) * (share + 0.5) / 1000, sd_hu);
}

static CtsMixture fit_steps(const uint64_t *count, double hu_offset, double hu_step)
{
    CtsMixture m;
    CtsError err;
    assert_int_equal(cts_mixture_fit(count, hu_offset, hu_step, &m, &err), CTS_OK);
    return m;
}

static CtsMixture fit(const uint64_t *count)
{
    return fit_steps(count, -1024, 1);
}

static const CtsTissue *tissue(const CtsMixture *m, const char *name)
{
    for (int i = 0; i < m->n; i++)
        if (strcmp(m->tissue[i].name, name) == 0)
            return &m->tissue[i];
    fail_msg("no %s in the mixture", name);
    abort();
}

static bool has_tissue(const CtsMixture *m, const char *name)
{
    for (int i = 0; i < m->n; i++)
        if (strcmp(m->tissue[i].name, name) == 0)
            return true;
    return false;
}

static void near(const char *what, double found, double expected, double bound)
{
    if (!(fabs(found - expected) <= bound))
        fail_msg("%s: found %.9g, expected %.9g within %g", what, found, expected, bound);
}

static void expect_tissue(const CtsMixture *m, const char *name, double weight, double mean_hu, double sd_hu)
{
    const CtsTissue *t = tissue(m, name);
    near(name, t->weight, weight, 0.03);
    near(name, t->mean_hu, mean_hu, 0.15 * sd_hu);
    near(name, t->sd_hu, sd_hu, 0.15 * sd_hu);
}

/* Properties for any histogram. */
static void expect_sane(const CtsMixture *m, double hu_offset, double hu_step)
{
    static const bool none[CTS_MAX_TISSUES] = {false};
    bool all[CTS_MAX_TISSUES], first[CTS_MAX_TISSUES] = {true};
    double sum = 0;
    assert_in_range(m->n, 1, CTS_MAX_TISSUES);
    for (int i = 0; i < m->n; i++) {
        const CtsTissue *t = &m->tissue[i];
        assert_true(isfinite(t->mean_hu) && isfinite(t->sd_hu) && t->sd_hu >= 1 && t->sd_hu >= hu_step);
        assert_true(t->weight >= 0 && t->weight <= 1 && t->mixed_weight >= 0 && t->mixed_weight <= 1);
        assert_true(i == 0 || t->mean_hu > t[-1].mean_hu);
        sum += t->weight + t->mixed_weight;
    }
    assert_true(m->tissue[m->n - 1].mixed_weight == 0);
    near("sum of weights", sum, 1, 1e-12);
    for (int i = 0; i < CTS_MAX_TISSUES; i++)
        all[i] = true;
    for (int g = 0; g < N_GREY; g += 7) {
        const double hu = hu_offset + hu_step * g;
        near("all void", cts_mixture_void(m, all, hu), 1, 1e-12);
        near("none void", cts_mixture_void(m, none, hu), 0, 0);
        near("first void", cts_mixture_void(m, first, hu), 0.5, 0.5);
    }
    near("lowest", cts_mixture_void(m, all, -INFINITY), 1, 1e-12);
    near("highest", cts_mixture_void(m, all, INFINITY), 1, 1e-12);
}

static void test_head(void **state)
{
    uint64_t *count = new_counts();
    add_normal(count, 500e3, -998, 12);
    add_normal(count, 60e3, -95, 18);
    add_normal(count, 300e3, 45, 14);
    add_normal(count, 100e3, 1050, 180);
    add_mixed(count, 40e3, -95, 45, 14);
    const CtsMixture m = fit(count);
    expect_sane(&m, -1024, 1);
    assert_true(m.converged);
    expect_tissue(&m, "air", 0.5, -998, 12);
    expect_tissue(&m, "fat", 0.06, -95, 18);
    expect_tissue(&m, "soft", 0.3, 45, 14);
    expect_tissue(&m, "compact bone", 0.1, 1050, 180);
    near("fat and soft", tissue(&m, "fat")->mixed_weight, 0.04, 0.015);
    assert_false(has_tissue(&m, "lung") || has_tissue(&m, "enamel or metal"));
    free(count);
}

/* A chest has lungs; where skin meets air there are none, though the HU are the same. */
static void test_lung(void **state)
{
    uint64_t *count = new_counts();
    add_normal(count, 300e3, -1000, 15);
    add_normal(count, 300e3, -840, 60);
    add_normal(count, 400e3, 40, 20);
    CtsMixture m = fit(count);
    expect_sane(&m, -1024, 1);
    /* Values between air and lung may belong to either, or both. */
    near("air", tissue(&m, "air")->mean_hu, -1000, 3);
    near("lung", tissue(&m, "lung")->mean_hu, -840, 15);
    near("lung", tissue(&m, "lung")->weight, 0.3, 0.06);
    expect_tissue(&m, "soft", 0.4, 40, 20);
    memset(count, 0, N_GREY * sizeof *count);
    add_normal(count, 500e3, -1000, 15);
    add_normal(count, 400e3, 40, 20);
    add_mixed(count, 100e3, -1000, 40, 15);
    m = fit(count);
    expect_tissue(&m, "air", 0.5, -1000, 15);
    expect_tissue(&m, "soft", 0.4, 40, 20);
    assert_false(has_tissue(&m, "lung"));
    free(count);
}

static void test_noise(void **state)
{
    uint64_t *count = new_counts();
    add_normal(count, 500e3, 30, 70);
    add_normal(count, 500e3, 900, 150);
    const CtsMixture m = fit(count);
    expect_tissue(&m, "soft", 0.5, 30, 70);
    expect_tissue(&m, "compact bone", 0.5, 900, 150);
    free(count);
}

/* Grey 0 is clipped air, with an unknown mean. */
static void test_clipped_air(void **state)
{
    uint64_t *count = new_counts();
    CtsError err;
    CtsMixture m;
    assert_int_equal(cts_mixture_fit(count, -1024, 1, &m, &err), CTS_ERR_USAGE);
    count[0] = 700e3;
    m = fit(count);
    expect_sane(&m, -1024, 1);
    assert_int_equal(m.n, 1);
    near("air", m.tissue[0].weight, 1, 0);
    add_normal(count, 300e3, 50, 12);
    m = fit(count);
    near("air", tissue(&m, "air")->weight, 0.7, 0.001);
    near("air", tissue(&m, "air")->mean_hu, -1000, 1);
    expect_tissue(&m, "soft", 0.3, 50, 12);
    free(count);
}

static void test_degenerate(void **state)
{
    uint64_t *count = new_counts();
    static const int levels[] = {1, 600, 1064, 1554, 4095, 65535};
    static const uint64_t voxels[] = {1, UINT64_C(1) << 40};
    for (int v = 0; v < 2; v++)
        for (size_t i = 0; i < sizeof levels / sizeof *levels; i++) {
            count[levels[i]] = voxels[v];
            CtsMixture m = fit(count);
            expect_sane(&m, -1024, 1);
            assert_int_equal(m.n_levels, 1);
            /* Two spikes, the other one at every other level. */
            for (size_t j = 0; j < i; j++) {
                count[levels[j]] = 1000;
                m = fit(count);
                expect_sane(&m, -1024, 1);
                count[levels[j]] = 0;
            }
            count[levels[i]] = 0;
        }
    for (int g = 0; g < N_GREY; g++)
        count[g] = 1;
    CtsMixture m = fit(count);
    expect_sane(&m, -1024, 1);
    m = fit_steps(count, -1024, 1.0 / 16);
    expect_sane(&m, -1024, 1.0 / 16);
    m = fit_steps(count, -1350, 8);
    expect_sane(&m, -1350, 8);
    free(count);
}

/* Blood with contrast agent adds to what is as dense as spongy bone. */
static void test_contrast(void **state)
{
    for (int contrast = 0; contrast < 2; contrast++) {
        uint64_t *count = new_counts();
        add_normal(count, 4e5, -1000, 15);
        add_normal(count, 2e5, 40, 20);
        add_normal(count, 6e3, 320, 80);
        add_normal(count, 4e3, 900, 250);
        add_normal(count, contrast ? 4e4 : 0, 300, 40);
        const CtsMixture m = fit(count);
        assert_int_equal(cts_mixture_has_contrast(&m), contrast);
        free(count);
    }
    const CtsMixture none = {0};
    assert_false(cts_mixture_has_contrast(&none));
}

/* A pin of a few voxels, and metal that the scanner clips at its largest value. */
static void test_metal(void **state)
{
    uint64_t *count = new_counts();
    add_normal(count, 700e3, -1000, 12);
    add_normal(count, 300e3, 40, 15);
    count[1024 + 3071] = 300;
    CtsMixture m = fit(count);
    expect_sane(&m, -1024, 1);
    near("metal", tissue(&m, "enamel or metal")->weight, 0.0003, 0.00005);
    near("metal", tissue(&m, "enamel or metal")->mean_hu, 3071, 10);
    count[1024 + 3071] = 0;
    count[65535] = 300;
    m = fit(count);
    expect_sane(&m, -1024, 1);
    near("metal", tissue(&m, "enamel or metal")->mean_hu, 64511, 2500);
    free(count);
}

static void test_histogram(void **state)
{
    static const int threads[] = {1, 2, 7, 200};
    CtsVolume *v = random_volume(31, 17, 5, 3);
    uint64_t *expected = new_counts(), *count;
    CtsError err;
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        expected[v->grey[i]]++;
    for (int t = 0; t < 4; t++) {
        assert_int_equal(cts_volume_histogram(v, threads[t], &count, &err), CTS_OK);
        assert_memory_equal(count, expected, N_GREY * sizeof *count);
        cts_volume_histogram_free(&count);
    }
    cts_volume_free(&v);
    free(expected);
}

static CtsVoidKey propose(const CtsMixture *m, const CtsPreset *preset, const uint64_t *count)
{
    CtsVoidKey key;
    CtsError err;
    assert_int_equal(cts_void_key_propose(m, preset, count, -1024, 1, &key, &err), CTS_OK);
    return key;
}

/* Soft tissue so noisy that its tail reaches into the preset's visible range, and bone. */
static void add_noisy_head(uint64_t *count)
{
    count[0] = 100e3;
    add_normal(count, 400e3, -998, 12);
    add_normal(count, 400e3, 40, 60);
    add_normal(count, 100e3, 1000, 150);
}

static void test_key(void **state)
{
    uint64_t *count = new_counts();
    add_noisy_head(count);
    const CtsMixture m = fit(count);
    const CtsPreset bone = preset_named("bone");
    const CtsVoidKey key = propose(&m, &bone, count);
    assert_true(key.useful && key.n_ranges == 1);
    assert_true(key.range[0].from_hu == -INFINITY);
    /* The key excludes three deviations of soft tissue and more, and the noise that the preset would show. */
    assert_true(key.range[0].below_hu > 200 && key.range[0].below_hu < 550);
    assert_true(cts_void_key_drops(&key, -5000) && cts_void_key_drops(&key, nextafter(key.range[0].below_hu, 0)));
    assert_false(cts_void_key_drops(&key, key.range[0].below_hu) || cts_void_key_drops(&key, 1e6));
    /* The reported loss, and the promised limit for bone. */
    uint64_t total = 0, visible = 0, dropped = 0;
    double opacity = 0, opacity_dropped = 0, loss = 0;
    for (int g = 0; g < N_GREY; g++) {
        const double hu = g - 1024, shown = cts_preset_opacity(&bone, hu) * (double)count[g];
        const double p = cts_mixture_void(&m, key.is_void, hu);
        assert_true((p >= key.probability) == cts_void_key_drops(&key, hu));
        total += count[g];
        opacity += shown;
        if (shown > 0)
            visible += count[g];
        if (shown > 0 && cts_void_key_drops(&key, hu)) {
            dropped += count[g];
            opacity_dropped += shown;
            loss += shown * (1 - p);
        }
    }
    assert_true(key.total == total && key.visible == visible && key.dropped == dropped);
    assert_true(dropped > 10000);
    near("opacity dropped", key.opacity_dropped, opacity_dropped / opacity, 1e-12);
    assert_true(loss <= 1e-3 * opacity);
    char text[CTS_KEY_TEXT];
    cts_void_key_text(&key, text);
    assert_true(strncmp(text, "below ", 6) == 0);
    free(count);
}

/* A band between two void tissues; and presets that show all tissues or none. */
static void test_key_forms(void **state)
{
    uint64_t *count = new_counts();
    char text[CTS_KEY_TEXT];
    add_normal(count, 300e3, -1000, 12);
    add_normal(count, 200e3, -100, 15);
    add_normal(count, 500e3, 50, 15);
    const CtsMixture m = fit(count);
    const CtsPreset fat = preset_named("ct-fat");
    CtsVoidKey key = propose(&m, &fat, count);
    assert_true(key.useful && key.n_ranges == 2);
    assert_true(isinf(key.range[0].from_hu) && isinf(key.range[1].below_hu));
    assert_true(key.range[0].below_hu > -900 && key.range[0].below_hu <= -120);
    assert_true(key.range[1].from_hu > -60 && key.range[1].from_hu < 30);
    cts_void_key_text(&key, text);
    assert_non_null(strstr(text, " HU on"));
    CtsPreset even = preset_named("bone");
    even.n_opacity = 1;
    for (int shown = 0; shown < 2; shown++) {
        even.opacity[0] = (CtsOpacityPoint){0, shown ? 0.1 : 0};
        key = propose(&m, &even, count);
        assert_false(key.useful);
        assert_int_equal(key.n_ranges, 0);
        assert_int_equal(key.dropped, 0);
        assert_false(cts_void_key_drops(&key, -1000) || cts_void_key_drops(&key, 3000));
    }
    cts_void_key_text(&key, text);
    assert_string_equal(text, "no HU");
    free(count);
}

/* The same preset with nothing below this HU. */
static CtsPreset cut_below(const CtsPreset *preset, double hu)
{
    CtsPreset cut = *preset;
    cut.n_opacity = 0;
    cut.opacity[cut.n_opacity++] = (CtsOpacityPoint){hu, 0};
    cut.opacity[cut.n_opacity++] = (CtsOpacityPoint){hu, cts_preset_opacity(preset, hu)};
    for (int i = 0; i < preset->n_opacity; i++)
        if (preset->opacity[i].hu > hu)
            cut.opacity[cut.n_opacity++] = preset->opacity[i];
    return cut;
}

/* A head whose soft tissue is noisy, nearly normally so. */
static CtsVolume *noisy_head(int nx, int ny, int nz)
{
    CtsVolume *v = phantom_head(nx, ny, nz, 0);
    uint64_t state = 8;
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++) {
        int noise = 0;
        for (int n = 0; n < 6; n++)
            noise += (int)(scene_random(&state) % 161) - 80;
        if (v->grey[i] > 300)
            v->grey[i] = (uint16_t)(v->grey[i] + noise / 2);
    }
    return v;
}

/* The key's picture is the exact one of the preset without the dropped levels, for each engine with the key and any
 * number of threads; the others leave the picture unchanged, and say so. */
static void test_picture(void **state)
{
    CtsVolume *v = noisy_head(44, 40, 36);
    CtsPreset bone = preset_named("bone");
    const size_t n_bytes = 64 * 64 * 4 * sizeof(float);
    CtsRenderSettings s = settings_for(CTS_ENGINE_VOID, 64, 20, 10);
    bone.occlusion = 0; /* openness is that of the whole preset */
    uint64_t *count;
    CtsError err;
    assert_int_equal(cts_volume_histogram(v, 1, &count, &err), CTS_OK);
    const CtsMixture m = fit(count);
    const CtsVoidKey key = propose(&m, &bone, count);
    assert_true(key.n_ranges == 1 && key.dropped > 0);
    const CtsPreset cut = cut_below(&bone, key.range[0].below_hu);
    s.engine = CTS_ENGINE_CLASSIC;
    CtsPicture *expected = render(v, &cut, &s, NULL), *strict = render(v, &bone, &s, NULL);
    assert_memory_not_equal(expected->pixels, strict->pixels, n_bytes);
    uint64_t splatted[2];
    for (int use_key = 0; use_key < 2; use_key++) {
        CtsReport report = {0};
        s.engine = CTS_ENGINE_VOID;
        s.void_key = use_key;
        CtsPicture *p = render(v, &bone, &s, &report);
        splatted[use_key] = report.voxels.splatted;
        assert_true(report.key_loss == (use_key ? key.opacity_dropped : 0));
        cts_report_free(&report);
        cts_picture_free(&p);
    }
    assert_true(splatted[1] < splatted[0]);
    for (int engine = 0; engine <= CTS_ENGINE_COMBINED; engine++)
        for (int threads = 1; threads < 8; threads += 3) {
            CtsReport report = {0};
            const bool takes = engine == CTS_ENGINE_VOID || engine == CTS_ENGINE_COMBINED;
            s.engine = (CtsEngineId)engine;
            s.n_threads = threads;
            cts_cpu_set_mask(threads > 1 ? ~0u : 0);
            CtsPicture *p = render(v, &bone, &s, &report);
            assert_memory_equal(p->pixels, (takes ? expected : strict)->pixels, n_bytes);
            assert_int_equal(report.diagnostics.n, 1);
            assert_int_equal(report.diagnostics.items[0].severity, CTS_WARNING);
            assert_string_equal(report.diagnostics.items[0].code, takes ? "void_key" : "void_key_unused");
            cts_report_free(&report);
            cts_picture_free(&p);
        }
    cts_picture_free(&expected);
    cts_picture_free(&strict);
    cts_volume_histogram_free(&count);
    cts_volume_free(&v);
}

/* Frames share the key; it is reported once. */
static void test_frames(void **state)
{
    CtsVolume *v = noisy_head(24, 24, 20);
    const CtsPreset bone = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_VOID, 32, 0, 0);
    s.void_key = s.opacity_per_voxel = true;
    CtsReport report = {0};
    CtsRenderer *renderer;
    CtsError err;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_OK);
    for (int frame = 0; frame < 3; frame++) {
        CtsPicture *p;
        s.azimuth_deg = 40.0 * frame;
        assert_int_equal(cts_render_frame(renderer, s.azimuth_deg, 0, &p, &report, &err), CTS_OK);
        CtsPicture *alone = render(v, &bone, &s, NULL);
        assert_memory_equal(p->pixels, alone->pixels, 32 * 32 * 4 * sizeof(float));
        cts_picture_free(&alone);
        cts_picture_free(&p);
    }
    assert_int_equal(report.diagnostics.n, 1);
    cts_render_end(&renderer);
    cts_report_free(&report);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_head),        cmocka_unit_test(test_lung),       cmocka_unit_test(test_noise),
        cmocka_unit_test(test_clipped_air), cmocka_unit_test(test_degenerate), cmocka_unit_test(test_metal),
        cmocka_unit_test(test_contrast),    cmocka_unit_test(test_histogram),  cmocka_unit_test(test_key),
        cmocka_unit_test(test_key_forms),   cmocka_unit_test(test_picture),    cmocka_unit_test(test_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
