/* Inter-layer similarity: whether it pays, which patches did not change, and the dead band that --tolerance asks for.
 */
#ifndef CTS_SPLAT_LAYERS_H
#define CTS_SPLAT_LAYERS_H

#include "engine/splat/sheet.h"
#include "engine/splat/void.h"

typedef struct CtsChangeSample {
    uint64_t voxels, changed;
} CtsChangeSample;

/* Compare a few rows of a few layers with the layer `distance` before them. Where map is not NULL only in patches that
 * may show something. */
CtsStatus cts_layers_sample(const CtsStack *stack, const CtsVoidMap *map, int tolerance, int distance, int axis_sign,
                            CtsChangeSample *sample, CtsError *err);

/* True when adding changes costs less than splatting anew. */
bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void);

/* The dead band: kept = fresh where they differ by more than tolerance, else the value splatted before, so that what
 * is splatted is never further off than that, however long it goes on. */
void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept);

/* What earlier layers tell of a sheet's patches, one column of a swath taken together: a column that did not change
 * since then has the range of grey levels it had, so it need not be looked at again; and where nothing of that range
 * can be seen, its samples need not be taken. */
typedef struct CtsQuiet {
    CtsPatches patches;
    uint64_t *known; /* by swath, a bit for each column of patches */
    uint64_t *empty; /* likewise: known to show nothing */
    CtsRange *range; /* by swath and column, where known */
} CtsQuiet;

CtsStatus cts_quiet_init(CtsQuiet *quiet, const CtsPatches *patches, CtsError *err);
void cts_quiet_free(CtsQuiet *quiet);

/* Bring a swath up to date: rows against old_rows (NULL: nothing is known of the past). marks and changed are scratch
 * of a bit for each voxel of a row. */
typedef struct CtsQuietJob {
    const CtsSimd *simd;
    const CtsRangeRule *rule;
    CtsRowOf row_of;
    const void *rows, *old_rows;
    uint64_t *marks, *changed;
    int n[2];
} CtsQuietJob;

void cts_quiet_swath(CtsQuiet *quiet, const CtsQuietJob *job, int swath);

/* Clear the bits of patches that show nothing on either sheet, or between the two. */
void cts_quiet_drop(const CtsQuiet *here, const CtsQuiet *before, const CtsRangeRule *rule, int swath, uint64_t *row);

#endif
