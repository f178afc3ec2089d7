/* Patches of a layer, CTS_PATCH voxels wide, like the volume's fine macro-cells, and within them cells, between 2 x 2
 * voxels of the layer: skipping is decided by patches, then by cells, stored as rows of bits.
 *
 * A cell's samples lie between its first and last lattice point, both included, so neighbours share an edge. The work
 * on a layer is divided into swaths of CTS_SWATH rows of patches; a swath owns the lattice rows from its first edge to
 * just before the next swath's, and the last swath its far edge too. */
#pragma once

#include "core/model/macrocells.h"
#include "engine/splat/footprint.h"
#include "engine/splat/stack.h"

enum { CTS_PATCH = CTS_FINE_MACROCELL, CTS_SWATH = 2, CTS_SWATH_CELLS = CTS_SWATH * CTS_PATCH };

typedef struct CtsPatches {
    int n[2];                     /* patches along u and v, at least 1 */
    int n_swaths;                 /* along v */
    int n_words;                  /* of a row of bits, one a patch */
    int n_cells[2], n_cell_words; /* likewise, a bit per cell or voxel */
    int row_cells;                /* rows of cells that are shown alike: 1 or CTS_PATCH */
    int last_voxel[2];
    int density[2];
} CtsPatches;

static inline CtsPatches cts_patches(const CtsStack *stack, const int density[2])
{
    CtsPatches patches;
    for (int c = 0; c < 2; c++) {
        patches.last_voxel[c] = stack->n[c] - 1;
        patches.n[c] = patches.last_voxel[c] > 0 ? (patches.last_voxel[c] + CTS_PATCH - 1) / CTS_PATCH : 1;
        patches.n_cells[c] = patches.last_voxel[c] > 0 ? patches.last_voxel[c] : 1;
        patches.density[c] = density[c];
    }
    patches.n_swaths = (patches.n[1] + CTS_SWATH - 1) / CTS_SWATH;
    patches.n_words = (patches.n[0] + 63) / 64;
    patches.n_cell_words = stack->n[0] / 64 + 1;
    return patches;
}

/* The first of a swath's rows on a grid of so many rows a voxel; a swath ends where the next one starts. */
static inline int cts_swath_start(const CtsPatches *patches, int swath, int density)
{
    return swath < patches->n_swaths ? swath * CTS_SWATH * CTS_PATCH * density : patches->last_voxel[1] * density + 1;
}

/* The first bit at or behind `from` that is set (or clear), n when there is none. */
static inline int cts_next_bit(const uint64_t *bits, int from, int n, bool set)
{
    for (int i = from; i < n; i = (i / 64 + 1) * 64) {
        const uint64_t word = (set ? bits[i / 64] : ~bits[i / 64]) >> (i & 63);
        if (word)
            return i + __builtin_ctzll(word) < n ? i + __builtin_ctzll(word) : n;
    }
    return n;
}

/* The next run of set bits in *from..n-1, in *from and *past; false when there is none. */
static inline bool cts_next_run(const uint64_t *bits, int n, int *from, int *past)
{
    *from = cts_next_bit(bits, *from, n, true);
    *past = cts_next_bit(bits, *from, n, false);
    return *from < n;
}
