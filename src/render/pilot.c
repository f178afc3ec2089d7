#include "render/pilot.h"

#include "ctsplat/reference.h"
#include <math.h>
#include <stdio.h>

enum { RAYS = 4096, MOST_SAMPLES = 64 };

/* An error on trial stands for one so much larger in the picture. */
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
