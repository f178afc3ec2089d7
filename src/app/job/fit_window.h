/* A window for a projection that nobody gave one. */
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

#endif
