/* A renderer for several frames: each frame is the picture of a single render, and unchanged state is not computed
 * again. */
#include "base/mem.h"
#include "scenes.h"

static bool has_skip(const CtsReport *report, const char *what, const char *why)
{
    for (size_t i = 0; i < report->n_skips; i++)
        if (!strcmp(report->skips[i].what, what) && !strcmp(report->skips[i].why, why))
            return true;
    return false;
}

/* In an order that changes axes back and forth. */
static const double views[][2] = {{0, 0},  {60, 0},  {120, 0},  {180, 0},    {240, 0},
                                  {20, 0}, {30, 70}, {100, 80}, {-100, -65}, {0, 0}};
enum { N_VIEWS = sizeof views / sizeof views[0] };

static void check_frames(const CtsModel *model, const CtsPreset *preset, const CtsRenderSettings *settings)
{
    CtsRenderer *renderer;
    CtsError err = {0};
    assert_int_equal(cts_render_begin(&renderer, model, preset, settings, &err), CTS_OK);
    for (int view = 0; view < N_VIEWS; view++) {
        CtsPicture *frame;
        CtsRenderSettings s = *settings;
        s.azimuth_deg = views[view][0];
        s.elevation_deg = views[view][1];
        CtsPicture *alone = render_model(model, preset, &s, NULL);
        assert_int_equal(cts_render_frame(renderer, s.azimuth_deg, s.elevation_deg, &frame, NULL, &err), CTS_OK);
        assert_same_picture(alone, frame, "engine %s, view %g,%g, frame %d", cts_engine_names[s.engine], s.azimuth_deg,
                            s.elevation_deg, view);
        assert_memory_equal(&frame->info, &alone->info, sizeof alone->info);
        cts_picture_free(&frame);
        cts_picture_free(&alone);
    }
    cts_render_end(&renderer);
    assert_null(renderer);
    cts_render_end(&renderer);
}

static void test_same_pictures(void **state)
{
    CtsModel model = {.volume = phantom_head(40, 44, 36, 20)};
    static const CtsEngineId engines[] = {CTS_ENGINE_TILED, CTS_ENGINE_CLASSIC, CTS_ENGINE_LAYERS, CTS_ENGINE_VOID,
                                          CTS_ENGINE_COMBINED};
    static const char *const presets[] = {"bone", "skin"};
    CtsError err;
    for (size_t e = 0; e < sizeof engines / sizeof *engines; e++)
        for (int n = 0; n < 2; n++) {
            const CtsPreset preset = preset_named(presets[n]);
            CtsRenderSettings s = settings_for(engines[e], 48, 0, 0);
            s.shade = n ? CTS_ON : CTS_OFF;
            s.opacity_per_voxel = n;
            check_frames(&model, &preset, &s);
            s.max_error = 0.25;
            if (engines[e] == CTS_ENGINE_TILED)
                check_frames(&model, &preset, &s);
        }
    /* With macro-cells of the volume's own. */
    assert_int_equal(cts_model_prepare(&model, 1, &err), CTS_OK);
    const CtsPreset bone = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 48, 0, 0);
    s.want_depth = true;
    check_frames(&model, &bone, &s);
    s.mode = CTS_MODE_MIP;
    check_frames(&model, &bone, &s);
    cts_model_free(&model);
}

/* Error control marches few rays of a picture by sheets through whole blocks, and groups of pixels through tested
 * cells: the same pictures before and after the first such test. Two renderers of one model share its copy for views
 * from the side. */
static void test_masks(void **state)
{
    CtsModel model = {.volume = phantom_head(96, 100, 88, 20)};
    CtsError err;
    const CtsPreset skin = preset_named("skin");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 16, 0, 0);
    assert_int_equal(cts_model_prepare(&model, 1, &err), CTS_OK);
    check_frames(&model, &skin, &s);
    s.engine = CTS_ENGINE_SHEETS;
    s.max_error = 8;
    check_frames(&model, &skin, &s);
    cts_model_free(&model);
}

/* A small ball in a large box of dim noise: side views copy only the surroundings of the ball, and agree with a ray
 * caster that reads the volume itself. */
static void test_sparse_copy(void **state)
{
    CtsVolume *v = NULL;
    CtsError err = {0};
    uint64_t random = 11;
    assert_int_equal(cts_volume_new(&v, 120, 130, 110, &err), CTS_OK);
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++)
            for (int i = 0; i < v->dims[0]; i++) {
                const double from_centre = sqrt((i - 31) * (i - 31) + (j - 90) * (j - 90) + (k - 27) * (k - 27));
                const double hu = fmin(fmax(150 * (12 - from_centre), -900), 900);
                v->grey[((size_t)k * 130 + (size_t)j) * 120 + (size_t)i] =
                    (uint16_t)(1024 + hu + (hu < -800 ? scene_random(&random) % 900 : 0));
            }
    const CtsPreset preset = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 100, 90, 0);
    s.mm_per_pixel = 1.1;
    s.n_threads = 2;
    s.shade = CTS_OFF;
    CtsRenderer *renderer;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &preset, &s, &err), CTS_OK);
    static const double sides[][2] = {{90, 0}, {75, 5}, {60, 20}, {-90, 0}, {-80, -30}};
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
        CtsPicture *frame;
        CtsRenderSettings truth = s;
        truth.engine = CTS_ENGINE_RAYCAST;
        truth.azimuth_deg = sides[i][0];
        truth.elevation_deg = sides[i][1];
        assert_int_equal(cts_render_frame(renderer, sides[i][0], sides[i][1], &frame, NULL, &err), CTS_OK);
        CtsPicture *exact = render(v, &preset, &truth, NULL);
        double square = 0, seen = 0;
        for (int n = 0; n < 100 * 100 * 4; n++) {
            square += pow((double)frame->pixels[n] - (double)exact->pixels[n], 2);
            seen += (double)exact->pixels[n];
        }
        assert_true(seen > 100);
        if (sqrt(square / (100 * 100 * 4)) > 0.5 / 255)
            fail_msg("view %g,%g: rmse %g of 255", sides[i][0], sides[i][1], 255 * sqrt(square / (100 * 100 * 4)));
        cts_picture_free(&frame);
        cts_picture_free(&exact);
    }
    cts_render_end(&renderer);
    cts_volume_free(&v);
}

/* Bands as they come, put together. */
typedef struct Whole {
    CtsPicture *picture;
    int n_bands, next_row;
} Whole;

static CtsStatus take_band(void *context, CtsPicture *band, CtsError *err)
{
    Whole *whole = context;
    const size_t n = (size_t)band->width * (size_t)band->height;
    const size_t first = (size_t)band->width * (size_t)band->first_row;
    if (!whole->picture) {
        assert_int_equal(cts_picture_new(&whole->picture, band->width, band->whole_height, 4, err), CTS_OK);
        whole->picture->info = band->info;
        if (band->depth_mm)
            assert_int_equal(
                cts_alloc_array(&whole->picture->depth_mm, (size_t)band->width * (size_t)band->whole_height, err),
                CTS_OK);
    }
    assert_int_equal(band->first_row, whole->next_row);
    assert_int_equal(band->depth_mm != NULL, whole->picture->depth_mm != NULL);
    memcpy(whole->picture->pixels + 4 * first, band->pixels, 4 * n * sizeof(float));
    if (band->depth_mm)
        memcpy(whole->picture->depth_mm + first, band->depth_mm, n * sizeof(float));
    whole->next_row += band->height;
    whole->n_bands++;
    return CTS_OK;
}

static void check_bands(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                        int n_bands)
{
    CtsRenderer *renderer;
    CtsError err = {0};
    CtsReport in_bands = {0}, at_once = {0};
    Whole whole = {0};
    CtsPicture *frame;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(volume), preset, settings, &err), CTS_OK);
    assert_int_equal(cts_render_frame(renderer, settings->azimuth_deg, settings->elevation_deg, &frame, &at_once, &err),
                     CTS_OK);
    assert_int_equal(cts_render_bands(renderer, settings->azimuth_deg, settings->elevation_deg,
                                      &(CtsBandSink){take_band, &whole, .max_rows = 64}, &in_bands, &err),
                     CTS_OK);
    assert_int_equal(whole.n_bands, n_bands);
    const size_t n = (size_t)frame->width * (size_t)frame->height;
    assert_same_plane(frame->pixels, whole.picture->pixels, frame->width, 4 * n, 4, "colour", "bands");
    assert_memory_equal(&frame->info, &whole.picture->info, sizeof frame->info);
    if (frame->depth_mm)
        assert_same_plane(frame->depth_mm, whole.picture->depth_mm, frame->width, n, 1, "depth", "bands");
    assert_int_equal(at_once.verified.pixels, settings->verify);
    assert_true(at_once.verified.rmse == in_bands.verified.rmse && at_once.verified.max == in_bands.verified.max);
    cts_report_free(&at_once);
    cts_report_free(&in_bands);
    cts_picture_free(&frame);
    cts_picture_free(&whole.picture);
    cts_render_end(&renderer);
}

static bool controls_errors(CtsEngineId engine)
{
    return engine == CTS_ENGINE_AUTO || engine == CTS_ENGINE_SHEETS || engine == CTS_ENGINE_TILED;
}

/* Bands are the picture's rows to the bit: every engine, lit and unlit, along an axis and oblique, with the report's
 * contents. */
static void test_bands(void **state)
{
    CtsVolume *v = phantom_head(40, 44, 36, 20);
    for (int engine = 0; engine < CTS_N_ENGINES; engine++)
        for (int n = 0; n < 2; n++) {
            const CtsPreset preset = preset_named(n ? "skin" : "bone");
            CtsRenderSettings s = settings_for((CtsEngineId)engine, 40, n ? 25 : 180, n ? -35 : 0);
            s.height = n ? 192 : 150;
            s.mm_per_pixel = n ? 0.4 : 0.3;
            s.shade = n ? CTS_ON : CTS_OFF;
            s.want_depth = true;
            s.verify = 30;
            s.samples = n && engine != CTS_ENGINE_RAYCAST ? 2 : 0;
            if (engine == CTS_ENGINE_TILED && !n)
                s.max_error = 0.1;
            if (controls_errors((CtsEngineId)engine))
                enlarge_to_two_strips(&s);
            check_bands(v, &preset, &s, controls_errors((CtsEngineId)engine) ? 2 : 3);
            if (engine != CTS_ENGINE_TILED)
                continue;
            s.max_error = 4; /* a preview, parts of which are re-rendered */
            s.samples = 0;
            s.want_depth = false;
            check_bands(v, &preset, &s, 2);
        }
    static const CtsEngineId projecting[] = {CTS_ENGINE_TILED, CTS_ENGINE_RAYCAST};
    const CtsPreset bone = preset_named("bone");
    for (int mode = CTS_MODE_MIP; mode < CTS_N_MODES; mode++)
        for (int e = 0; e < 2; e++) {
            CtsRenderSettings s = settings_for(projecting[e], 24, 40, 60);
            s.height = 130;
            s.mm_per_pixel = 0.5;
            s.mode = mode;
            check_bands(v, &bone, &s, 3);
        }
    cts_volume_free(&v);
}

/* A rotation uses one transposed copy and one set of tables, and reports it. */
static void test_report(void **state)
{
    static const char earlier[] = "made for an earlier frame";
    CtsVolume *v = phantom_head(40, 44, 36, 0);
    const CtsPreset bone = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 48, 0, 0);
    CtsRenderer *renderer;
    CtsError err = {0};
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_OK);
    static const struct {
        double azimuth_deg;
        bool made; /* before */
    } frames[] = {{0, false}, {30, true}, {90, true}, {180, true}};
    for (size_t n = 0; n < sizeof frames / sizeof *frames; n++) {
        CtsReport report = {0};
        CtsPicture *frame;
        assert_int_equal(cts_render_frame(renderer, frames[n].azimuth_deg, 0, &frame, &report, &err), CTS_OK);
        assert_int_equal(has_skip(&report, "transfer function table", earlier), frames[n].made);
        assert_int_equal(has_skip(&report, "mask of what is visible", earlier), frames[n].made);
        cts_report_free(&report);
        cts_picture_free(&frame);
    }
    cts_render_end(&renderer);
    cts_volume_free(&v);
}

/* State shared by a frame's bands, or needed by a trial of the picture, does not count as reused from an earlier
 * frame. */
static void test_first_frame(void **state)
{
    CtsVolume *v = phantom_head(40, 44, 36, 0);
    const CtsPreset bone = preset_named("bone");
    for (int engine = 0; engine < CTS_N_ENGINES; engine++) {
        CtsRenderSettings s = settings_for((CtsEngineId)engine, 24, 60, 0);
        s.height = 200;
        s.max_error = 2;
        if (controls_errors((CtsEngineId)engine))
            enlarge_to_two_strips(&s);
        CtsRenderer *renderer;
        CtsReport report = {0};
        CtsError err = {0};
        Whole whole = {0};
        const CtsBandSink sink = {take_band, &whole, .max_rows = 64};
        assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_OK);
        assert_int_equal(cts_render_bands(renderer, 60, 0, &sink, &report, &err), CTS_OK);
        assert_int_equal(whole.n_bands, controls_errors((CtsEngineId)engine) ? 2 : 4);
        for (size_t i = 0; i < report.n_skips; i++)
            if (strstr(report.skips[i].why, "earlier"))
                fail_msg("%s: %s: %s", cts_engine_names[engine], report.skips[i].what, report.skips[i].why);
        cts_report_free(&report);
        cts_picture_free(&whole.picture);
        cts_render_end(&renderer);
    }
    cts_volume_free(&v);
}

/* Bad settings are reported at the beginning, a bad view at its frame; later frames are unaffected. */
static void test_refusals(void **state)
{
    CtsVolume *v = phantom_head(20, 20, 20, 0);
    const CtsPreset bone = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 16, 0, 0);
    CtsRenderer *renderer;
    CtsPicture *frame;
    CtsError err = {0};
    s.width = 0;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_ERR_USAGE);
    assert_null(renderer);
    s.width = 16;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &bone, &s, &err), CTS_OK);
    assert_int_equal(cts_render_frame(renderer, 0, 91, &frame, NULL, &err), CTS_ERR_USAGE);
    assert_null(frame);
    assert_int_equal(cts_render_frame(renderer, 0, 0, &frame, NULL, &err), CTS_OK);
    cts_picture_free(&frame);
    cts_render_end(&renderer);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_masks),    cmocka_unit_test(test_same_pictures), cmocka_unit_test(test_sparse_copy),
        cmocka_unit_test(test_bands),    cmocka_unit_test(test_report),        cmocka_unit_test(test_first_frame),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
