/* What provably cannot be seen: the range of grey levels that a tile's samples can take, from its voxels and those
 * around it that reach in, looked up in the transfer function. A tile without a visible level in its range is left
 * out; its samples would have had alpha 0, so the picture keeps its bytes. */
#ifndef CTS_SPLAT_VOID_H
#define CTS_SPLAT_VOID_H

#include "splat/kernels.h"
#include "splat/tiles.h"
#include "transfer/lut.h"
#include <stdbool.h>

typedef struct CtsTileRange {
    uint16_t low, high;
} CtsTileRange;

/* How voxels become samples: what is needed to go from a range of voxels to one of samples. */
typedef struct CtsRangeRule {
    const CtsLut *lut;
    int apron;                  /* voxels around a tile that reach into it */
    uint16_t outside;           /* what voxels outside the volume count as */
    uint16_t slack;             /* voxels may stand for values so far from theirs */
    uint32_t sum_low, sum_high; /* of the footprint's phases */
    const uint16_t *level;      /* grey levels that stand for others, by grey level; NULL: themselves */
} CtsRangeRule;

/* False when no mixture of the grey levels of the ranges shows anything. */
bool cts_range_visible(const CtsRangeRule *rule, CtsTileRange range);

static inline CtsTileRange cts_range_union(CtsTileRange a, CtsTileRange b)
{
    return (CtsTileRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

/* The range of one tile's voxels and apron in a layer given by its rows (after `level`). */
CtsTileRange cts_tile_range(const CtsTiles *tiles, const CtsRangeRule *rule, int tile_u, int tile_v,
                            const uint16_t *(*row_of)(const void *context, int v), const void *rows);

/* Ranges of all tiles of all layers, and the box of tiles that each layer needs. */
typedef struct CtsVoidMap {
    CtsTiles tiles;
    CtsRangeRule rule;
    bool slabs;          /* planes between layers are sampled too */
    CtsTileRange *range; /* by layer, tile row, tile */
    uint8_t *shows; /* likewise: 1 where the layer, or with slabs what lies between it and the next of the volume, may
                     * show something */
    int (*box)[4];  /* by layer: first tile of u and v, one past the last; empty: [2] is 0 */
} CtsVoidMap;

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsTiles *tiles, const CtsRangeRule *rule,
                           const CtsKernels *kernels, bool slabs, int n_threads, CtsError *err);
void cts_void_map_free(CtsVoidMap *map);

/* A byte for each tile of a row: 1 where the planes from layer a to its neighbour b (a == b: that layer) may show
 * something. */
static inline const uint8_t *cts_void_row(const CtsVoidMap *map, int a, int b, int tile_v)
{
    const int layer = map->slabs && b < a ? b : a;
    return map->shows + ((size_t)layer * (size_t)map->tiles.n[1] + (size_t)tile_v) * (size_t)map->tiles.n[0];
}

#endif
