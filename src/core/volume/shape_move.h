/* The kernels of shape-based interpolation: displacements of blocks between two slices, and the pixels of a layer that
 * they affect. */
#pragma once

#include "base/simd_path.h"
#include "core/volume/shape_interpolation.h"

/* Distances are computed on blocks of 2 x 2 pixels, whose means have less noise: a quarter of the work. Their unit is a
 * twelfth of a block, so that a step to the side has 12. SHAPE_FAR: without a surface; twice that fits int16_t, and so
 * do sums with a step. */
enum { SHAPE_BLOCK = 2, SHAPE_SURFACES = 2, SHAPE_SIDE = 12, SHAPE_FAR = 16000 };

/* SHAPE_MOVES_FROM: a surface that moves by less than its own edge, a quarter of a block, is blended well.
 * SHAPE_GOES_WITH: factor of the displacement: pixels nearer to the surface are displaced with it, and none passes
 * another, as the transition back to zero is longer than the displacement. Measured (shape_interpolation.c): factors of
 * 1 to 6 change the error by less than 0.5 %. */
enum { SHAPE_MOVES_FROM = SHAPE_SIDE / 4, SHAPE_GOES_WITH = 3 };

/* Numbers of a displacement: x and y in the slice before, x and y in the slice behind, in pixels, and its weight. */
enum { SHAPE_NUMBERS = 5, SHAPE_SHARE = 4 };

/* Lanes of the widest vector. Kernels may read as many numbers beyond the last one of an array, of distances one
 * more. */
enum { SHAPE_LANES = 16 };

/* A block's place in arrays of all blocks, and which row of blocks it is in. */
typedef struct ShapeBlock {
    uint32_t at, row;
} ShapeBlock;

/* Listed blocks, in order. */
typedef struct ShapeBlocks {
    size_t n;
    ShapeBlock *items;
} ShapeBlocks;

/* One slice as blocks: grey levels, and the distance to each surface, positive inside; SHAPE_FAR: none. */
typedef struct ShapeField {
    uint16_t *grey;
    int16_t *distance[SHAPE_SURFACES];
} ShapeField;

/* A gap between two slices. */
typedef struct ShapeGap {
    const CtsShapeStack *stack;
    int n_blocks[2];
    ShapeField field[2];         /* of both slices */
    ShapeBlocks moving, written; /* those with displacements, and those whose pixels may change */
    /* Displacements at one layer, each number in an array of its own. Rows are n_blocks[0] + 2 entries: the first and
     * the last value twice. */
    float *move[SHAPE_NUMBERS];
    float edges; /* grey levels; difference of two edges half a pixel apart */
} ShapeGap;

/* A layer between the slices: `part` (0..1) of the distance behind the first one. Its grey levels are blended before
 * they are displaced. */
typedef struct ShapeLayer {
    const uint16_t *slices[2];
    uint16_t *grey;
    float part;
} ShapeLayer;

typedef struct ShapeSums {
    uint64_t n_voxels, n_moved, differences;
} ShapeSums;

/* Place of a block in arrays of displacements. */
static inline size_t shape_place(ShapeBlock b)
{
    return (size_t)b.at + 2 * (size_t)b.row + 1;
}

/* Distances of blocks from those in the same row, which had none shorter in other rows. columns: SHAPE_ROWS times
 * n_blocks[0]. */
enum { SHAPE_ROWS = 8 };
void cts_shape_reach_rows(int16_t *distance, const int n_blocks[2], int16_t *columns);

/* cts_shape_find_moves: the displacements of the moving blocks at one layer, with copies beyond the borders.
 * cts_shape_write_layer: the pixels of the written blocks. The same bytes on every SIMD path. */
typedef void (*cts_shape_find_fn)(const ShapeGap *gap, float part);
typedef void (*cts_shape_write_fn)(const ShapeGap *gap, const ShapeLayer *layer, ShapeSums *sums);
#define SHAPE_KERNELS(path)                                                                                            \
    void cts_shape_find_moves_##path(const ShapeGap *gap, float part);                                                 \
    void cts_shape_write_layer_##path(const ShapeGap *gap, const ShapeLayer *layer, ShapeSums *sums);
CTS_EACH_PATH(SHAPE_KERNELS)
