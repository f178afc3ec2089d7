/* Provably invisible patches: the range of grey levels of a macro-cell's samples, from its voxels and those around it
 * that reach in, looked up in the transfer function. A patch without a visible level in its range is skipped; its
 * samples would have alpha 0, so the picture keeps its bytes.
 *
 * Ranges are those of the volume's fine macro-cells, so a patch is tested for all layers of a macro-cell at once; the
 * remainder is tested cell by cell with the voxels of its own layer, if planes coincide with layers (swath.c). */
#pragma once

#include "core/transfer/lut.h"
#include "engine/splat/patches.h"

/* The relation between voxels and samples: parameters to derive a range of samples from one of voxels. */
typedef struct CtsRangeRule {
    const CtsLut *lut;
    int apron;                  /* voxels around a patch that reach into it, fewer than CTS_PATCH */
    uint16_t slack;             /* voxels may differ from their splatted values by this */
    uint32_t sum_low, sum_high; /* of the footprint's phases */
} CtsRangeRule;

/* Mixtures of levels below this are invisible. */
uint16_t cts_range_least(const CtsRangeRule *rule);

typedef struct CtsVoidMap {
    CtsPatches patches;
    int n_layers, n_macrocells;  /* macro-cells: one behind the other, across the layers */
    uint64_t *shows;             /* by macro-cell, row of patches: a bit for each potentially visible patch */
    uint8_t *active;             /* by layer: 0 where it and its neighbours are invisible */
    uint64_t n_shown, n_patches; /* of all macro-cells */
} CtsVoidMap;

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsPatches *patches, const CtsRangeRule *rule,
                           const CtsMacrocells *macrocells, int n_threads, CtsError *err);

/* Sets bits, leaving others unchanged, for the patches of a row where the planes from layer a to its neighbour b (a ==
 * b: that layer alone) are potentially visible. */
void cts_void_add_row(const CtsVoidMap *map, int a, int b, int patch_v, uint64_t *row);
