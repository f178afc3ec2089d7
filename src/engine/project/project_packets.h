/* Rays of the modes mip, minip and average, one by one and as packets. */
#pragma once

#include "base/simd_path.h"
#include "core/model/body_mask.h"
#include "core/model/macrocells.h"
#include "core/model/voxel_labels.h"
#include "core/scene/engine.h"
#include <stdint.h>

/* A ray of the modes mip, minip and average, and its visible intervals within one cell. */

typedef struct CtsProjector {
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    const CtsView *view;
    CtsMode mode;
    const CtsBodyMask *body;            /* the visible part; NULL: all */
    const CtsVoxelLabels *voxel_labels; /* with hidden labels; NULL: none are hidden */
    int n_cells[3];
    ptrdiff_t stride[3]; /* of voxels; 0 along an axis of one */
} CtsProjector;

/* A ray in voxel coordinates: start + t * step, t in mm, inside the box from t0 to t1. */
typedef struct CtsProjectedRay {
    double start[3], step[3], t0, t1;
} CtsProjectedRay;

/* The grey level at t0 of a ray without length, as at a corner of the box; infinite where nothing is visible. */
double cts_project_point(const CtsProjector *projector, const CtsProjectedRay *ray);

/* The visible intervals of a cell that the ray crosses from t = `from` to `to`: first[] to last[], in order; returns
 * their number. */
int cts_project_stretches(const CtsProjector *projector, const CtsProjectedRay *ray, const int cell[3], double from,
                          double to, double first[CTS_MAX_CELL_INTERVALS], double last[CTS_MAX_CELL_INTERVALS]);

/* The modes mip, minip and average by tiles: rows of eight pixels as packets of rays that cross the same layers of
 * cells together, the most promising layers first. */

enum { CTS_PROJECT_TILE = 8 }; /* pixels in each direction */

/* Cells of a fine macro-cell, bit i + 4 j + 16 k: those visible at least in part, and those visible completely. */
typedef struct CtsVisibleCells {
    uint64_t some, all;
} CtsVisibleCells;
enum { CTS_ALL_CELLS = -1, CTS_NO_CELL = -2 };

/* Parameters common to all tiles of a picture. */
typedef struct CtsProjection {
    CtsProjector projector;
    int axes[3]; /* of the volume: axes[2] is crossed layer by layer, as the ray advances fastest along it */
    const int32_t
        *visibility; /* of each fine macro-cell: CTS_ALL_CELLS, CTS_NO_CELL or a place in cells[]; NULL: all of all */
    const CtsVisibleCells *cells;
    double sign; /* 1: search for the largest level, -1: the smallest */
    /* levels times sign: smaller ones count as `least`, and larger ones than `enough` need not be distinguished */
    double least, enough;
} CtsProjection;

/* A layer of macro-cells, and a level times sign that no ray of the tile exceeds there. */
typedef struct CtsProjectedLayer {
    int32_t bound;
    int layer;
} CtsProjectedLayer;

/* grey[8 * row + column] of the tile that begins at (x, y) of the view, with this width and height in pixels: the
 * largest, smallest or mean level, infinite where nothing is visible; exact between `least` and `enough`. The same
 * numbers on every SIMD path. ranked: memory for n_fine[axes[2]] layers. */
typedef void (*cts_project_tile_fn)(const CtsProjection *projection, CtsProjectedLayer *ranked, int x, int y, int width,
                                    int height, double *grey);
#define PROJECT_TILE(path)                                                                                             \
    void cts_project_tile_##path(const CtsProjection *projection, CtsProjectedLayer *ranked, int x, int y, int width,  \
                                 int height, double *grey);
CTS_EACH_PATH(PROJECT_TILE)
