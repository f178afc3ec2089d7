/* --void key: the mixture of a volume, the key it proposes, and what that loses, told. */
#ifndef CTS_RENDER_KEY_H
#define CTS_RENDER_KEY_H

#include "ctsplat/mixture.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"

typedef struct CtsFoundKey {
    CtsMixture mixture;
    CtsVoidKey key;
} CtsFoundKey;

CtsStatus cts_key_find(const CtsVolume *volume, const CtsPreset *preset, int n_threads, CtsFoundKey *found,
                       CtsReport *report, CtsError *err);
/* The report gets the plan and the loss: a warning, and a line of what is left out. */
void cts_key_tell(const CtsFoundKey *found, const CtsPreset *preset, CtsReport *report);

#endif
