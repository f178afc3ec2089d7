/* --max-error by trial: the cheapest plan whose error on some rays of the same view stays below it. */
#ifndef CTS_RENDER_PILOT_H
#define CTS_RENDER_PILOT_H

#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "render/verify.h"

/* Sets settings->samples for settings->max_error; 0, the engine's own choice, where that will do. settings holds the
 * picture's real mm_per_pixel. volume is what the engine gets, original what it stands for. The report tells the error
 * found, and warns where no number of sub-sheets keeps it small enough. */
CtsStatus cts_pilot_samples(const CtsVolume *volume, const CtsVolume *original, const CtsPreset *preset,
                            CtsRenderSettings *settings, CtsReport *report, CtsError *err);

/* Renders rows of the picture with this max_error, taken at its word, and hands them to verify. */
typedef CtsStatus (*CtsTrial)(void *context, double max_error, const int *first_rows, int n_bands, int n_rows,
                              CtsVerify *verify, CtsError *err);

/* For an engine that makes its own plan of max_error: sets settings->max_error to the largest, and so the cheapest,
 * that keeps what was asked, by trial on some bands of the picture itself. scene is that of the picture, its volume the
 * original one. */
CtsStatus cts_pilot_plan(const CtsScene *scene, CtsTrial trial, void *context, CtsRenderSettings *settings,
                         CtsReport *report, CtsError *err);

/* cts_render() that leaves max_error to the engine. */
CtsStatus cts_render_on_trial(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                              CtsPicture **picture, CtsError *err);

#endif
