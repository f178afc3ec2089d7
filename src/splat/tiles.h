/* Tiles of a layer, CTS_TILE voxels wide, as the volume's fine blocks are: what is skipped is skipped by tiles, kept
 * as rows of bits.
 *
 * A tile's samples lie between its first and last lattice point, both included, so neighbours share an edge. What a
 * layer needs is worked on in bands of CTS_BAND rows of tiles; a band owns the lattice rows from its first edge to just
 * before the next band's, and the last band its far edge too. */
#ifndef CTS_SPLAT_TILES_H
#define CTS_SPLAT_TILES_H

#include "splat/footprint.h"
#include "splat/stack.h"
#include "volume/blocks.h"

enum { CTS_TILE = CTS_FINE_BLOCK, CTS_BAND = 2 };

typedef struct CtsTiles {
    int n[2];    /* tiles along u and v, at least 1 */
    int n_bands; /* along v */
    int n_words; /* of a row of bits, one a tile */
    int last_voxel[2];
    int density[2];
} CtsTiles;

static inline CtsTiles cts_tiles(const CtsStack *stack, const int density[2])
{
    CtsTiles tiles;
    for (int c = 0; c < 2; c++) {
        tiles.last_voxel[c] = stack->n[c] - 1;
        tiles.n[c] = tiles.last_voxel[c] > 0 ? (tiles.last_voxel[c] + CTS_TILE - 1) / CTS_TILE : 1;
        tiles.density[c] = density[c];
    }
    tiles.n_bands = (tiles.n[1] + CTS_BAND - 1) / CTS_BAND;
    tiles.n_words = (tiles.n[0] + 63) / 64;
    return tiles;
}

/* The first of a band's rows on a grid of so many rows a voxel; a band ends where the next one starts. */
static inline int cts_band_start(const CtsTiles *tiles, int band, int density)
{
    return band < tiles->n_bands ? band * CTS_BAND * CTS_TILE * density : tiles->last_voxel[1] * density + 1;
}

/* The rows of tiles that row `at` of such a grid, of a power of two of rows, belongs to: one, or two on the edge
 * between them. */
static inline void cts_tile_rows(const CtsTiles *tiles, int at, int density, int *first, int *last)
{
    const int shift = __builtin_ctz((unsigned)(CTS_TILE * density)), row = at >> shift;
    *last = row < tiles->n[1] ? row : tiles->n[1] - 1;
    *first = row > 0 && at == row << shift ? row - 1 : *last;
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

#endif
