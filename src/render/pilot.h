/* --max-error by trial: the fewest sub-sheets whose error on a small picture of the same view stays below it. */
#ifndef CTS_RENDER_PILOT_H
#define CTS_RENDER_PILOT_H

#include "ctsplat/render.h"
#include "ctsplat/report.h"

/* Sets settings->samples for settings->max_error; 0, the engine's own choice, where that will do. settings holds the
 * picture's real mm_per_pixel. volume is what the engine gets, original what it stands for. The report tells the error
 * found, and warns where no number of sub-sheets keeps it small enough. */
CtsStatus cts_pilot_samples(const CtsVolume *volume, const CtsVolume *original, const CtsPreset *preset,
                            CtsRenderSettings *settings, CtsReport *report, CtsError *err);

/* cts_render() that leaves max_error to the engine. */
CtsStatus cts_render_on_trial(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                              CtsPicture **picture, CtsError *err);

#endif
