/* Openness: the field against a sum in double precision, the same bytes on every path, and every engine against the
 * reference ray caster with it. */
#include "base/cpu.h"
#include "core/model/voxel_labels.h"
#include "core/scene/openness.h"
#include "scenes.h"
#include <math.h>

/* As the header says it, block by block. */
static double openness_of(const CtsVolume *v, const CtsOpenness *o, const double *extinction, const int block[3])
{
    double sum = 0;
    for (int code = 0; code < 27; code++) {
        const int way[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
        double mm2 = 0;
        for (int c = 0; c < 3; c++) {
            double along = 0;
            for (int a = 0; a < 3; a++)
                along += way[a] * o->size[a] * v->step_lps[a][c];
            mm2 += along * along;
        }
        if (code == 13)
            continue;
        const int all = (int)fmax(floor(35 / sqrt(mm2) + 0.5), 1);
        double left = 1, mean = 1;
        for (int k = 1; k < all; k++) {
            const int at[3] = {block[0] + k * way[0], block[1] + k * way[1], block[2] + k * way[2]};
            bool inside = true;
            for (int a = 0; a < 3; a++)
                inside = inside && at[a] >= 0 && at[a] < o->n[a];
            if (inside)
                left *= exp(-sqrt(mm2) * extinction[(at[2] * o->n[1] + at[1]) * o->n[0] + at[0]]);
            mean += left;
        }
        sum += mean / all;
    }
    return sum / 26;
}

static double *mean_extinctions(const CtsVolume *v, const CtsPreset *preset, const CtsOpenness *o)
{
    const size_t n = (size_t)o->n[0] * (size_t)o->n[1] * (size_t)o->n[2];
    double *const sum = calloc(n, sizeof *sum);
    int *const count = calloc(n, sizeof *count);
    assert_non_null(sum);
    assert_non_null(count);
    for (int k = 0, at = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++)
            for (int i = 0; i < v->dims[0]; i++, at++) {
                const int block = (k / o->size[2] * o->n[1] + j / o->size[1]) * o->n[0] + i / o->size[0];
                sum[block] += cts_preset_extinction_per_mm(preset, cts_volume_hu(v, v->grey[at]));
                count[block]++;
            }
    for (size_t b = 0; b < n; b++)
        sum[b] /= count[b];
    free(count);
    return sum;
}

static void test_field_is_the_formula(void **state)
{
    static const struct {
        int dims[3];
        double mm[3], lean;
        size_t every; /* runs of 99 voxels begin after so many, and between them is air; 0: no air */
    } shapes[] = {{{45, 37, 29}, {1, 1, 1}, 0, 0},        {{40, 40, 12}, {0.8, 0.8, 3}, 0.4, 0},
                  {{9, 1, 30}, {5, 1, 0.7}, 0, 0},        {{1, 1, 1}, {1, 1, 1}, 0, 0},
                  {{20, 9, 4}, {40, 9, 70}, 0, 0},        {{150, 5, 3}, {1, 1, 1}, 0, 0},
                  {{30, 30, 30}, {0.1, 0.2, 2}, 0, 0},    {{1000, 7, 4}, {1, 1, 1}, 0, 1901},
                  {{60, 50, 40}, {1.5, 1, 2}, 0.2, 29989}};
    for (size_t s = 0; s < sizeof shapes / sizeof *shapes; s++)
        for (int p = 0; p < 2; p++) {
            const CtsPreset preset = preset_named(p ? "muscle" : "bone");
            const int *const d = shapes[s].dims;
            CtsVolume *v = random_volume(d[0], d[1], d[2], 5 + (uint32_t)s);
            CtsOpenness *o;
            CtsError err = {0};
            for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
                v->grey[i] =
                    shapes[s].every && i % shapes[s].every >= 99 ? 0 : (uint16_t)(v->grey[i] % (i % 7 ? 1050 : 1600));
            for (int a = 0; a < 3; a++)
                v->step_lps[a][a] = shapes[s].mm[a];
            v->step_lps[2][1] = shapes[s].lean * shapes[s].mm[2];
            CtsModel model = {.volume = v};
            assert_int_equal(p ? cts_model_prepare(&model, 1, &err) : CTS_OK, CTS_OK);
            assert_int_equal(cts_openness_new(&o, &model, &preset, 1, &err), CTS_OK);
            double *const extinction = mean_extinctions(v, &preset, o);
            for (int k = 0; k < o->n[2]; k++)
                for (int j = 0; j < o->n[1]; j++)
                    for (int i = 0; i < o->n[0]; i++) {
                        const int block[3] = {i, j, k};
                        const double expected = openness_of(v, o, extinction, block);
                        double vox[3];
                        for (int a = 0; a < 3; a++)
                            vox[a] = (block[a] - o->shift[a]) / o->scale[a];
                        const double found = cts_openness_at(o, vox);
                        /* Half a step of 8 bits, and as much for transmittances of 11 bits. */
                        if (!(fabs(found - expected) <= 1.0 / 255))
                            fail_msg("volume %zu, preset %s, block %d,%d,%d: openness %g, expected %g", s, preset.name,
                                     i, j, k, found, expected);
                    }
            free(extinction);
            cts_openness_free(&o);
            cts_model_free(&model);
        }
}

static void assert_same_field(const CtsOpenness *a, const CtsOpenness *b, const char *what)
{
    assert_memory_equal(a->n, b->n, sizeof a->n);
    if (memcmp(a->square, b->square, (size_t)a->n[0] * (size_t)a->n[1] * (size_t)a->n[2] * sizeof *a->square))
        fail_msg("%s: another field", what);
}

static void test_field_has_the_same_bytes(void **state)
{
    static const struct {
        const char *what;
        unsigned cpu;
        int n_threads;
    } ways[] = {{"plain C, 3 threads", 0, 3}, {"AVX2, 1 thread", CTS_CPU_AVX2, 1}, {"all paths, 2 threads", ~0u, 2}};
    const CtsPreset preset = preset_named("bone");
    CtsModel model = {.volume = phantom_head(90, 80, 70, 40)};
    CtsOpenness *first, *o;
    CtsError err = {0};
    cts_cpu_set_mask(0);
    assert_int_equal(cts_openness_new(&first, &model, &preset, 1, &err), CTS_OK);
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        cts_cpu_set_mask(ways[w].cpu);
        assert_int_equal(cts_openness_new(&o, &model, &preset, ways[w].n_threads, &err), CTS_OK);
        assert_same_field(first, o, ways[w].what);
        cts_openness_free(&o);
    }
    cts_cpu_set_mask(~0u);
    assert_int_equal(cts_model_prepare(&model, 1, &err), CTS_OK);
    assert_int_equal(cts_openness_new(&o, &model, &preset, 1, &err), CTS_OK);
    assert_same_field(first, o, "with macro-cells");
    cts_openness_free(&o);
    cts_openness_free(&first);
    cts_model_free(&model);
}

/* Hidden voxels are air. */
static void test_hidden_labels_let_light_through(void **state)
{
    const CtsPreset preset = preset_named("bone");
    CtsVolume *v = phantom_head(40, 40, 40, 20), *shown = phantom_head(40, 40, 40, 20);
    CtsOpenness *hidden, *cut;
    CtsError err = {0};
    for (size_t i = 0; i < cts_volume_n_voxels(shown) / 2; i++)
        shown->grey[i] = 0;
    CtsVoxelLabels voxel_labels = {.shown = {.volume = shown}};
    const CtsModel model = {.volume = v, .voxel_labels = &voxel_labels};
    assert_int_equal(cts_openness_new(&hidden, &model, &preset, 1, &err), CTS_OK);
    assert_int_equal(cts_openness_new(&cut, MODEL_OF(shown), &preset, 1, &err), CTS_OK);
    assert_same_field(hidden, cut, "half of the head hidden");
    cts_openness_free(&hidden);
    cts_openness_free(&cut);
    cts_volume_free(&v);
    cts_volume_free(&shown);
}

/* Error control keeps what was requested, and a picture of a reference's every pixel says whether it does. */
static void test_engines_agree(void **state)
{
    static const struct {
        CtsEngineId engine;
        const char *preset;
        double occlusion, azimuth_deg, elevation_deg, rmse_255;
    } scenes[] = {
        {CTS_ENGINE_TILED, "bone", 1, 30, 20, 0.5},       {CTS_ENGINE_TILED, "muscle", 0.6, -100, 5, 0.5},
        {CTS_ENGINE_TILED, "ct-lung", 0.8, 10, -40, 0.5}, {CTS_ENGINE_SHEETS, "skin", 1, 30, 20, 0.5},
        {CTS_ENGINE_SHEETS, "bone", 0.4, 95, 0, 0.5},     {CTS_ENGINE_SHEETS, "ct-lung", 0.9, 0, 80, 0.5},
        {CTS_ENGINE_COMBINED, "muscle", 1, 20, 10, 12},   {CTS_ENGINE_CLASSIC, "bone", 0.7, 80, 10, 16},
    };
    CtsVolume *v = phantom_head(56, 64, 48, 25);
    for (int a = 0; a < 3; a++)
        v->step_lps[a][a] = 2;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        const CtsPreset preset = preset_named(scenes[i].preset);
        CtsRenderSettings s = settings_for(scenes[i].engine, 40, scenes[i].azimuth_deg, scenes[i].elevation_deg);
        CtsReference *reference;
        CtsVerified found;
        CtsError err = {0};
        s.occlusion = scenes[i].occlusion;
        s.shade = CTS_ON;
        CtsPicture *p = render(v, &preset, &s, NULL);
        assert_int_equal(cts_reference_new(&reference, MODEL_OF(v), &preset, &s, 40 * 40, &err), CTS_OK);
        assert_int_equal(cts_reference_compare(reference, p, &found, &err), CTS_OK);
        if (!(255 * found.rmse <= scenes[i].rmse_255))
            fail_msg("engine %s, preset %s, occlusion %g: error of %.3g/255 rms, at most %g/255 expected",
                     cts_engine_names[scenes[i].engine], preset.name, s.occlusion, 255 * found.rmse,
                     scenes[i].rmse_255);
        cts_reference_free(&reference);
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
}

/* A renderer keeps the field when the occlusion changes; 0 is the picture without. */
static void test_occlusion_changes_from_picture_to_picture(void **state)
{
    static const double occlusions[] = {0.3, 0, 1, CTS_OCCLUSION_AS_PRESET, 0.6};
    CtsPreset preset = preset_named("bone"), without = preset;
    CtsVolume *v = phantom_head(48, 44, 40, 20);
    CtsRenderer *renderer;
    CtsError err = {0};
    preset.occlusion = 0.5;
    without.occlusion = 0;
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 32, 20, 10);
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &preset, &s, &err), CTS_OK);
    for (size_t i = 0; i < sizeof occlusions / sizeof *occlusions; i++) {
        CtsPicture *kept, *alone;
        s.occlusion = occlusions[i];
        assert_true(cts_render_change_settings(renderer, &s));
        assert_int_equal(cts_render_frame(renderer, 20, 10, &kept, NULL, &err), CTS_OK);
        alone = render(v, &preset, &s, NULL);
        assert_same_picture(kept, alone, "occlusion %g by a renderer, and alone", occlusions[i]);
        cts_picture_free(&alone);
        if (occlusions[i] == 0) {
            alone = render(v, &without, &s, NULL);
            assert_same_picture(kept, alone, "occlusion 0, and a preset without");
            cts_picture_free(&alone);
        }
        cts_picture_free(&kept);
    }
    s.occlusion = 1.5;
    assert_false(cts_render_change_settings(renderer, &s));
    cts_render_end(&renderer);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_field_is_the_formula),
        cmocka_unit_test(test_field_has_the_same_bytes),
        cmocka_unit_test(test_hidden_labels_let_light_through),
        cmocka_unit_test(test_engines_agree),
        cmocka_unit_test(test_occlusion_changes_from_picture_to_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
