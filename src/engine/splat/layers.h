/* Inter-layer similarity: the test whether reuse pays, and the dead band of --tolerance. */
#pragma once

#include "engine/splat/paper_plan.h"

typedef struct CtsChangeSample {
    uint64_t voxels, changed;
} CtsChangeSample;

/* Compare a few rows of a few layers with the one before them that their sheet was made of: how many of their voxels
 * changed. */
CtsChangeSample cts_layers_sample(const CtsPaperPlan *plan);

/* True when adding changes costs less than splatting all voxels. */
bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void);

/* The dead band: kept = fresh where they differ by more than tolerance, else the value splatted before, so that the
 * splatted value always stays within tolerance. */
void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept);
