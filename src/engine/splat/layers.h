/* Inter-layer similarity: whether it pays, which patches did not change, and the dead band that --tolerance asks for.
 */
#ifndef CTS_SPLAT_LAYERS_H
#define CTS_SPLAT_LAYERS_H

#include "engine/splat/paper_plan.h"

typedef struct CtsChangeSample {
    uint64_t voxels, changed;
} CtsChangeSample;

/* Compare a few rows of a few layers with the one before them that their sheet was made of: how many of their voxels
 * changed, and how many would be splatted without reuse. */
CtsStatus cts_layers_sample(const CtsPaperPlan *plan, CtsChangeSample *sample, CtsError *err);

/* True when adding changes costs less than splatting anew. */
bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void);

/* The dead band: kept = fresh where they differ by more than tolerance, else the value splatted before, so that what
 * is splatted is never further off than that, however long it goes on. */
void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept);

CtsStatus cts_quiet_init(CtsQuiet *quiet, const CtsPatches *patches, CtsError *err);
void cts_quiet_free(CtsQuiet *quiet);

/* Bring a swath up to date with the voxels that changed in any of its rows, in those beside it that reach in, and in
 * that of its far edge: a bit for each voxel of a row; NULL: nothing is known of the past. */
void cts_quiet_swath(const CtsPaperPlan *plan, const CtsPaperStore *store, int step, int swath,
                     const uint64_t *changed);

/* Clear the bits of patches that show nothing on a step's sheet, nor between it and the sheet before. */
void cts_quiet_drop(const CtsPaperPlan *plan, int step, int swath, uint64_t *row);

#endif
