/* Tiles of a layer, CTS_TILE voxels wide: what is skipped is skipped by tiles.
 *
 * A tile's samples lie between its first and last lattice point, both included, so neighbours share an edge. Sheets
 * are therefore cut into segments: edges (even numbers: one lattice point wide) and what lies between two edges (odd).
 * Tile t of an axis needs segments 2t, 2t + 1 and 2t + 2. */
#ifndef CTS_SPLAT_TILES_H
#define CTS_SPLAT_TILES_H

#include "splat/footprint.h"
#include "splat/stack.h"

enum { CTS_TILE = 8 };

typedef struct CtsTiles {
    int n[2];          /* tiles along u and v, at least 1 */
    int n_segments[2]; /* 2 n + 1 */
    int last_voxel[2];
    int density[2];
} CtsTiles;

static inline CtsTiles cts_tiles(const CtsStack *stack, const int density[2])
{
    CtsTiles tiles;
    for (int c = 0; c < 2; c++) {
        tiles.last_voxel[c] = stack->n[c] - 1;
        tiles.n[c] = tiles.last_voxel[c] > 0 ? (tiles.last_voxel[c] + CTS_TILE - 1) / CTS_TILE : 1;
        tiles.n_segments[c] = 2 * tiles.n[c] + 1;
        tiles.density[c] = density[c];
    }
    return tiles;
}

/* First point of a segment on a grid of so many points a voxel; a segment ends where the next one starts. */
static inline int cts_segment_start(const CtsTiles *tiles, int axis, int segment, int density)
{
    const int voxel = segment / 2 * CTS_TILE, last = tiles->last_voxel[axis];
    if (segment > 2 * tiles->n[axis])
        return last * density + 1;
    const int edge = (voxel < last ? voxel : last) * density;
    if (!(segment & 1))
        return edge;
    const int next = voxel + CTS_TILE < last ? voxel + CTS_TILE : last;
    return edge + 1 < next * density ? edge + 1 : next * density;
}

#endif
