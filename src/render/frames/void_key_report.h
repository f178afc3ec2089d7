/* --void key: the mixture of a volume, its proposed key, and a report of the loss. */
#pragma once

#include "ctsplat/mixture.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"

typedef struct CtsFittedVoidKey {
    CtsMixture mixture;
    CtsVoidKey key;
} CtsFittedVoidKey;

CtsStatus cts_void_key_find(const CtsVolume *volume, const CtsPreset *preset, int n_threads, CtsFittedVoidKey *found,
                            CtsReport *report, CtsError *err);
/* Adds the plan and the loss to the report: a warning, and a skipped step. */
void cts_void_key_report(const CtsFittedVoidKey *found, const CtsPreset *preset, CtsReport *report);
