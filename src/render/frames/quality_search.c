/* --max-error by trial: the cheapest plan whose error on some rays of the same view stays below it. */
#include "render/engines/engines.h"
#include "render/frames/frames.h"
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
static CtsStatus try_samples(const CtsReference *reference, CtsRenderer *small, double *rms_255, CtsError *err)
{
    CtsPicture *picture = NULL;
    CtsVerified verified;
    CtsStatus st =
        cts_render_frame(small, small->settings.azimuth_deg, small->settings.elevation_deg, &picture, NULL, err);
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
static CtsStatus plan_samples(CtsRenderer *r, const CtsRenderSettings *requested, CtsReport *report, CtsError *err)
{
    const CtsRenderSettings s = small_picture(requested);
    CtsReference *reference = NULL;
    CtsRenderer *small = NULL;
    double best = INFINITY, rms_255 = INFINITY;
    CtsStatus st = cts_render_begin(&small, r->original, &r->preset, &s, err);
    if (!st)
        st = cts_reference_new(&reference, r->original, &r->preset, &s, (size_t)s.width * (size_t)s.height, err);
    for (int samples = 0; !st && rms_255 > requested->max_error && samples <= MAX_SAMPLES;
         samples = samples ? 2 * samples : 2) {
        small->plan.samples = samples;
        small->is_planned = true;
        st = try_samples(reference, small, &rms_255, err);
        if (!st && rms_255 < best) {
            best = rms_255;
            r->plan.samples = samples;
        }
    }
    cts_reference_free(&reference);
    cts_render_end(&small);
    if (!st)
        report_samples(&s, requested->max_error, r->plan.samples, best, report);
    return st;
}

CtsStatus cts_quality_search(CtsRenderer *r, const double view_deg[2], CtsReport *report, CtsError *err)
{
    CtsRenderSettings requested;
    CtsSceneStore store;
    CtsStatus st = cts_frames_view(r, view_deg, &requested, report, err);
    if (st)
        return st;
    r->plan = (CtsPlan){.samples = requested.samples, .max_error = requested.max_error, .level = requested.level};
    if (!(requested.max_error > 0) || requested.samples > 0 || r->engine->is_reference || r->engine->indicator)
        return CTS_OK;
    if ((st = cts_scene_init(&store, r->original, &r->preset, &requested, err)) ||
        store.preset.mode != CTS_MODE_COMPOSITE)
        return st;
    requested.mm_per_pixel = store.scene.view.mm_per_pixel;
    return plan_samples(r, &requested, report, err);
}
