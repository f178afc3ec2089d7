/* Inter-layer similarity: whether it pays, which tiles did not change, and the dead band that --tolerance asks for. */
#ifndef CTS_SPLAT_LAYERS_H
#define CTS_SPLAT_LAYERS_H

#include "splat/sheet.h"
#include "splat/void.h"

typedef struct CtsChangeSample {
    uint64_t voxels, changed;
} CtsChangeSample;

/* Compare one voxel row in eight of one layer in eight with the layer `distance` before it. Where map is not NULL only
 * in tiles that it needs. */
CtsChangeSample cts_layers_sample(const CtsStack *stack, const CtsTiles *tiles, const CtsVoidMap *map,
                                  const uint16_t *level, int tolerance, int distance, int axis_sign);

/* True when adding changes costs less than splatting anew. */
bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint);

/* The dead band: kept = fresh where they differ by more than tolerance, else the value splatted before, so that what
 * is splatted is never further off than that, however long it goes on. level (may be NULL) comes first. */
void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, const uint16_t *level, int tolerance, int n,
                       uint16_t *kept);

/* What is known of a sheet's tiles from the layers before: the range of one that did not change need not be looked at
 * again, and if nothing of it can be seen its samples need not be taken. */
typedef struct CtsQuiet {
    bool known;
    CtsTileRange range;
} CtsQuiet;

/* Bring one row of tiles up to date: rows against old_rows (NULL: nothing is known of the past). marks and changed are
 * scratch of a bit for each voxel of a row. */
typedef struct CtsQuietRow {
    const CtsKernels *kernels;
    const CtsTiles *tiles;
    const CtsRangeRule *rule;
    CtsRowOf row_of;
    const void *rows, *old_rows;
    uint64_t *marks, *changed;
    int n[2];
} CtsQuietRow;

void cts_layers_quiet(const CtsQuietRow *job, int tile_v, CtsQuiet *quiet);

#endif
