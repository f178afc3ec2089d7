/* --void key: the mixture of a volume, the key it proposes, and what that loses, told. */
#ifndef CTS_RENDER_KEY_H
#define CTS_RENDER_KEY_H

#include "ctsplat/mixture.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"

/* The report gets the plan and the loss: a warning, and a line of what is left out. */
CtsStatus cts_key_find(const CtsVolume *volume, const CtsPreset *preset, int n_threads, CtsVoidKey *key,
                       CtsReport *report, CtsError *err);

#endif
