/* Parts of a preset that depend on the volume: a relative scale, a projection's window, and colours of vessel presets.
 */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/render.h"

/* Makes the preset one of the model's volume: resolves a relative scale (cts_preset_resolve()), and sets an empty
 * window for a projection: from the 5th percentile (rims of air are darker) to the 99th of the values in a small
 * picture of the same mode and view (and, for a rotation, of the view a quarter turn on). The report's plan has both.
 */
CtsStatus cts_fit_preset(const CtsModel *model, const CtsRenderSettings *settings, CtsPreset *preset, CtsReport *report,
                         CtsError *err);

/* For a preset that needs contrast agent: if by the mixture model the volume's blood contains none (*missing), the
 * preset gets the colours of `bone`, since bone is then the only visible tissue. */
CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err);
/* The warning `no_contrast`. */
void cts_contrast_report(const CtsPreset *preset, CtsReport *report);
