/* The hot loops of the paper's engines, one instruction set a struct. All are exact: integers, or float32 in one fixed
 * order without fused operations, so that the choice never changes a bit of a picture. */
#ifndef CTS_SPLAT_LOOPS_H
#define CTS_SPLAT_LOOPS_H

#include "base/cpu.h"
#include "core/scene/shade.h"
#include "engine/splat/footprint.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CTS_SHEET_MARGIN = 2 * CTS_MAX_TAPS }; /* lattice points beside a sheet row that the loops may touch */

/* Below this a ray's transmittance counts as 0: what is left is an eighth of a step of a 16-bit picture. */
#define CTS_OPAQUE_BELOW 0x1p-19f

/* Where footprints go: sheet is the lattice row of tap row tap0 at the column of voxel 0's first tap. Arithmetic is
 * modulo 2^32. Values added are value[i] - old[i], or value[i] where old is NULL. */
typedef struct CtsScatter {
    const CtsFootprint *footprint;
    uint32_t *sheet;
    size_t stride;
    int tap0, tap1; /* rows of taps tap0..tap1-1 */
    const uint16_t *value, *old;
} CtsScatter;

/* Where a picture row's samples fall on the lattice: cell and fraction along u and v, for each pixel. Cells never fall,
 * or never rise, from pixel to pixel. level: all have the same place along v, given once. */
typedef struct CtsPlaces {
    const int32_t *cell[2];
    const float *frac[2];
    bool level;
} CtsPlaces;

/* Bits for the pixels of a picture's row: words first..past-1, the others are not looked at. */
typedef struct CtsRowMarks {
    uint64_t *bits;
    int first, past;
} CtsRowMarks;

/* One layer, or a plane between two: sheets at lattice point (0, 0); second is NULL on a layer. */
typedef struct CtsSheetPair {
    const uint32_t *first, *second;
    size_t stride;
    float weight; /* of the second */
    int top;      /* the largest level of a sample */
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
    size_t stride; /* voxels from row to row */
    float weight;  /* of the second */
    int shift[2];  /* log2 of the lattice's density */
} CtsLight;

/* What the gradients of a row of voxels are made of: the row itself, n long, and the rows before and after it along v
 * [0] and across the layers [1]. scale makes all differences alike: 1 where before and after lie two voxels apart, 2
 * where they lie one apart, at a border beyond which is no air (and where there is one layer, both are the row itself).
 */
typedef struct CtsGradientRows {
    const uint16_t *row, *before[2], *after[2];
    float scale[2];
    int n;
    bool air_beyond; /* before and behind the row is air; else its ends have one-sided differences, doubled */
} CtsGradientRows;

typedef struct CtsSimd {
    /* Add the footprints of those of n voxels whose bit in marks is set (bit i & 63 of word i / 64; none past n).
     * Touches up to CTS_MAX_TAPS columns right of a footprint, unchanged. */
    void (*scatter)(const CtsScatter *job, const uint64_t *marks, int n);
    /* Set bit i where value[i] differs from old[i]; whole words, bits past n are 0. */
    void (*differ)(const uint16_t *value, const uint16_t *old, int n, uint64_t *marks);
    /* Of the wanted ones those that are at least so much. */
    void (*reach)(const uint16_t *value, uint16_t least, int n, const uint64_t *wanted, uint64_t *marks);
    /* Lattice cell and fraction of pixels x0..x0+n-1: position base + by_x * x, held within 0..last. May write what
     * it likes up to the next multiple of 8. */
    void (*place)(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac);
    /* Nearest grey levels of marked samples, bilinear, by eights of pixels, each of which it may sample whole. Only
     * what may show stays marked. Returns about how many eights there were. */
    uint64_t (*sample)(const CtsSheetPair *sheets, const CtsPlaces *places, const CtsEntries *entries,
                       const CtsRowMarks *marks, uint16_t *grey);
    /* Blend marked samples, unlit, under a row of pixels of red, green, blue and transmittance. Bits are set in closed
     * (unless NULL), in the same words, for those that it left opaque. */
    void (*blend)(float *pixels, int width, const uint16_t *grey, const CtsRowMarks *marks, const CtsEntries *entries,
                  uint64_t *closed);
    /* The same, lit. */
    void (*light)(float *pixels, const uint16_t *grey, const CtsRowMarks *marks, const CtsEntries *entries,
                  const CtsPlaces *places, const CtsLight *light, uint64_t *closed);
    /* Gradients of voxels i0..i1-1: differences along the row, along v and across the layers, and 0. */
    void (*gradient)(const CtsGradientRows *rows, int i0, int i1, float (*gradient)[4]);
} CtsSimd;

void cts_simd_init_plain(CtsSimd *simd);
void cts_simd_init_avx2(CtsSimd *simd);

/* cpu: CPU flags that may be used. */
static inline void cts_simd_init(CtsSimd *simd, unsigned cpu)
{
    (cpu & CTS_CPU_AVX2 ? cts_simd_init_avx2 : cts_simd_init_plain)(simd);
}

#endif
