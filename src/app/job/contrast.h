/* A preset for vessels needs contrast agent to tell them by. */
#ifndef CTS_JOB_CONTRAST_H
#define CTS_JOB_CONTRAST_H

#include "ctsplat/preset.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"

/* For a preset that needs contrast agent, and a volume whose blood carries none, by the mixture model (*missing): the
 * preset gets the colours of `bone`, as bone is what it shows then. All else is left alone. */
CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err);
/* The warning `no_contrast`. */
void cts_contrast_tell(const CtsPreset *preset, CtsReport *report);

#endif
