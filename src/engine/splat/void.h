/* What provably cannot be seen: the range of grey levels that a macro-cell's samples can take, from its voxels and
 * those around it that reach in, looked up in the transfer function. A patch without a visible level in its range is
 * left out; its samples would have had alpha 0, so the picture keeps its bytes.
 *
 * Ranges are those of the volume's fine macro-cells, so a patch is judged for the layers of a macro-cell at once; what
 * they leave is judged again, cell by cell, by the voxels of its own layer, where planes lie on layers alone
 * (swath.c). */
#ifndef CTS_SPLAT_VOID_H
#define CTS_SPLAT_VOID_H

#include "core/transfer/lut.h"
#include "engine/splat/patches.h"

/* How voxels become samples: what is needed to go from a range of voxels to one of samples. */
typedef struct CtsRangeRule {
    const CtsLut *lut;
    int apron;                  /* voxels around a patch that reach into it, fewer than CTS_PATCH */
    uint16_t slack;             /* voxels may stand for values so far from theirs */
    uint32_t sum_low, sum_high; /* of the footprint's phases */
} CtsRangeRule;

/* False when no mixture of the grey levels of the range shows anything. */
bool cts_range_visible(const CtsRangeRule *rule, CtsRange range);

/* No mixture of levels below this shows anything. */
uint16_t cts_range_least(const CtsRangeRule *rule);

static inline CtsRange cts_range_union(CtsRange a, CtsRange b)
{
    return (CtsRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

typedef struct CtsVoidMap {
    CtsPatches patches;
    int n_layers, n_macrocells;  /* macro-cells: one behind the other, across the layers */
    uint64_t *shows;             /* by macro-cell, row of patches: a bit for each patch that may show something */
    uint8_t *active;             /* by layer: 0 where nothing on it or beside it shows */
    uint64_t n_shown, n_patches; /* of all macro-cells */
} CtsVoidMap;

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsPatches *patches, const CtsRangeRule *rule,
                           const CtsMacrocells *macrocells, int n_threads, CtsError *err);
void cts_void_map_free(CtsVoidMap *map);

/* Set bits, leaving others as they are, for the patches of a row where the planes from layer a to its neighbour b
 * (a == b: that layer alone) may show something. */
void cts_void_add_row(const CtsVoidMap *map, int a, int b, int patch_v, uint64_t *row);
/* Clear bits of patches that show nothing from layer first to layer last. */
void cts_void_keep_rows(const CtsVoidMap *map, int first, int last, int patch_v, uint64_t *row);

#endif
