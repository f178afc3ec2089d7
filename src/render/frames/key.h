/* --void key: the mixture of a volume, its proposed key, and a report of the loss. */
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
/* Adds the plan and the loss to the report: a warning, and a skipped step. */
void cts_key_tell(const CtsFoundKey *found, const CtsPreset *preset, CtsReport *report);

#endif
