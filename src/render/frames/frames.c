#include "render/frames/frames.h"

#include "base/clock.h"
#include "base/invariant.h"
#include "base/mem.h"
#include "core/model/voxel_labels.h"
#include "core/scene/settings.h"
#include "core/scene/visible.h"
#include "render/engines/engines.h"
#include "render/frames/level_choice.h"
#include "render/framing/framing.h"
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Reason why CTS_ENGINE_AUTO renders by the exact march, or NULL where an engine with levels may do it. */
static const char *why_march(const CtsModel *model, const CtsSceneStore *store, const CtsEngine *levels)
{
    const CtsRenderSettings *const s = &store->settings;
    const CtsVolume *const volume = model->volume;
    const CtsVoxelLabels *const o = model->voxel_labels;
    const bool by_default = s->kernel == CTS_KERNEL_TENT && s->kernel_radius == 1 && s->grey_bits == 16 &&
                            s->samples == 0 && s->tolerance_hu == 0 && !s->void_key;
    bool thin = cts_volume_n_voxels(volume) > INT32_MAX;
    for (int a = 0; a < 3; a++)
        thin |= volume->dims[a] < 2;
    return !(levels->modes >> store->preset.mode & 1) ? "the mode is a projection"
           : !by_default                              ? "kernel, grey levels, samples, tolerance or void rule are given"
           : cts_voxel_labels_coloured(o) || cts_model_shown(model) != model ? "labels are hidden or have colours"
           : cts_scene_has_step(&store->preset, volume)                      ? "the preset's opacity has a step"
           : thin ? "the volume is one voxel thin, or too large"
                  : NULL;
}

/* The engine for CTS_ENGINE_AUTO, as far as it does not depend on the view. */
static CtsEngineId resolve_engine(const CtsModel *model, const CtsSceneStore *store, const char **why)
{
    const CtsEngineId levels = cts_engine_with_levels();
    *why = NULL;
    if (store->settings.engine != CTS_ENGINE_AUTO)
        return store->settings.engine;
    *why = why_march(model, store, cts_engine(levels));
    return *why && !store->settings.level ? cts_engine_march(levels) : levels;
}

static CtsStatus choose_engine(const CtsRenderSettings *s, CtsMode mode, const CtsEngine **engine, CtsError *err)
{
    char list[CTS_ENGINE_LIST_MAX];
    /* CTS_ENGINE_AUTO is limited to the features of the exact march; a given level selects an engine that has it. */
    const CtsEngineId levels = cts_engine_with_levels();
    const CtsEngine *e = cts_engine(s->engine != CTS_ENGINE_AUTO ? s->engine
                                    : s->level                   ? levels
                                                                 : cts_engine_march(levels));
    if (!(e->modes >> mode & 1))
        return cts_fail(err, CTS_ERR_USAGE, "engine %s has no mode %s (%s have)", e->name, cts_mode_names[mode],
                        cts_engines_with(offsetof(CtsEngine, modes), (int)mode, list));
    if (!(e->kernels >> s->kernel & 1))
        return cts_fail(err, CTS_ERR_USAGE, "engine %s has no kernel %s (%s have)", e->name,
                        cts_kernel_names[s->kernel],
                        cts_engines_with(offsetof(CtsEngine, kernels), (int)s->kernel, list));
    if (s->level && !*cts_engines_with(offsetof(CtsEngine, levels), (int)s->level, list))
        return cts_fail(err, CTS_ERR_USAGE, "no engine has level %s", cts_engine_level_names[s->level]);
    if (s->level && !(e->levels >> s->level & 1))
        return cts_fail(err, CTS_ERR_USAGE, "engine %s has no level %s (%s have)", e->name,
                        cts_engine_level_names[s->level],
                        cts_engines_with(offsetof(CtsEngine, levels), (int)s->level, list));
    if (s->slab_mm > 0 && !e->supports_slabs)
        return cts_fail(err, CTS_ERR_USAGE, "engine %s cuts no slab (%s do)", e->name,
                        cts_engines_with(offsetof(CtsEngine, supports_slabs), CTS_ENGINE_FLAG, list));
    *engine = e;
    return CTS_OK;
}

/* Engines with label boundaries get the model with its labels; others one in which hidden voxels are air. */
static CtsStatus choose_model(const CtsModel *model, const CtsSceneStore *store, const CtsEngine *engine,
                              const CtsModel **chosen, CtsError *err)
{
    const CtsRenderSettings *const s = &store->settings;
    const CtsMode mode = store->preset.mode;
    const CtsVoxelLabels *const o = model->voxel_labels;
    const bool by_edges =
        engine->supports_labels && s->kernel == CTS_KERNEL_TENT && s->kernel_radius == 1 && s->grey_bits == 16;
    char list[CTS_ENGINE_LIST_MAX];
    *chosen = by_edges ? model : cts_model_shown(model);
    if (cts_voxel_labels_coloured(o) && mode != CTS_MODE_COMPOSITE)
        return cts_fail(err, CTS_ERR_USAGE,
                        "mode %s shows HU by the window, and labels have colours (mode composite "
                        "shows them)",
                        cts_mode_names[mode]);
    if (cts_voxel_labels_coloured(o) && !by_edges)
        return cts_fail(err, CTS_ERR_USAGE,
                        "colours of labels: engines %s alone have them, with kernel tent and 16 grey bits",
                        cts_engines_with(offsetof(CtsEngine, supports_labels), CTS_ENGINE_FLAG, list));
    if (*chosen != model && (mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE))
        return cts_fail(err, CTS_ERR_USAGE, "hidden labels: mode %s knows them with kernel tent and 16 grey bits alone",
                        cts_mode_names[mode]);
    return CTS_OK;
}

bool cts_render_ignores_air(const CtsPreset *preset, const CtsRenderSettings *settings)
{
    const bool chosen = settings->engine == CTS_ENGINE_AUTO;
    const CtsEngine *const engine = cts_engine(chosen ? cts_engine_with_levels() : settings->engine);
    const CtsMode mode = settings->mode >= 0 ? (CtsMode)settings->mode : preset->mode;
    return !engine->is_layered && !engine->is_reference && settings->grey_bits == 16 && mode != CTS_MODE_MIP &&
           (mode != CTS_MODE_COMPOSITE || cts_preset_opacity(preset, CTS_LEAST_HU) == 0);
}

CtsStatus cts_render_check(const CtsPreset *preset, const CtsRenderSettings *settings, CtsError *err)
{
    const CtsEngine *engine;
    const CtsStatus st = cts_scene_check(settings, err);
    return st ? st : choose_engine(settings, cts_scene_preset(preset, settings).mode, &engine, err);
}

CtsStatus cts_render_begin(CtsRenderer **renderer, const CtsModel *model, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsError *err)
{
    CtsStatus st;
    CtsSceneStore store;
    const CtsEngine *engine = NULL;
    const char *why;
    *renderer = NULL;
    if ((st = cts_scene_init(&store, model, preset, settings, err)) ||
        (st = choose_engine(&store.settings, store.preset.mode, &engine, err)))
        return st;
    const CtsEngineId id = resolve_engine(model, &store, &why);
    CtsRenderer *r = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *r = (CtsRenderer){.engine_id = id,
                       .why_march = why,
                       .given = *model,
                       .preset = store.preset,
                       .settings = *settings,
                       .engine = cts_engine(id)};
    r->preset.occlusion = preset->occlusion; /* the settings may change from frame to frame */
    st = cts_model_prepare(&r->given, settings->n_threads, err);
    r->own_macrocells = model->macrocells ? NULL : r->given.macrocells;
    if (!st)
        st = choose_model(&r->given, &store, r->engine, &r->original, err);
    r->model = r->original;
    if (!st && settings->grey_bits < 16) {
        st = cts_volume_quantise(r->original->volume, settings->grey_bits, r->preset.window_low_hu,
                                 r->preset.window_high_hu, settings->n_threads, &r->quantised.volume, err);
        if (!st)
            st = cts_model_prepare(&r->quantised, settings->n_threads, err);
        r->quantised.body = r->original->body;
        r->model = &r->quantised;
    }
    *renderer = r;
    if (st)
        cts_render_end(renderer);
    return st;
}

static void free_errors(CtsRenderer *r)
{
    cts_free(&r->errors.origin);
    cts_free(&r->errors.indicator);
}

void cts_render_end(CtsRenderer **renderer)
{
    CtsRenderer *r = *renderer;
    if (!r)
        return;
    for (int i = 0; i < CTS_N_ENGINES; i++)
        if (r->engine_cache[i])
            cts_engine((CtsEngineId)i)->free_cache(r->engine_cache[i]);
    cts_lut_free(&r->lut);
    cts_openness_free(&r->openness);
    cts_engine(cts_engine_for_probes())->free_cache(r->original_cache);
    r->quantised.body = NULL;
    cts_model_free(&r->quantised);
    cts_macrocells_free(&r->own_macrocells);
    cts_picture_free(&r->band);
    free_errors(r);
    free(r);
    *renderer = NULL;
}

static bool keeps_what_is_made(const CtsRenderSettings *a, const CtsRenderSettings *b)
{
    bool same = true;
    for (const CtsSettingRow *row = cts_setting_rows; row < cts_setting_rows + CTS_N_SETTING_ROWS; row++)
        same = same && (row->remakes != CTS_REMAKES_RENDERER ||
                        !memcmp((const char *)a + row->at, (const char *)b + row->at, row->size));
    return same;
}

bool cts_render_change_settings(CtsRenderer *r, const CtsRenderSettings *settings)
{
    if (!keeps_what_is_made(&r->settings, settings) || cts_scene_check(settings, NULL))
        return false;
    r->settings = *settings;
    r->is_fitted = r->is_planned = false;
    return true;
}

/* True if the background around the visible part is light. In a projection that is the air in the box. */
static bool is_light_behind(const CtsPreset *preset)
{
    const double *rgb = preset->background;
    return preset->mode == CTS_MODE_COMPOSITE && !preset->background_none &&
           0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] > 0.5;
}

static void fill_info(CtsPictureInfo *info, const CtsFrame *frame, const CtsScene *scene)
{
    const CtsView *view = &scene->view;
    memcpy(info->preset, scene->preset->name, sizeof info->preset);
    strncpy(info->engine, cts_engine(frame->engine_id)->name, sizeof info->engine - 1);
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
    info->light_behind = is_light_behind(scene->preset);
    info->shows_skin =
        scene->volume->quantity != CTS_QUANTITY_HU ||
        cts_scene_shows_skin(scene->preset, scene->extinction_scale, frame->renderer->given.voxel_labels);
    info->grey = cts_scene_is_grey(scene->preset, frame->renderer->given.voxel_labels);
    info->camera_mm = 0.5 * cts_volume_diagonal_mm(scene->volume);
    info->occlusion = cts_openness_counts(scene->preset) ? scene->preset->occlusion : 0;
}

static bool is_hu(const CtsRenderer *r)
{
    return r->original->volume->quantity == CTS_QUANTITY_HU;
}

/* The void key for the transfer function's table; the mixture is that of the volume as loaded. */
static CtsStatus find_key(CtsRenderer *r, const CtsScene *scene, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (r->settings.void_key && r->engine->uses_void_key && !r->key_found && is_hu(r) &&
        !(st = cts_void_key_find(r->original->volume, scene->preset, scene->settings->n_threads, &r->key, report, err)))
        r->key_found = true;
    return st;
}

static void report_no_key(const CtsEngine *engine, CtsReport *report)
{
    char list[CTS_ENGINE_LIST_MAX];
    const char *const why = engine->skips_void ? "skips only what is provably invisible" : "skips no void";
    cts_report_skip(report, "void key", "engine %s %s", engine->name, why);
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_VOID_KEY_UNUSED,
                          "`void` key: engine %s %s, so nothing is lost (%s take the key)", engine->name, why,
                          cts_engines_with(offsetof(CtsEngine, uses_void_key), CTS_ENGINE_FLAG, list));
}

/* Once for all frames, with the first report that there is. */
static void report_key_once(CtsRenderer *r, CtsReport *report)
{
    if (!r->settings.void_key || r->key_reported || !report)
        return;
    if (!r->engine->uses_void_key)
        report_no_key(r->engine, report);
    else if (!is_hu(r))
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_VOID_KEY_UNUSED,
            "`void` key: the mixture model is one of HU, so only what is provably invisible is skipped");
    else if (r->key_found)
        cts_void_key_report(&r->key, &r->preset, report);
    r->key_reported = true;
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
        cts_lut_free(&r->lut);
        CtsStatus st = find_key(r, scene, report, err);
        const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
        if (st || (st = cts_lut_new(&r->lut, p, r->model->volume, r->key_found ? &r->key.key : NULL,
                                    scene->extinction_scale, err)))
            return st;
        r->lut_scale = scene->extinction_scale;
        cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, (uint64_t)r->lut->n, 0);
    }
    scene->lut = r->lut;
    return CTS_OK;
}

/* Made once for all frames, as it does not depend on how much of it the preset or the settings want. */
static CtsStatus make_openness(CtsRenderer *r, CtsScene *scene, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!cts_openness_counts(scene->preset))
        return CTS_OK;
    if (r->openness)
        cts_report_skip(report, "openness", "made for an earlier frame");
    else
        st = cts_openness_of_scene(&r->openness, r->original, scene->preset, scene->settings->n_threads, report, err);
    scene->openness = r->openness;
    return st;
}

static void report_framing(const CtsRenderSettings *s, CtsReport *report)
{
    if (!s->centre_given)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_NOTHING_VISIBLE, "%s",
            s->slab_mm > 0 ? "nothing that this preset shows lies in the slab (see `slab`)"
                           : "nothing of this volume is visible with this preset (see what HU it shows, the range "
                             "of the series' HU, and what a crop leaves)");
    else
        cts_report_plan(report,
                        "frame: %.4g x %.4g mm about %.1f,%.1f,%.1f, %.4g mm a pixel, around all that is visible",
                        s->width * s->mm_per_pixel, s->height * s->mm_per_pixel, s->centre_lps[0], s->centre_lps[1],
                        s->centre_lps[2], s->mm_per_pixel);
}

/* A rotation is framed once for all its views, a view by itself each time. */
static bool framed_already(const CtsRenderer *r, const CtsRenderSettings *s)
{
    return r->is_fitted && (s->rotation_frames > 1 ||
                            (r->fitted.azimuth_deg == s->azimuth_deg && r->fitted.elevation_deg == s->elevation_deg));
}

CtsStatus cts_frames_view(CtsRenderer *r, const double view_deg[2], CtsRenderSettings *settings, CtsReport *report,
                          CtsError *err)
{
    CtsRenderSettings *s = settings;
    *s = r->settings;
    s->azimuth_deg = view_deg[0];
    s->elevation_deg = view_deg[1];
    if (s->fit != CTS_FIT_VISIBLE || s->mm_per_pixel > 0)
        return CTS_OK;
    if (!framed_already(r, s)) {
        const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
        void **const kept = r->model == r->original ? &r->engine_cache[cts_engine_for_probes()] : &r->original_cache;
        const CtsFramed what = {r->original, &r->preset, kept, r->n_begun};
        CtsRenderSettings fitted = *s;
        fitted.centre_given = false;
        const CtsStatus st = cts_framing_find(&what, &fitted, err);
        if (st)
            return st;
        r->fitted = fitted;
        r->is_fitted = true;
        cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, 0, 0);
        report_framing(&r->fitted, report);
    }
    s->mm_per_pixel = r->fitted.mm_per_pixel;
    if (s->centre_given)
        return CTS_OK;
    s->centre_given = r->fitted.centre_given;
    memcpy(s->centre_lps, r->fitted.centre_lps, sizeof s->centre_lps);
    return CTS_OK;
}

static void report_omitted(const CtsFrame *frame, CtsReport *report)
{
    const CtsPreset *p = &frame->store.preset;
    if (!p->shade)
        cts_report_skip(report, "lighting", "off in mode %s by %s", cts_mode_names[p->mode],
                        p->mode != CTS_MODE_COMPOSITE ? "its nature" : "the preset");
    if (!frame->renderer->settings.want_depth)
        cts_report_skip(report, "depth", "not requested");
    else if (p->mode != CTS_MODE_COMPOSITE)
        cts_report_skip(report, "depth", "mode %s shows no surface", cts_mode_names[p->mode]);
}

static CtsEngineLevel finest_level(const CtsEngine *engine)
{
    int level = CTS_N_LEVELS - 1;
    while (level > CTS_LEVEL_AUTO && !(engine->levels >> level & 1))
        level--;
    return (CtsEngineLevel)level;
}

static void report_level(const CtsEngine *engine, const CtsLevelChoice *c, const CtsScene *scene, CtsReport *report)
{
    const double requested = 255 * cts_scene_requested_error(scene);
    cts_report_stage(report, CTS_STAGE_SPLAT, c->wall_ms, c->cpu_ms, c->n_pixels, 0);
    if (c->march_misses)
        cts_report_plan(report,
                        "no level of engine %s is tried, as the march misses %.3g/255, an eighth of the request",
                        engine->name, requested / 8);
    else if (c->n_tried == 0)
        cts_report_plan(report, "no level of engine %s is tried for an error of %.3g/255 and %d x %d pixels of %.3g mm",
                        engine->name, requested, scene->view.width, scene->view.height, scene->view.mm_per_pixel);
    else if (c->level == CTS_LEVEL_AUTO)
        cts_report_plan(report,
                        "no level of engine %s suffices: %d tried on %zu pixels, the last may come to %.3g/255, %.3g "
                        "requested",
                        engine->name, c->n_tried, c->n_pixels, 255 * c->limit, requested);
    else
        cts_report_plan(
            report,
            "level %s of engine %s: an error of up to %.3g/255 is likely by a probe of %zu pixels, %.3g requested",
            cts_engine_level_names[c->level], engine->name, 255 * c->limit, c->n_pixels, requested);
}

/* The level of this frame if none was requested; under CTS_ENGINE_AUTO frames without a suitable level use the exact
 * march. Error control meets the request where the level was not the caller's choice. */
static CtsStatus choose_level(CtsFrame *frame, CtsReport *report, CtsError *err)
{
    CtsRenderer *const r = frame->renderer;
    CtsScene *const scene = &frame->store.scene;
    const CtsEngineId march = cts_engine_march(r->engine_id);
    CtsErrorControl *const control = &frame->error_control;
    CtsLevelChoice choice = {.level = scene->plan.level};
    const bool is_auto = r->settings.engine == CTS_ENGINE_AUTO;
    CtsStatus st = CTS_OK;
    frame->engine_id = r->engine_id;
    scene->cache = &r->engine_cache[r->engine_id];
    *control = (CtsErrorControl){.scene = *scene, .has_opacity_step = cts_scene_has_step(scene->preset, scene->volume)};
    control->scene.cache = &r->engine_cache[march];
    if (r->engine->levels && scene->plan.level == CTS_LEVEL_AUTO) {
        if ((st = cts_level_choose(&choice, r->engine, scene, cts_engine(march), &control->scene, is_auto, err)))
            return st;
        report_level(r->engine, &choice, scene, report);
        control->whole_strips = true;
        control->march_error = choice.march_error;
        if (choice.level == CTS_LEVEL_AUTO && is_auto)
            frame->engine_id = march;
        else if (choice.level == CTS_LEVEL_AUTO)
            choice.level = finest_level(r->engine);
        scene->plan.level = choice.level;
        scene->plan.coarse_lattice = choice.coarse_lattice;
    } else if (is_auto && r->why_march) {
        cts_report_plan(report, "engine auto: %s, as %s", r->engine->name, r->why_march);
    }
    scene->cache = &r->engine_cache[frame->engine_id];
    control->scene.plan = scene->plan;
    control->scene.plan.few_rays = frame->engine_id != march && scene->plan.level != CTS_LEVEL_HYBRID;
    control->engine = cts_engine(frame->engine_id);
    control->march = cts_engine(march);
    control->marches_groups =
        control->engine->levels && (control->whole_strips || scene->plan.level == CTS_LEVEL_HYBRID);
    return CTS_OK;
}

CtsStatus cts_frame_begin(CtsFrame *frame, CtsRenderer *r, const double view_deg[2], int least_lossy, CtsReport *report,
                          CtsError *err)
{
    CtsStatus st;
    CtsRenderSettings settings;
    *frame = (CtsFrame){.renderer = r};
    if ((st = cts_frames_view(r, view_deg, &settings, report, err)) ||
        (st = cts_scene_init(&frame->store, r->model, &r->preset, &settings, err)))
        return st;
    frame->store.scene.plan = r->plan;
    frame->store.scene.frame = r->n_begun++;
    if ((st = find_lut(r, &frame->store.scene, report, err)) ||
        (st = make_openness(r, &frame->store.scene, report, err)))
        return st;
    report_key_once(r, report);
    report_omitted(frame, report);
    if ((st = choose_level(frame, report, err)))
        return st;
    const bool lossy = report && report->key_loss > 0;
    const int n = r->settings.verify > 0 ? r->settings.verify : lossy ? least_lossy : 0;
    if (n == 0 || r->settings.explain)
        return CTS_OK;
    frame->original = frame->store.scene;
    frame->original.model = r->original;
    frame->original.volume = r->original->volume;
    cts_verify_begin(&frame->verify, &frame->original, (size_t)n);
    return CTS_OK;
}

/* A picture of a frame's size, zeroed unless the engine sets all: the renderer's, or a new one. */
static CtsStatus empty_band(const CtsFrame *frame, int n_rows, CtsPicture **picture, CtsError *err)
{
    CtsRenderer *const r = frame->renderer;
    const CtsRenderSettings *const s = frame->store.scene.settings;
    if (!r->band || r->band->width != s->width || r->band->height != n_rows)
        return cts_picture_new(picture, s->width, n_rows, 4, err);
    *picture = r->band;
    r->band = NULL;
    (*picture)->has_alpha = true;
    if (!cts_engine(frame->engine_id)->sets_all)
        memset((*picture)->pixels, 0, 4 * (size_t)s->width * (size_t)n_rows * sizeof *(*picture)->pixels);
    return CTS_OK;
}

void cts_frame_return(CtsFrame *frame, CtsPicture **band)
{
    CtsRenderer *const r = frame->renderer;
    if (!*band || !(*band)->pixels || r->settings.rotation_frames <= 1) {
        cts_picture_free(band);
        return;
    }
    cts_picture_free(&r->band);
    cts_free(&(*band)->depth_mm);
    cts_free(&(*band)->bound);
    r->band = *band;
    *band = NULL;
}

/* Rows of the picture to be, empty. */
static CtsStatus new_band(const CtsFrame *frame, int first_row, int n_rows, CtsPicture **picture, CtsError *err)
{
    const CtsScene *scene = &frame->store.scene;
    const CtsRenderSettings *s = scene->settings;
    CtsStatus st;
    if ((st = empty_band(frame, n_rows, picture, err)))
        return st;
    (*picture)->first_row = first_row;
    (*picture)->whole_height = s->height;
    const size_t n = (size_t)s->width * (size_t)n_rows;
    fill_info(&(*picture)->info, frame, scene);
    if (scene->preset->mode != CTS_MODE_COMPOSITE || !s->want_depth)
        return CTS_OK;
    if ((st = cts_alloc_array(&(*picture)->depth_mm, n, err)))
        return st;
    for (size_t i = 0; i < n; i++)
        (*picture)->depth_mm[i] = INFINITY;
    return CTS_OK;
}

/* The renderer's error map, as an engine gets it. */
static CtsStatus find_errors(const CtsFrame *frame, const CtsPicture *band, CtsErrorMap **errors, CtsError *err)
{
    CtsRenderer *const r = frame->renderer;
    const size_t n = (size_t)band->width * (size_t)band->height;
    CtsStatus st;
    *errors = &r->errors;
    r->errors.interpolation = (CtsTerms){0};
    if (n == r->n_errors && r->errors.indicator) {
        memset(r->errors.origin, 0, n);
        if (!cts_engine(frame->engine_id)->sets_all)
            memset(r->errors.indicator, 0, n * sizeof *r->errors.indicator);
        return CTS_OK;
    }
    free_errors(r);
    r->n_errors = n;
    if ((st = cts_alloc_zeroed(&r->errors.origin, n, err)) || (st = cts_alloc_zeroed(&r->errors.indicator, n, err)))
        free_errors(r);
    return st;
}

/* True where the frame's engine indicates errors, which error control corrects. */
static bool is_controlled(const CtsFrame *frame)
{
    return cts_engine(frame->engine_id)->indicator && frame->store.scene.preset->mode == CTS_MODE_COMPOSITE;
}

int cts_frame_strip_rows(const CtsFrame *frame)
{
    return is_controlled(frame) ? cts_strip_rows(frame->store.scene.view.width) : CTS_BAND_ROWS;
}

CtsStatus cts_frame_rows(CtsFrame *frame, int first_row, int n_rows, CtsPicture **band, CtsReport *report,
                         CtsError *err)
{
    const CtsEngine *const engine = cts_engine(frame->engine_id);
    const CtsScene *const scene = &frame->store.scene;
    CtsErrorMap *errors = NULL;
    *band = NULL;
    CtsStatus st = new_band(frame, first_row, n_rows, band, err);
    if (!st && is_controlled(frame))
        st = find_errors(frame, *band, &errors, err);
    if (!st)
        st = engine->render(scene, *band, errors, report, err);
    if (CTS_INVARIANTS && !st && errors)
        for (size_t i = 0; i < (size_t)(*band)->width * (size_t)(*band)->height; i++)
            CTS_INVARIANT(errors->indicator[i] >= 0);
    if (!st && errors)
        st = cts_error_control_enforce(&frame->error_control, *band, errors, err);
    if (st)
        cts_picture_free(band);
    else
        cts_verify_take(&frame->verify, *band, errors ? errors->indicator : NULL);
    if (!st && engine->indicator == CTS_INDICATOR_BOUND && errors) {
        (*band)->bound = errors->indicator;
        errors->indicator = NULL;
    }
    return st;
}

CtsStatus cts_frame_end(CtsFrame *frame, CtsStatus st, CtsReport *report, CtsError *err)
{
    if (frame->renderer->settings.rotation_frames <= 1)
        free_errors(frame->renderer);
    if (!st && !frame->renderer->settings.explain)
        st = cts_verify_end(&frame->verify, report, err);
    if (!st)
        cts_error_control_report(&frame->error_control, report);
    cts_verify_free(&frame->verify);
    return st;
}
