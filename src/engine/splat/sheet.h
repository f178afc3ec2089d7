/* A sheet: one layer reconstructed on its lattice in 32-bit integers, CTS_WEIGHT_ONE times the grey level. */
#ifndef CTS_SPLAT_SHEET_H
#define CTS_SPLAT_SHEET_H

#include "engine/splat/patches.h"
#include "engine/splat/simd.h"

typedef struct CtsSheet {
    uint32_t *memory;
    uint32_t *origin; /* lattice point (0, 0) */
    size_t stride;
    int last[2];
    int step;        /* in the order of rays, of the layer whose values it holds, or -1 */
    uint64_t *holds; /* by swath, a bit for each column of patches: where it holds them, if layers are reused */
} CtsSheet;

CtsStatus cts_sheet_init(CtsSheet *sheet, const CtsPatches *patches, CtsError *err);
void cts_sheet_free(CtsSheet *sheet);

/* Rows of grey levels of the layer and of the one that the sheet holds: row(context, v). */
typedef const uint16_t *(*CtsRowOf)(const void *context, int v);

typedef struct CtsSplat {
    const CtsSimd *simd;
    const CtsFootprint *footprint;
    const CtsSheet *sheet;
    const CtsPatches *patches;
    const void *rows, *old_rows; /* old_rows NULL: the sheet holds nothing */
    const void *next_rows;       /* of the layer that comes next; may be NULL */
    CtsRowOf row_of;
    uint32_t base;          /* the level that fresh sheets start from */
    int n[2];               /* voxels along u and v */
    bool reuse;             /* add changes where the sheet holds the old layer; keep account of what it holds */
    const uint64_t *needed; /* rows of bits: the patches to bring up to date, for CTS_NEEDED_ROWS rows from
                             * CTS_SWATH * swath - 1 on; with reuse they are all alike */
    uint64_t *row, *marks;  /* scratch: a row of bits; a bit for each voxel of a row, in whole words */
} CtsSplat;

enum { CTS_NEEDED_ROWS = CTS_SWATH + 2 }; /* a swath's rows of patches, and those at either side */

/* Voxels that stand in what is needed of the swath, left as they were or with their footprint added. Voxels beside it
 * that reach in are not counted where they stand in another swath, so that swaths count each voxel once. */
typedef struct CtsSplatCount {
    uint64_t reused, splatted;
} CtsSplatCount;

/* Bring a swath's lattice rows up to date wherever a needed patch has points in them, with far_edge those that it
 * shares with the next swath too. Other points hold anything. */
CtsSplatCount cts_splat_swath(const CtsSplat *splat, int swath, bool far_edge);

/* The patches of rows first..last, of those in splat->needed, that any of them needs. */
static inline void cts_needed_rows(const CtsPatches *patches, const uint64_t *needed, int swath, int first, int last,
                                   uint64_t *row)
{
    const size_t n_words = (size_t)patches->n_words;
    const uint64_t *from = needed + (size_t)(first - (CTS_SWATH * swath - 1)) * n_words;
    for (size_t w = 0; w < n_words; w++) {
        row[w] = from[w];
        for (int r = 1; r <= last - first; r++)
            row[w] |= from[(size_t)r * n_words + w];
    }
}

#endif
