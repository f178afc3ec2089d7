/* A sheet: one layer reconstructed on its lattice in 32-bit integers, CTS_WEIGHT_ONE times the grey level. */
#ifndef CTS_SPLAT_SHEET_H
#define CTS_SPLAT_SHEET_H

#include "splat/kernels.h"
#include "splat/tiles.h"

typedef struct CtsSheet {
    uint32_t *block;
    uint32_t *origin; /* lattice point (0, 0) */
    size_t stride;
    int last[2];
    int step;       /* in the order of rays, of the layer whose values it holds, or -1 */
    uint8_t *holds; /* by segment of v, then of u: 1 where it holds them */
} CtsSheet;

CtsStatus cts_sheet_init(CtsSheet *sheet, const CtsTiles *tiles, CtsError *err);
void cts_sheet_free(CtsSheet *sheet);

/* A block of a sheet to bring up to date: rows v0..v1-1, columns u0..u1-1 of the lattice. */
typedef struct CtsPatch {
    int u0, u1, v0, v1;
    bool from_old;   /* it holds the old rows' layer: add changes only; else start from base */
    bool skip_equal; /* leave out voxels that equal base (with from_old, voxels that did not change always are) */
} CtsPatch;

/* Rows of grey levels of the layer and of the one that the sheet holds: row(context, v). */
typedef const uint16_t *(*CtsRowOf)(const void *context, int v);

typedef struct CtsSplat {
    const CtsKernels *kernels;
    const CtsFootprint *footprint;
    const CtsSheet *sheet;
    const void *rows, *old_rows;
    CtsRowOf row_of;
    uint32_t base;
    int n[2];        /* voxels along u and v */
    uint64_t *marks; /* scratch of n[0] bits, rounded up to whole words */
} CtsSplat;

/* Voxels that stand in the patch, and those of them whose footprint was added. Voxels beside it that reach into it are
 * not counted, so that patches side by side count each voxel once. */
typedef struct CtsSplatCount {
    uint64_t inside, splatted;
} CtsSplatCount;

CtsSplatCount cts_splat_patch(const CtsSplat *splat, const CtsPatch *patch);

#endif
