/* The hot loops of the paper's engines, one instruction set a struct. All are exact: integers, or float32 in one fixed
 * order without fused operations, so that the choice never changes a bit of a picture. */
#pragma once

#include "base/cpu.h"
#include "core/scene/openness.h"
#include "core/scene/shade.h"
#include "engine/splat/footprint.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CTS_SHEET_MARGIN = 2 * CTS_MAX_TAPS }; /* lattice points beside a sheet row that the loops may access */

/* A smaller transmittance counts as 0: an eighth of a step of a 16-bit picture. */
#define CTS_OPAQUE_BELOW 0x1p-19f

/* Destination of footprints: sheet is the lattice row of tap row tap0 at the column of voxel 0's first tap. Arithmetic
 * is modulo 2^32. Values added are value[i] - old[i], or value[i] where old is NULL. */
typedef struct CtsScatter {
    const CtsFootprint *footprint;
    uint32_t *sheet;
    size_t stride;
    int tap0, tap1; /* rows of taps tap0..tap1-1 */
    const uint16_t *value, *old;
} CtsScatter;

/* Lattice positions of a picture row's samples: cell and fraction along u and v, for each pixel. Cells are monotone
 * along the row. horizontal: all have the same position along v, given once. */
typedef struct CtsPlaces {
    const int32_t *cell[2];
    const float *frac[2];
    bool horizontal;
} CtsPlaces;

/* Bits for the pixels of a picture's row: words first..past-1, the others are ignored. */
typedef struct CtsRowMarks {
    uint64_t *bits;
    int first, past;
} CtsRowMarks;

/* One layer, or a plane between two: sheets at lattice point (0, 0); second is NULL on a layer. */
typedef struct CtsSheetPair {
    const uint32_t *first, *second;
    size_t stride;
    float weight; /* of the second */
    int top;      /* the largest grey level of a sample */
} CtsSheetPair;

/* Transfer function for one layer's length of ray: entry[grey] is red, green, blue times alpha, and -alpha. Grey
 * levels outside low..high have alpha 0; those above top are sampled as top, whose entry they would have. */
typedef struct CtsEntries {
    float (*entry)[4];
    uint16_t low, high, top;
} CtsEntries;

/* Gradients at the voxels of one layer or two, four floats a voxel (the fourth is 0). */
typedef struct CtsLight {
    const CtsShade *shade;
    const float (*first)[4], (*second)[4];
    size_t stride;           /* voxels from row to row */
    float weight;            /* of the second */
    int shift[2];            /* log2 of the lattice's density */
    const CtsOpenness *open; /* NULL: light reaches everywhere */
    int axis[3];             /* volume axes along u, along v and across the layers */
    double layer;            /* the plane's coordinate across the layers */
} CtsLight;

/* Input for the gradients of a row of voxels: the row itself, n long, and the rows before and after it along v [0] and
 * across the layers [1]. scale equalises all differences: 1 where before and after are two voxels apart, 2 where they
 * are one apart, at a border without air beyond (with a single layer, both are the row itself). */
typedef struct CtsGradientRows {
    const uint16_t *row, *before[2], *after[2];
    float scale[2];
    int n;
    bool air_beyond; /* before and behind the row is air; else its ends have one-sided differences, doubled */
} CtsGradientRows;

typedef struct CtsSimd {
    /* Adds the footprints of those of n voxels whose bit in marks is set (bit i & 63 of word i / 64; none past n).
     * Accesses up to CTS_MAX_TAPS columns right of a footprint, without changing them. */
    void (*scatter)(const CtsScatter *job, const uint64_t *marks, int n);
    /* Marks those of the wanted voxels (NULL: all) that differ from old[i] or, with old NULL, are `least` or more:
     * whole words, bits past n are 0. */
    void (*mark)(const uint16_t *value, const uint16_t *old, uint16_t least, int n, const uint64_t *wanted,
                 uint64_t *marks);
    /* Lattice cell and fraction of pixels x0..x0+n-1: position base + by_x * x, clamped to 0..last. May write any
     * values up to the next multiple of 8. */
    void (*place)(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac);
    /* Nearest grey levels of marked samples, bilinear, in groups of eight pixels, which it may sample completely. Only
     * potentially visible ones stay marked. Returns the approximate number of groups. */
    uint64_t (*sample)(const CtsSheetPair *sheets, const CtsPlaces *places, const CtsEntries *entries,
                       const CtsRowMarks *marks, uint16_t *grey);
    /* Blends marked samples, lit unless light is NULL, under a row of pixels of red, green, blue and transmittance.
     * Sets bits in closed (unless NULL), in the same words, for pixels that become opaque. */
    void (*blend)(float *pixels, const uint16_t *grey, const CtsRowMarks *marks, const CtsEntries *entries,
                  const CtsPlaces *places, const CtsLight *light, uint64_t *closed);
    /* Gradients of voxels i0..i1-1: differences along the row, along v and across the layers, and 0. */
    void (*gradient)(const CtsGradientRows *rows, int i0, int i1, float (*gradient)[4]);
} CtsSimd;

extern const CtsSimd cts_simd_plain, cts_simd_avx2;

/* cpu: CPU flags that may be used. */
static inline const CtsSimd *cts_simd_choice(unsigned cpu)
{
    return cpu & CTS_CPU_AVX2 ? &cts_simd_avx2 : &cts_simd_plain;
}
