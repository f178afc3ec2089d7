/* From settings to a scene to an engine's picture. */
#include "ctsplat/render.h"

#include "base/clock.h"
#include "base/mem.h"
#include "render/key.h"
#include "render/pilot.h"
#include "render/verify.h"
#include "scene/resolve.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const cts_engine_names[CTS_N_ENGINES] = {
    [CTS_ENGINE_CLASSIC] = "classic",   [CTS_ENGINE_LAYERS] = "layers", [CTS_ENGINE_VOID] = "void",
    [CTS_ENGINE_COMBINED] = "combined", [CTS_ENGINE_TILED] = "tiled",   [CTS_ENGINE_RAYCAST] = "raycast",
};

static const CtsEngine *const engines[CTS_N_ENGINES] = {
    [CTS_ENGINE_CLASSIC] = &cts_engine_classic, [CTS_ENGINE_LAYERS] = &cts_engine_layers,
    [CTS_ENGINE_VOID] = &cts_engine_void,       [CTS_ENGINE_COMBINED] = &cts_engine_combined,
    [CTS_ENGINE_RAYCAST] = &cts_engine_raycast, [CTS_ENGINE_TILED] = &cts_engine_tiled,
};

void cts_render_defaults(CtsRenderSettings *settings)
{
    *settings = (CtsRenderSettings){
        .width = 1024,
        .height = 1024,
        .engine = engines[CTS_ENGINE_TILED] ? CTS_ENGINE_TILED : CTS_ENGINE_CLASSIC,
        .kernel = CTS_KERNEL_TENT,
        .grey_bits = 16,
        .mode = -1,
        .cpu_mask = ~0u,
    };
}

static CtsStatus choose_engine(const CtsRenderSettings *s, CtsMode mode, const CtsEngine **engine, CtsError *err)
{
    const CtsEngine *e = engines[s->engine];
    if (!e)
        return cts_fail(err, CTS_ERR_USAGE, "engine %s is not in this build", cts_engine_names[s->engine]);
    if (!(e->modes >> mode & 1))
        return cts_fail(err, CTS_ERR_USAGE, "engine %s has no mode %s (tiled and raycast have)", e->name,
                        cts_mode_names[mode]);
    if (!(e->kernels >> s->kernel & 1))
        return cts_fail(err, CTS_ERR_USAGE, "engine %s has no kernel %s", e->name, cts_kernel_names[s->kernel]);
    *engine = e;
    return CTS_OK;
}

/* From where skin meets air up to soft tissue: what is seen of it outlines a face. */
static bool shows_skin(const CtsPreset *preset)
{
    bool seen = false;
    for (double hu = -700; hu <= 80 && preset->mode == CTS_MODE_COMPOSITE; hu += 20)
        seen = seen || cts_preset_extinction_per_mm(preset, hu) > 0.01;
    return seen;
}

static void fill_info(CtsPictureInfo *info, const CtsScene *scene, const char *engine_name)
{
    const CtsView *view = &scene->view;
    memcpy(info->preset, scene->preset->name, sizeof info->preset);
    strncpy(info->engine, engine_name, sizeof info->engine - 1);
    info->mode = scene->preset->mode;
    info->azimuth_deg = view->azimuth_deg;
    info->elevation_deg = view->elevation_deg;
    info->mm_per_pixel = view->mm_per_pixel;
    info->window_low_hu = scene->preset->window_low_hu;
    info->window_high_hu = scene->preset->window_high_hu;
    memcpy(info->right_lps, view->right_lps, sizeof info->right_lps);
    memcpy(info->up_lps, view->up_lps, sizeof info->up_lps);
    memcpy(info->forward_lps, view->forward_lps, sizeof info->forward_lps);
    memcpy(info->centre_lps, view->centre_lps, sizeof info->centre_lps);
    info->shows_skin = shows_skin(scene->preset);
    info->grey = cts_preset_is_grey(scene->preset, scene->preset->mode);
    info->camera_mm = 0.5 * cts_volume_diagonal_mm(scene->volume);
}

struct CtsRenderer {
    const CtsVolume *volume; /* what the engine gets: the caller's, or quantised */
    const CtsVolume *original;
    CtsVolume *quantised;
    CtsPreset preset;           /* as given */
    CtsRenderSettings settings; /* as asked */
    const CtsEngine *engine;
    CtsLut *lut;
    double lut_scale; /* extinction_scale that lut was made for */
    bool has_key;
    bool piloted; /* --max-error was tried out */
    CtsVoidKey key;
    void *kept; /* the engine's */
};

CtsStatus cts_render_begin(CtsRenderer **renderer, const CtsVolume *volume, const CtsPreset *preset,
                           const CtsRenderSettings *asked, CtsError *err)
{
    CtsStatus st;
    CtsSceneStore store;
    const CtsEngine *engine = NULL;
    *renderer = NULL;
    if ((st = cts_scene_init(&store, volume, preset, asked, err)) ||
        (st = choose_engine(&store.settings, store.preset.mode, &engine, err)))
        return st;
    CtsRenderer *r = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *r = (CtsRenderer){.volume = volume, .original = volume, .preset = *preset, .settings = *asked, .engine = engine};
    if (asked->grey_bits < 16) {
        st = cts_volume_quantise(volume, asked->grey_bits, preset->window_low_hu, preset->window_high_hu,
                                 asked->n_threads, &r->quantised, err);
        r->volume = r->quantised;
    }
    *renderer = r;
    if (st)
        cts_render_end(renderer);
    return st;
}

void cts_render_end(CtsRenderer **renderer)
{
    CtsRenderer *r = *renderer;
    if (!r)
        return;
    if (r->kept && r->engine->forget)
        r->engine->forget(r->kept);
    cts_lut_free(&r->lut);
    cts_volume_free(&r->quantised);
    free(r);
    *renderer = NULL;
}

/* What --void key leaves out of the transfer function's table; the mixture is that of the volume as it was loaded. */
static CtsStatus hide_void(CtsRenderer *r, const CtsScene *scene, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    if (!r->settings.void_key || !r->engine->takes_key)
        return CTS_OK;
    if (!r->has_key &&
        (st = cts_key_find(r->original, scene->preset, scene->settings->n_threads, &r->key, report, err)))
        return st;
    r->has_key = true;
    cts_lut_hide(r->lut, &r->key, r->volume);
    return CTS_OK;
}

/* Told with the first frame alone. */
static void tell_no_key(CtsRenderer *r, CtsReport *report)
{
    if (r->has_key)
        return;
    r->has_key = true;
    const char *const why = r->engine == &cts_engine_tiled ? "skips only what is provably invisible" : "skips no void";
    cts_report_skip(report, "void key", "engine %s %s", r->engine->name, why);
    cts_report_finding(report, "void_key_unused", CTS_WARNING,
                       "--void key: engine %s %s, so nothing is lost (void and combined take the key)", r->engine->name,
                       why);
}

/* The transfer function's table for this scene; only with --opacity-unit voxel does it depend on the view. */
static CtsStatus find_lut(CtsRenderer *r, CtsScene *scene, CtsReport *report, CtsError *err)
{
    const CtsPreset *p = scene->preset;
    if (p->mode != CTS_MODE_COMPOSITE) {
        cts_report_skip(report, "transfer function", "mode %s shows HU through the window", cts_mode_names[p->mode]);
        return CTS_OK;
    }
    if (r->lut && r->lut_scale == scene->extinction_scale) {
        cts_report_skip(report, "transfer function table", "made for an earlier frame");
    } else {
        const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
        cts_lut_free(&r->lut);
        CtsStatus st;
        if ((st = cts_lut_new(&r->lut, p, r->volume, scene->extinction_scale, scene->settings->n_threads, err)))
            return st;
        r->lut_scale = scene->extinction_scale;
        cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, CTS_N_GREY, 0);
        if ((st = hide_void(r, scene, report, err))) {
            cts_lut_free(&r->lut);
            return st;
        }
    }
    scene->lut = r->lut;
    return CTS_OK;
}

/* One view of the renderer's volume, on its way through the engine; not to be copied. */
typedef struct Frame {
    CtsRenderer *renderer;
    CtsSceneStore store;
    CtsScene original; /* store's scene of the volume before quantising: what that loses is part of the error */
    CtsVerify verify;
} Frame;

/* Rows first_row to first_row + n_rows - 1, empty. */
static CtsStatus new_band(const Frame *frame, int first_row, int n_rows, CtsPicture **picture, CtsError *err)
{
    const CtsScene *scene = &frame->store.scene;
    const CtsRenderSettings *s = scene->settings;
    CtsStatus st;
    if ((st = cts_picture_new(picture, s->width, n_rows, 4, err)))
        return st;
    (*picture)->first_row = first_row;
    (*picture)->whole_height = s->height;
    fill_info(&(*picture)->info, scene, frame->renderer->engine->name);
    if (!s->want_depth || scene->preset->mode != CTS_MODE_COMPOSITE)
        return CTS_OK;
    const size_t n = (size_t)s->width * (size_t)n_rows;
    if ((st = cts_alloc_array(&(*picture)->depth_mm, n, err)))
        return st;
    for (size_t i = 0; i < n; i++)
        (*picture)->depth_mm[i] = INFINITY;
    return CTS_OK;
}

static CtsStatus find_plan(CtsRenderer *r, CtsRenderSettings *asked, CtsReport *report, CtsError *err);

/* least_verified: so many pixels even where settings->verify is 0, if --void key has lost something. */
static CtsStatus frame_begin(Frame *frame, CtsRenderer *r, double azimuth_deg, double elevation_deg, int least_verified,
                             CtsReport *report, CtsError *err)
{
    CtsStatus st;
    CtsRenderSettings asked = r->settings;
    *frame = (Frame){.renderer = r};
    asked.azimuth_deg = azimuth_deg;
    asked.elevation_deg = elevation_deg;
    if ((st = find_plan(r, &asked, report, err)))
        return st;
    if ((st = cts_scene_init(&frame->store, r->volume, &r->preset, &asked, err)))
        return st;
    const CtsPreset *p = &frame->store.preset;
    const CtsRenderSettings *s = &frame->store.settings;
    frame->store.scene.kept = &r->kept;
    if ((st = find_lut(r, &frame->store.scene, report, err)))
        return st;
    if (s->void_key && !r->engine->takes_key)
        tell_no_key(r, report);
    if (!p->shade)
        cts_report_skip(report, "lighting", "off in mode %s by %s", cts_mode_names[p->mode],
                        p->mode != CTS_MODE_COMPOSITE ? "its nature"
                        : s->shade == CTS_OFF         ? "--shade off"
                                                      : "the preset");
    if (!s->want_depth)
        cts_report_skip(report, "depth", "not asked for (an .exr output holds it)");
    else if (p->mode != CTS_MODE_COMPOSITE)
        cts_report_skip(report, "depth", "mode %s shows no surface", cts_mode_names[p->mode]);
    const bool lossy = report && report->key_loss > 0;
    const int n = s->verify > 0 ? s->verify : lossy ? least_verified : 0;
    if (n == 0 || s->explain)
        return CTS_OK;
    frame->original = frame->store.scene;
    frame->original.volume = r->original;
    return cts_verify_begin(&frame->verify, &frame->original, (size_t)n, err);
}

/* picture NULL: only the plan. */
static CtsStatus frame_rows(Frame *frame, CtsPicture *picture, CtsReport *report, CtsError *err)
{
    const CtsStatus st = frame->renderer->engine->render(&frame->store.scene, picture, report, err);
    if (!st && picture)
        cts_verify_take(&frame->verify, picture);
    return st;
}

static CtsStatus frame_end(Frame *frame, CtsStatus st, CtsReport *report, CtsError *err)
{
    if (!st && !frame->store.settings.explain)
        st = cts_verify_end(&frame->verify, report, err);
    cts_verify_free(&frame->verify);
    return st;
}

/* A CtsTrial: the renderer's engine with all that it keeps from one frame to the next, but nothing told. */
static CtsStatus try_plan(void *context, double max_error, const int *first_rows, int n_bands, int n_rows,
                          CtsVerify *verify, CtsError *err)
{
    CtsRenderer *r = context;
    const CtsRenderSettings asked = r->settings;
    const bool has_key = r->has_key;
    Frame frame;
    r->settings.max_error = max_error;
    r->settings.verify = 0;
    r->settings.explain = r->settings.want_depth = false;
    CtsStatus st = frame_begin(&frame, r, asked.azimuth_deg, asked.elevation_deg, 0, NULL, err);
    for (int i = 0; i < n_bands && !st; i++) {
        CtsPicture *band = NULL;
        if (!(st = new_band(&frame, first_rows[i], n_rows, &band, err)) && !(st = frame_rows(&frame, band, NULL, err)))
            cts_verify_take(verify, band);
        cts_picture_free(&band);
    }
    st = frame_end(&frame, st, NULL, err);
    r->settings = asked;
    r->has_key = has_key;
    return st;
}

/* What --max-error takes, found for the first frame and kept for all. */
static CtsStatus find_plan(CtsRenderer *r, CtsRenderSettings *asked, CtsReport *report, CtsError *err)
{
    CtsSceneStore store;
    CtsStatus st;
    if (!(asked->max_error > 0) || asked->samples > 0 || r->piloted || asked->engine == CTS_ENGINE_RAYCAST)
        return CTS_OK;
    if ((st = cts_scene_init(&store, r->original, &r->preset, asked, err)) || store.preset.mode != CTS_MODE_COMPOSITE)
        return st;
    asked->mm_per_pixel = store.scene.view.mm_per_pixel;
    r->piloted = true;
    if (asked->engine == CTS_ENGINE_TILED) {
        const CtsRenderSettings first = r->settings;
        r->settings = *asked;
        st = cts_pilot_plan(&store.scene, try_plan, r, asked, report, err);
        r->settings = first;
        r->settings.max_error = asked->max_error;
    } else if (!(st = cts_pilot_samples(r->volume, r->original, &r->preset, asked, report, err))) {
        r->settings.samples = asked->samples;
    }
    return st;
}

CtsStatus cts_render_frame(CtsRenderer *r, double azimuth_deg, double elevation_deg, CtsPicture **picture,
                           CtsReport *report, CtsError *err)
{
    Frame frame;
    *picture = NULL;
    CtsStatus st = frame_begin(&frame, r, azimuth_deg, elevation_deg, 0, report, err);
    if (!st && !r->settings.explain)
        st = new_band(&frame, 0, r->settings.height, picture, err);
    if (!st)
        st = frame_rows(&frame, *picture, report, err);
    if ((st = frame_end(&frame, st, report, err)))
        cts_picture_free(picture);
    return st;
}

static int choose_rows(const CtsRenderSettings *s, int max_rows)
{
    enum { BAND_BYTES = 128 << 20 };
    const size_t row_bytes = (size_t)s->width * (s->want_depth ? 5 : 4) * sizeof(float);
    size_t n = max_rows > 0 ? (size_t)max_rows : BAND_BYTES / row_bytes;
    n = n / CTS_BAND_ROWS * CTS_BAND_ROWS;
    n = n > 0 ? n : CTS_BAND_ROWS;
    return n < (size_t)s->height ? (int)n : s->height;
}

static CtsStatus render_band(Frame *frame, int first_row, int n_rows, CtsBandSink sink, void *context,
                             CtsReport *report, CtsError *err)
{
    CtsPicture *band = NULL;
    const CtsVoxelCounts before = report ? report->voxels : (CtsVoxelCounts){0};
    CtsStatus st = new_band(frame, first_row, n_rows, &band, err);
    if (!st)
        st = frame_rows(frame, band, report, err);
    /* Of the bands of one picture the one that needed most stands for all. */
    if (report && first_row > 0 && before.splatted > report->voxels.splatted)
        report->voxels = before;
    if (!st)
        st = sink(context, band, err);
    cts_picture_free(&band);
    return st;
}

CtsStatus cts_render_bands(CtsRenderer *r, double azimuth_deg, double elevation_deg, int max_rows, CtsBandSink sink,
                           void *context, CtsReport *report, CtsError *err)
{
    enum { KEY_PIXELS = 256 };
    Frame frame;
    CtsStatus st = frame_begin(&frame, r, azimuth_deg, elevation_deg, KEY_PIXELS, report, err);
    if (!st && r->settings.explain)
        st = frame_rows(&frame, NULL, report, err);
    const int height = r->settings.explain ? 0 : r->settings.height, n_rows = choose_rows(&r->settings, max_rows);
    if (n_rows < height)
        cts_report_skip(report, "whole picture", "made and written in bands of %d rows, to bound memory%s", n_rows,
                        r->settings.engine == CTS_ENGINE_TILED || r->settings.engine == CTS_ENGINE_RAYCAST
                            ? ""
                            : "; sheets are made again for each");
    for (int row = 0; row < height && !st; row += n_rows)
        st = render_band(&frame, row, height - row < n_rows ? height - row : n_rows, sink, context, report, err);
    return frame_end(&frame, st, report, err);
}

static CtsStatus render_whole(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                              bool piloted, CtsPicture **picture, CtsReport *report, CtsError *err)
{
    CtsRenderer *renderer;
    *picture = NULL;
    CtsStatus st = cts_render_begin(&renderer, volume, preset, settings, err);
    if (!st) {
        renderer->piloted = piloted;
        st = cts_render_frame(renderer, settings->azimuth_deg, settings->elevation_deg, picture, report, err);
    }
    cts_render_end(&renderer);
    return st;
}

CtsStatus cts_render_on_trial(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                              CtsPicture **picture, CtsError *err)
{
    return render_whole(volume, preset, settings, true, picture, NULL, err);
}

CtsStatus cts_render(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                     CtsPicture **picture, CtsReport *report, CtsError *err)
{
    return render_whole(volume, preset, settings, false, picture, report, err);
}
