/* Modes mip, minip and average: near the float64 reference, and the same bytes on every SIMD path. */
#include "base/cpu.h"
#include "base/sanitized.h"
#include "core/model/body_mask.h"
#include "views.h"

/* mip, minip and average against the reference, to half a grey level of 16 bits over the whole range of HU. */
static void modes_exact(void **state)
{
    CtsVolume *volumes[] = {random_volume(23, 19, 17, 5), phantom_head(40, 36, 30, 30), random_volume(1, 6, 9, 2),
                            random_volume(6, 1, 9, 3), random_volume(9, 6, 1, 4)};
    for (int i = 0; i < 5; i++) {
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

/* A body of random shares, with nodes further apart along one axis, that begins before the volume. */
static void give_body(CtsModel *model, int across, unsigned seed)
{
    int n[3], step[3], first[3];
    for (int a = 0; a < 3; a++) {
        step[a] = a == across ? 4 : 3;
        first[a] = 2 + a;
        n[a] = (model->volume->dims[a] - 1 + first[a] + step[a] - 1) / step[a] + 1;
    }
    assert_int_equal(cts_body_mask_new(&model->body, n, step, NULL), CTS_OK);
    memcpy(model->body->first, first, sizeof first);
    for (int at = 0; at < n[0] * n[1] * n[2]; at++) {
        seed = seed * 1664525 + 1013904223;
        /* Whole stretches with and without, and a ragged one between. */
        const int i = at % n[0];
        model->body->share[at] = i > 3 * n[0] / 5 ? 255 : i > n[0] / 4 ? (uint8_t)(seed >> 24) : 0;
    }
}

/* mip, minip and average by packets: the same bytes on every SIMD path, and equal to the reference. */
static void modes_by_packets(void **state)
{
    CtsPreset preset = preset_named("bone");
    for (int i = 0; i < 8; i++) {
        CtsModel model = {.volume = i % 4 == 0 ? random_volume(37, 19, 26, 5 + i) : phantom_head(70, 36, 30, 30 * i)};
        if (i % 4)
            give_body(&model, i % 4 - 1, (unsigned)i);
        /* Odd ones invert the window. */
        (i % 2 ? &preset.window_high_hu : &preset.window_low_hu)[0] = i < 4 ? -1024 : 100;
        (i % 2 ? &preset.window_low_hu : &preset.window_high_hu)[0] = i < 4 ? 64511 : 900;
        enum { STEP = CTS_SANITIZED ? 8 : 4 }; /* each view with some of the volumes */
        for (int view = i % STEP; view < N_VIEWS; view += STEP)
            for (int mode = CTS_MODE_MIP; mode < CTS_N_MODES; mode++) {
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 61, views[view][0], views[view][1]);
                s.mode = mode;
                s.mm_per_pixel = 0.7;
                s.slab_mm = i == 5 ? 9 : 0;
                CtsPicture *pictures[3];
                static const unsigned cpu[3] = {0, CTS_CPU_AVX2, ~0u};
                for (int run = 0; run < 3; run++) {
                    cts_cpu_set_mask(cpu[run]);
                    s.n_threads = 1 + run;
                    pictures[run] = render_model(&model, &preset, &s, NULL);
                    assert_same_picture(pictures[0], pictures[run], "volume %d, view %g,%g, mode %s, run %d", i,
                                        views[view][0], views[view][1], cts_mode_names[mode], run);
                }
                s.engine = CTS_ENGINE_RAYCAST;
                CtsPicture *reference = render_model(&model, &preset, &s, NULL);
                for (int at = 0; at < 4 * 61 * 61; at++)
                    assert_true(fabs(pictures[0]->pixels[at] - reference->pixels[at]) < 1e-5);
                cts_picture_free(&reference);
                for (int run = 0; run < 3; run++)
                    cts_picture_free(&pictures[run]);
            }
        cts_model_free(&model);
    }
}

/* A relative preset gives each engine's picture of the same preset in the volume's values; grey bits too, and an
 * inverted window is the picture's negative. */
static void scales(void **state)
{
    static const CtsEngineId engines[] = {CTS_ENGINE_TILED, CTS_ENGINE_SHEETS, CTS_ENGINE_RAYCAST, CTS_ENGINE_VOID};
    CtsVolume *v = phantom_head(28, 26, 20, 20);
    v->quantity = CTS_QUANTITY_STORED;
    v->modality = CTS_MODALITY_MR;
    v->air_value = -1024;
    v->bright_value = 976;
    const CtsPreset relative = preset_named("mr"), window = preset_named("mr-mip");
    CtsPreset stored = relative, inverted = window;
    assert_int_equal(cts_preset_resolve(&stored, v, NULL), CTS_OK);
    inverted.window_low_hu = window.window_high_hu;
    inverted.window_high_hu = window.window_low_hu;
    for (int i = 0; i < 4; i++) {
        CtsRenderSettings s = settings_for(engines[i], 33, 30, 20);
        s.grey_bits = i == 1 ? 8 : 16;
        CtsPicture *a = render(v, &relative, &s, NULL), *b = render(v, &stored, &s, NULL);
        assert_same_picture(a, b, "engine %s", cts_engine_names[engines[i]]);
        assert_true(a->info.shows_skin); /* as of any MR */
        cts_picture_free(&a);
        cts_picture_free(&b);
    }
    CtsRenderSettings by_key = settings_for(CTS_ENGINE_VOID, 33, 30, 20);
    by_key.void_key = 1;
    CtsReport report = {0};
    CtsPicture *keyed = render(v, &relative, &by_key, &report);
    assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_VOID_KEY_UNUSED));
    cts_picture_free(&keyed);
    cts_report_free(&report);
    for (int bits = 8; bits <= 16; bits += 8) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 33, 30, 20);
        s.grey_bits = bits;
        CtsPicture *a = render(v, &window, &s, NULL), *b = render(v, &inverted, &s, NULL);
        for (int at = 0; at < 4 * 33 * 33; at++)
            if (a->pixels[at | 3] > 0 && at % 4 < 3 && !(fabsf(a->pixels[at] + b->pixels[at] - 1) < 1e-5f))
                fail_msg("%d bits, value %d: %g and inverted %g", bits, at, (double)a->pixels[at],
                         (double)b->pixels[at]);
        cts_picture_free(&a);
        cts_picture_free(&b);
    }
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(modes_exact),
        cmocka_unit_test(modes_by_packets),
        cmocka_unit_test(scales),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
