#include "render/pilot.h"

#include "base/clock.h"
#include <math.h>
#include <stdio.h>

enum { RAYS = 4096, MOST_SAMPLES = 64, MOST_PLANS = 10, BANDS = 6, BAND_ROWS = CTS_BAND_ROWS / 2 };

/* An error on trial stands for one so much larger in the picture; bands of it and the upper end of an interval leave
 * less to chance. */
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
    s.want_depth = s.explain = false;
    return s;
}

static CtsStatus try_samples(const CtsReference *reference, const CtsVolume *volume, const CtsPreset *preset,
                             const CtsRenderSettings *s, double *rms_255, CtsError *err)
{
    CtsPicture *picture = NULL;
    CtsVerified verified;
    CtsStatus st = cts_render_on_trial(volume, preset, s, &picture, err);
    if (!st)
        st = cts_reference_compare(reference, picture, &verified, err);
    cts_picture_free(&picture);
    if (!st)
        *rms_255 = 255 * verified.rmse * MARGIN;
    return st;
}

CtsStatus cts_pilot_samples(const CtsVolume *volume, const CtsVolume *original, const CtsPreset *preset,
                            CtsRenderSettings *settings, CtsReport *report, CtsError *err)
{
    CtsReference *reference = NULL;
    CtsRenderSettings s = small_picture(settings);
    double best = INFINITY, rms_255 = INFINITY;
    CtsStatus st = cts_reference_new(&reference, original, preset, &s, (size_t)s.width * (size_t)s.height, err);
    /* First what the engine would do by itself. */
    for (s.samples = 0; !st && rms_255 > s.max_error && s.samples <= MOST_SAMPLES;
         s.samples = s.samples ? 2 * s.samples : 2) {
        st = try_samples(reference, volume, preset, &s, &rms_255, err);
        if (!st && rms_255 < best) {
            best = rms_255;
            settings->samples = s.samples;
        }
    }
    cts_reference_free(&reference);
    if (st)
        return st;
    char sheets[32] = "the engine's own plan errs";
    if (settings->samples > 0)
        snprintf(sheets, sizeof sheets, "%d sheets a layer err", settings->samples);
    if (best <= settings->max_error)
        cts_report_finding(report, "max_error", CTS_NOTE, "--max-error %g: %s by %.3g/255 rms on %d trial rays",
                           settings->max_error, sheets, best / MARGIN, s.width * s.height);
    else
        cts_report_finding(
            report, "max_error_missed", CTS_WARNING,
            "--max-error %g is not reached: %s by %.3g/255 rms on %d trial rays (engine raycast is exact)",
            settings->max_error, sheets, best / MARGIN, s.width * s.height);
    return CTS_OK;
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

CtsStatus cts_pilot_plan(const CtsScene *scene, CtsTrial trial, void *context, CtsRenderSettings *settings,
                         CtsReport *report, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms(), asked = settings->max_error;
    CtsVerify verify = {0};
    CtsVerified found = {0}, best = {.rmse_high = INFINITY};
    int first_rows[BANDS], n_rows;
    const int n_bands = place_bands(scene->view.height, first_rows, &n_rows);
    CtsStatus st = cts_verify_begin(&verify, scene, RAYS, err);
    /* An engine's word is worth more than it says in most scenes, less in some. */
    double plan = 2 * asked;
    for (int i = 0; !st && i < MOST_PLANS && !(255 * BANDS_MARGIN * best.rmse_high <= asked); i++, plan /= 2) {
        if ((st = trial(context, plan, first_rows, n_bands, n_rows, &verify, err)) ||
            (i == 0 && ((st = cts_verify_choose(&verify, err)) || (st = cts_verify_cast(&verify, err)))) ||
            (st = cts_verify_judge(&verify, &found, err)))
            break;
        if (found.rmse_high < best.rmse_high) {
            best = found;
            settings->max_error = plan;
        }
    }
    cts_verify_free(&verify);
    if (st)
        return st;
    const bool kept = 255 * BANDS_MARGIN * best.rmse_high <= asked;
    cts_report_finding(report, kept ? "max_error" : "max_error_missed", kept ? CTS_NOTE : CTS_WARNING,
                       "--max-error %g%s: the plan for %.3g/255 errs by %.3g/255 rms (95 %%: up to %.3g) on %d trial "
                       "rays%s",
                       asked, kept ? "" : " is not reached", settings->max_error, 255 * best.rmse, 255 * best.rmse_high,
                       (int)best.pixels, kept ? "" : " (engine raycast is exact)");
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, 0, 0);
    return CTS_OK;
}
