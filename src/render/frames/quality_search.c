#include "render/frames/quality_search.h"

#include "render/engines/engines.h"
#include <math.h>
#include <stdio.h>

enum { RAYS = 4096, MAX_SAMPLES = 64 };

/* Safety factor of a trial's error, since the whole picture's may be larger than that of the rays tried. */
#define MARGIN 1.25

/* The same view, its pixels so large that RAYS of them cover it. */
static CtsRenderSettings small_picture(const CtsRenderSettings *settings)
{
    CtsRenderSettings s = *settings;
    const double shrink = sqrt((double)RAYS / ((double)s.width * s.height));
    if (shrink < 1) {
        s.width = (int)fmax(floor(s.width * shrink), 1);
        s.height = (int)fmax(floor(s.height * shrink), 1);
        s.mm_per_pixel *= fmax((double)settings->width / s.width, (double)settings->height / s.height);
    }
    s.verify = 0;
    s.max_error = 0;
    s.want_depth = s.explain = false;
    return s;
}

/* Renders all of a small picture. */
static CtsStatus try_samples(const CtsReference *reference, CtsFrames *small, const CtsFrameTask *task, double *rms_255,
                             CtsError *err)
{
    CtsPicture *picture = NULL;
    CtsFrame frame;
    CtsVerified verified;
    CtsStatus st = cts_frame_begin(&frame, small, task, NULL, err);
    if (!st)
        st = cts_frame_rows(&frame, 0, cts_frames_settings(small)->height, &picture, NULL, err);
    st = cts_frame_end(&frame, st, NULL, err);
    if (!st)
        st = cts_reference_compare(reference, picture, &verified, err);
    cts_picture_free(&picture);
    if (!st)
        *rms_255 = 255 * verified.rmse * MARGIN;
    return st;
}

static void report_samples(const CtsRenderSettings *small, double requested, int samples, double best,
                           CtsReport *report)
{
    char list[CTS_ENGINE_LIST_MAX];
    char sheets[48] = "the error of the engine's own plan is";
    if (samples > 0)
        snprintf(sheets, sizeof sheets, "the error of %d sheets a layer is", samples);
    if (best <= requested)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_MAX_ERROR, "`max-error` %g: %s %.3g/255 rms on %d trial rays",
                              requested, sheets, best / MARGIN, small->width * small->height);
    else
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_MAX_ERROR_MISSED,
                              "`max-error` %g is not met: %s %.3g/255 rms on %d trial rays (reference: %s)", requested,
                              sheets, best / MARGIN, small->width * small->height,
                              cts_engines_with(offsetof(CtsEngine, is_reference), CTS_ENGINE_FLAG, list));
}

/* Chooses the samples per layer: first the engine's own, then 2, 4, 8 and so on. */
static CtsStatus plan_samples(const CtsFrames *frames, const CtsRenderSettings *requested, CtsPlan *plan,
                              CtsReport *report, CtsError *err)
{
    const CtsRenderSettings s = small_picture(requested);
    const CtsModel *model = cts_frames_model(frames);
    const CtsPreset *preset = cts_frames_preset(frames);
    CtsReference *reference = NULL;
    CtsFrames *small = NULL;
    CtsFrameTask task = {.azimuth_deg = s.azimuth_deg, .elevation_deg = s.elevation_deg};
    double best = INFINITY, rms_255 = INFINITY;
    CtsStatus st = cts_frames_new(&small, model, preset, &s, err);
    if (!st)
        st = cts_reference_new(&reference, model, preset, &s, (size_t)s.width * (size_t)s.height, err);
    for (int samples = 0; !st && rms_255 > requested->max_error && samples <= MAX_SAMPLES;
         samples = samples ? 2 * samples : 2) {
        task.plan.samples = samples;
        st = try_samples(reference, small, &task, &rms_255, err);
        if (!st && rms_255 < best) {
            best = rms_255;
            plan->samples = samples;
        }
    }
    cts_reference_free(&reference);
    cts_frames_free(&small);
    if (!st)
        report_samples(&s, requested->max_error, plan->samples, best, report);
    return st;
}

CtsStatus cts_quality_search(CtsFrames *frames, const double view_deg[2], CtsPlan *plan, CtsReport *report,
                             CtsError *err)
{
    const CtsEngine *engine = cts_frames_engine(frames);
    CtsRenderSettings requested;
    CtsSceneStore store;
    CtsStatus st = cts_frames_view(frames, view_deg, &requested, report, err);
    if (st)
        return st;
    *plan = (CtsPlan){.samples = requested.samples, .max_error = requested.max_error, .level = requested.level};
    if (!(requested.max_error > 0) || requested.samples > 0 || engine->is_reference || engine->indicator)
        return CTS_OK;
    if ((st = cts_scene_init(&store, cts_frames_model(frames), cts_frames_preset(frames), &requested, err)) ||
        store.preset.mode != CTS_MODE_COMPOSITE)
        return st;
    requested.mm_per_pixel = store.scene.view.mm_per_pixel;
    return plan_samples(frames, &requested, plan, report, err);
}
