/* Every row of the tables of kernels, engines, formats and settings has all that the rest of the program needs: an
 * incomplete new row fails here. */
#include "ctsplat/bounds.h"
#include "pictures.h"
#include "scenes.h"

/* Hardly opaque, the more the denser: a picture of it is nearly the sum of its voxels' footprints. */
static CtsPreset make_thin(void)
{
    CtsPreset p = *cts_preset_builtin(0);
    p.n_opacity = p.n_colour = 2;
    p.opacity[0] = (CtsOpacityPoint){-1024, 0};
    p.opacity[1] = (CtsOpacityPoint){3000, 0.3};
    p.colour[0] = (CtsColourPoint){-1024, {1, 1, 1}};
    p.colour[1] = (CtsColourPoint){3000, {1, 1, 1}};
    return p;
}

static CtsVolume *make_dots(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 17, 17, 17, &err), CTS_OK);
    for (int k = 4; k < 17; k += 8)
        for (int j = 4; j < 17; j += 8)
            for (int i = 4; i < 17; i += 8)
                v->grey[(k * 17 + j) * 17 + i] = 4000;
    return v;
}

static CtsPicture *picture_of(const CtsVolume *volume, CtsEngineId engine, CtsKernelId kernel, int samples)
{
    const CtsPreset preset = make_thin();
    CtsRenderSettings s;
    CtsPicture *picture = NULL;
    CtsError err = {0};
    cts_render_defaults(&s);
    s.width = s.height = 40;
    s.mm_per_pixel = 0.3; /* so fine that lattices are as fine as they can be */
    s.azimuth_deg = 0;
    s.engine = engine;
    s.kernel = kernel;
    s.samples = samples;
    s.shade = CTS_OFF;
    if (cts_render(MODEL_OF(volume), &preset, &s, &picture, NULL, &err))
        fail_msg("engine %s, kernel %s: %s", cts_engine_names[engine], cts_kernel_names[kernel], err.text);
    return picture;
}

/* Footprints and the ray caster's kernels are independent implementations that validate each other: a picture splatted
 * with a kernel is nearer to the ray cast of that kernel than to that of any other. */
static void test_kernels(void **state)
{
    CtsVolume *volume = make_dots();
    CtsPicture *cast[CTS_N_KERNELS];
    for (int k = 0; k < CTS_N_KERNELS; k++)
        cast[k] = picture_of(volume, CTS_ENGINE_RAYCAST, (CtsKernelId)k, 0);
    for (int k = 0; k < CTS_N_KERNELS; k++) {
        CtsDifference own, other;
        CtsError err;
        assert_true(cts_kernel_names[k] && *cts_kernel_names[k]);
        CtsPicture *splatted = picture_of(volume, CTS_ENGINE_CLASSIC, (CtsKernelId)k, 32);
        assert_int_equal(cts_picture_compare(splatted, cast[k], &own, &err), CTS_OK);
        for (int j = 0; j < CTS_N_KERNELS; j++) {
            assert_int_equal(cts_picture_compare(splatted, cast[j], &other, &err), CTS_OK);
            if (j != k && !(own.rmse < other.rmse))
                fail_msg("kernel %s: %g rms from its own ray cast, %g from that of %s", cts_kernel_names[k], own.rmse,
                         other.rmse, cts_kernel_names[j]);
        }
        cts_picture_free(&splatted);
    }
    for (int k = 0; k < CTS_N_KERNELS; k++)
        cts_picture_free(&cast[k]);
    cts_volume_free(&volume);
}

static void test_engines(void **state)
{
    CtsVolume *volume = phantom_head(16, 17, 15, 20);
    CtsPicture *truth = picture_of(volume, CTS_ENGINE_RAYCAST, CTS_KERNEL_TENT, 0);
    for (int e = 0; e < CTS_N_ENGINES; e++) {
        CtsDifference d;
        CtsError err;
        assert_true(cts_engine_names[e] && *cts_engine_names[e]);
        CtsPicture *p = picture_of(volume, (CtsEngineId)e, CTS_KERNEL_TENT, e == CTS_ENGINE_TILED ? 0 : 32);
        assert_string_equal(p->info.engine, cts_engine_names[e]);
        assert_int_equal(cts_picture_compare(p, truth, &d, &err), CTS_OK);
        if (!(d.rmse < 0.01))
            fail_msg("engine %s: off by %g rms", cts_engine_names[e], d.rmse);
        cts_picture_free(&p);
    }
    cts_picture_free(&truth);
    cts_volume_free(&volume);
}

/* The round trip of each format keeps the size and nearly the brightness. */
static void check_format(const CtsFormatInfo *format, const char *folder, const CtsSeries *source)
{
    char path[200];
    CtsError err = {0};
    CtsPicture *p = make_picture(20, 12, 4, false), *q = NULL;
    CtsDifference d;
    const CtsExportSettings settings = {.source = source, .n_threads = 1};
    const int n_frames = format->many_frames ? 2 : 1;
    const CtsPicture *const frames[] = {p, p};
    assert_true(format->name && *format->name && format->about && *format->about);
    snprintf(path, sizeof path, "%s/a.%s", folder, format->name);
    assert_ptr_equal(cts_export_format(path), format);
    assert_int_equal(cts_export_check(path, &settings, &err), CTS_OK);
    assert_int_equal(cts_export_check_size(path, 20, 12, 2, false, &settings, &err),
                     format->many_frames ? CTS_OK : CTS_ERR_USAGE);
    if (cts_export(frames, n_frames, path, &settings, NULL, NULL, &err))
        fail_msg("%s", err.text);
    assert_int_equal(cts_picture_read(path, &q, &err), format->read_back ? CTS_OK : CTS_ERR_READ);
    if (q) {
        assert_int_equal(cts_picture_compare(p, q, &d, &err), CTS_OK);
        if (!(d.max < 0.004))
            fail_msg("%s: comes back %g off", format->name, d.max);
        assert_false(q->depth_mm && !format->has_depth);
    }
    cts_picture_free(&p);
    cts_picture_free(&q);
    unlink(path);
}

static void check_alpha(const CtsFormatInfo *format, const char *folder, const CtsSeries *source)
{
    char path[200];
    CtsError err = {0};
    CtsPicture *p = make_picture(20, 12, 4, true), *q = NULL;
    const CtsExportSettings settings = {.source = source, .n_threads = 1};
    snprintf(path, sizeof path, "%s/a.%s", folder, format->name);
    if (cts_export(&(const CtsPicture *){p}, 1, path, &settings, NULL, NULL, &err))
        fail_msg("%s", err.text);
    if (format->read_back) {
        assert_int_equal(cts_picture_read(path, &q, &err), CTS_OK);
        assert_true(q->has_alpha == format->has_alpha);
    }
    cts_picture_free(&p);
    cts_picture_free(&q);
    unlink(path);
}

static void test_formats(void **state)
{
    char folder[64], file[500];
    const char *root = getenv("CTS_TESTDATA"), *path = file;
    CtsSeriesList *list = NULL;
    const CtsSeries *source;
    CtsError err = {0};
    assert_non_null(root);
    snprintf(file, sizeof file, "%s/phantom/IM0021.dcm", root);
    make_folder(folder);
    if (cts_series_find(&path, 1, 1, &list, NULL, &err) || cts_series_choose(list, NULL, &source, &err))
        fail_msg("%s", err.text);
    size_t n = 0;
    for (const CtsFormatInfo *format; (format = cts_format(n)); n++) {
        const bool is_film = !strcmp(format->name, "mp4") || !strcmp(format->name, "gif");
        if (is_film && system("command -v ffmpeg >/dev/null"))
            continue;
        check_format(format, folder, source);
        check_alpha(format, folder, source);
        for (size_t other = 0; other < n; other++)
            assert_string_not_equal(cts_format(other)->name, format->name);
    }
    assert_true(n >= 3);
    cts_series_list_free(&list);
    remove_folder(folder);
}

static void test_settings(void **state)
{
    for (int i = 1; i < CTS_N_SETTINGS; i++) {
        const CtsBounds *b = cts_setting_bounds((CtsSetting)i);
        CtsError err = {0};
        assert_true(b && b->name && b->unit && b->low < b->high);
        assert_int_equal(cts_setting_check((CtsSetting)i, b->low, &err), CTS_OK);
        assert_int_equal(cts_setting_check((CtsSetting)i, b->high, &err), CTS_OK);
        assert_int_equal(cts_setting_check((CtsSetting)i, 2 * b->high, &err), CTS_ERR_USAGE);
        assert_non_null(strstr(err.text, b->name));
        assert_int_equal(cts_setting_check((CtsSetting)i, NAN, &err), CTS_ERR_USAGE);
        assert_int_equal(cts_setting_check((CtsSetting)i, b->low - 0.5, &err), CTS_ERR_USAGE);
        if (b->whole)
            assert_int_equal(cts_setting_check((CtsSetting)i, b->low + 0.5, &err), CTS_ERR_USAGE);
        if (b->automatic)
            assert_int_equal(cts_setting_check((CtsSetting)i, 0, &err), CTS_OK);
    }
    assert_null(cts_setting_bounds((CtsSetting)0));
    assert_null(cts_setting_bounds(CTS_N_SETTINGS));
}

/* Every engine with the kernel accepts the radii within the bounds, and none a radius beyond. */
static void test_radius(void **state)
{
    const CtsBounds *b = cts_setting_bounds(CTS_SETTING_KERNEL_RADIUS);
    const double radii[] = {b->low - 0.01, b->low, b->high, b->high + 0.01};
    CtsVolume *volume = phantom_head(9, 9, 9, 20);
    for (int engine = 0; engine < 2; engine++)
        for (int k = 0; k < CTS_N_KERNELS; k++)
            for (int r = 0; r < 4; r++) {
                CtsRenderSettings s;
                CtsPicture *p = NULL;
                CtsError err;
                cts_render_defaults(&s);
                s.width = s.height = 4;
                s.engine = engine ? CTS_ENGINE_RAYCAST : CTS_ENGINE_CLASSIC;
                s.kernel = (CtsKernelId)k;
                s.kernel_radius = radii[r];
                assert_int_equal(cts_render(MODEL_OF(volume), cts_preset_builtin(0), &s, &p, NULL, &err),
                                 r == 0 || r == 3 ? CTS_ERR_USAGE : CTS_OK);
                cts_picture_free(&p);
            }
    cts_volume_free(&volume);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kernels),  cmocka_unit_test(test_engines), cmocka_unit_test(test_formats),
        cmocka_unit_test(test_settings), cmocka_unit_test(test_radius),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
