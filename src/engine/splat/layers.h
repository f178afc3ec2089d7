/* Inter-layer similarity: whether it pays, and the dead band that --tolerance asks for. */
#ifndef CTS_SPLAT_LAYERS_H
#define CTS_SPLAT_LAYERS_H

#include "engine/splat/paper_plan.h"

typedef struct CtsChangeSample {
    uint64_t voxels, changed;
} CtsChangeSample;

/* Compare a few rows of a few layers with the one before them that their sheet was made of: how many of their voxels
 * changed. */
CtsChangeSample cts_layers_sample(const CtsPaperPlan *plan);

/* True when adding changes costs less than splatting anew. */
bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void);

/* The dead band: kept = fresh where they differ by more than tolerance, else the value splatted before, so that what
 * is splatted is never further off than that, however long it goes on. */
void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept);

#endif
