/* What a preset has from the volume: a window for a projection that nobody gave one, colours for vessels. */
#ifndef CTS_JOB_FIT_WINDOW_H
#define CTS_JOB_FIT_WINDOW_H

#include "ctsplat/preset.h"
#include "ctsplat/render.h"

/* A preset whose window is empty asks for one: in a small picture of the same mode from the same side (and, of a
 * rotation, from a quarter of a turn on) all but the lowest twentieth (which rims of air take) and the highest
 * hundredth of what is seen lies between black and white. Does nothing for a preset with a window, and in mode
 * composite. The report's plan tells the window. */
CtsStatus cts_fit_window(const CtsVolume *volume, const CtsRenderSettings *settings, CtsPreset *preset,
                         CtsReport *report, CtsError *err);

/* For a preset that needs contrast agent, and a volume whose blood carries none, by the mixture model (*missing): the
 * preset gets the colours of `bone`, as bone is what it shows then. All else is left alone. */
CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err);
/* The warning `no_contrast`. */
void cts_contrast_tell(const CtsPreset *preset, CtsReport *report);

#endif
