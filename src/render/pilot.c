#include "render/pilot.h"

#include "base/clock.h"
#include <math.h>
#include <stdio.h>

enum { RAYS = 4096, MOST_SAMPLES = 64, MOST_PLANS = 10, BANDS = 6, BAND_ROWS = CTS_BAND_ROWS / 2 };

/* What is found on trial must stay below the error asked for by this factor, since the whole picture may err more than
 * the part that was tried. Less is left to chance where bands of the picture itself are tried and the upper end of the
 * error's interval is taken. */
#define MARGIN 1.25
#define BANDS_MARGIN 1.1

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

static void tell_samples(const CtsRenderSettings *small, double asked, int samples, double best, CtsReport *report)
{
    char sheets[32] = "the engine's own plan errs";
    if (samples > 0)
        snprintf(sheets, sizeof sheets, "%d sheets a layer err", samples);
    if (best <= asked)
        cts_report_finding(report, "max_error", CTS_NOTE, "`max_error` %g: %s by %.3g/255 rms on %d trial rays", asked,
                           sheets, best / MARGIN, small->width * small->height);
    else
        cts_report_finding(
            report, "max_error_missed", CTS_WARNING,
            "`max_error` %g is not reached: %s by %.3g/255 rms on %d trial rays (engine raycast is exact)", asked,
            sheets, best / MARGIN, small->width * small->height);
}

/* How many samples a layer: first what the engine would do by itself, then 2, 4, 8 and so on. */
static CtsStatus plan_samples(const CtsFrames *frames, const CtsRenderSettings *asked, CtsPlan *plan, CtsReport *report,
                              CtsError *err)
{
    const CtsRenderSettings s = small_picture(asked);
    const CtsVolume *volume = cts_frames_volume(frames);
    const CtsPreset *preset = cts_frames_preset(frames);
    CtsReference *reference = NULL;
    CtsFrames *small = NULL;
    CtsFrameTask task = {.azimuth_deg = s.azimuth_deg, .elevation_deg = s.elevation_deg};
    double best = INFINITY, rms_255 = INFINITY;
    CtsStatus st = cts_frames_new(&small, volume, preset, &s, err);
    if (!st)
        st = cts_reference_new(&reference, volume, preset, &s, (size_t)s.width * (size_t)s.height, err);
    for (int samples = 0; !st && rms_255 > asked->max_error && samples <= MOST_SAMPLES;
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
        tell_samples(&s, asked->max_error, plan->samples, best, report);
    return st;
}

/* Bands spread over the picture, or all of a small one. Returns how many. */
static int place_bands(int height, int first_rows[BANDS], int *n_rows)
{
    if (height <= 2 * BANDS * BAND_ROWS) {
        first_rows[0] = 0;
        *n_rows = height;
        return 1;
    }
    for (int i = 0; i < BANDS; i++)
        first_rows[i] = (int)((2 * i + 1) * (int64_t)height / (2 * BANDS * BAND_ROWS)) * BAND_ROWS;
    *n_rows = BAND_ROWS;
    return BANDS;
}

/* Renders these bands by a plan, and hands them to verify. Nothing is told. */
typedef struct Trial {
    CtsFrames *frames;
    CtsFrameTask task;
    int first_rows[BANDS], n_bands, n_rows;
} Trial;

static CtsStatus try_plan(const Trial *trial, CtsVerify *verify, CtsError *err)
{
    CtsFrame frame;
    CtsStatus st = cts_frame_begin(&frame, trial->frames, &trial->task, NULL, err);
    for (int i = 0; i < trial->n_bands && !st; i++) {
        CtsPicture *band = NULL;
        if (!(st = cts_frame_rows(&frame, trial->first_rows[i], trial->n_rows, &band, NULL, err)))
            cts_verify_take(verify, band);
        cts_picture_free(&band);
    }
    return cts_frame_end(&frame, st, NULL, err);
}

static void tell_plan(double asked, double plan, const CtsVerified *best, CtsReport *report)
{
    const bool kept = 255 * BANDS_MARGIN * best->rmse_high <= asked;
    cts_report_finding(report, kept ? "max_error" : "max_error_missed", kept ? CTS_NOTE : CTS_WARNING,
                       "`max_error` %g%s: the plan for %.3g/255 errs by %.3g/255 rms (95 %%: up to %.3g) on %d trial "
                       "rays%s",
                       asked, kept ? "" : " is not reached", plan, 255 * best->rmse, 255 * best->rmse_high,
                       (int)best->pixels, kept ? "" : " (engine raycast is exact)");
}

/* The max_error that the engine is to plan by. scene is that of the picture, its volume the one before quantising. */
static CtsStatus plan_by_error(CtsFrames *frames, const CtsScene *scene, CtsPlan *plan, CtsReport *report,
                               CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms(), asked = scene->settings->max_error;
    CtsVerify verify = {0};
    CtsVerified found = {0}, best = {.rmse_high = INFINITY};
    Trial trial = {.frames = frames,
                   .task = {.azimuth_deg = scene->view.azimuth_deg, .elevation_deg = scene->view.elevation_deg}};
    trial.n_bands = place_bands(scene->view.height, trial.first_rows, &trial.n_rows);
    CtsStatus st = cts_verify_begin(&verify, scene, RAYS, err);
    /* An engine's word is worth more than it says in most scenes, less in some. */
    trial.task.plan.max_error = 2 * asked;
    for (int i = 0; !st && i < MOST_PLANS && !(255 * BANDS_MARGIN * best.rmse_high <= asked); i++) {
        if ((st = try_plan(&trial, &verify, err)) ||
            (i == 0 && ((st = cts_verify_choose(&verify, err)) || (st = cts_verify_cast(&verify, err)))) ||
            (st = cts_verify_judge(&verify, &found, err)))
            break;
        if (found.rmse_high < best.rmse_high) {
            best = found;
            plan->max_error = trial.task.plan.max_error;
        }
        trial.task.plan.max_error /= 2;
    }
    cts_verify_free(&verify);
    if (st)
        return st;
    tell_plan(asked, plan->max_error, &best, report);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, 0, 0);
    return CTS_OK;
}

CtsStatus cts_pilot_plan(CtsFrames *frames, const double view_deg[2], CtsPlan *plan, CtsReport *report, CtsError *err)
{
    const CtsEngine *engine = cts_frames_engine(frames);
    CtsRenderSettings asked;
    CtsSceneStore store;
    CtsStatus st = cts_frames_view(frames, view_deg, &asked, report, err);
    if (st)
        return st;
    *plan = (CtsPlan){.samples = asked.samples, .max_error = asked.max_error};
    if (!(asked.max_error > 0) || asked.samples > 0 || engine->exact)
        return CTS_OK;
    if ((st = cts_scene_init(&store, cts_frames_volume(frames), cts_frames_preset(frames), &asked, err)) ||
        store.preset.mode != CTS_MODE_COMPOSITE)
        return st;
    asked.mm_per_pixel = store.scene.view.mm_per_pixel;
    return engine->plans_by_error ? plan_by_error(frames, &store.scene, plan, report, err)
                                  : plan_samples(frames, &asked, plan, report, err);
}
