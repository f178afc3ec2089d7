/* The tiled engine's inner loop: packets of 8 pixels march through the layers, front to back.
 *
 * One template (tiled_tmpl.h) is compiled twice: tiled_c.c with plain C primitives, the readable truth, and
 * tiled_avx2.c with AVX2 ones. Both do the same operations in the same order, so their pictures are the same bytes. */
#ifndef CTS_SPLAT_TILED_KERNEL_H
#define CTS_SPLAT_TILED_KERNEL_H

#include "splat/layout.h"
#include "splat/leap.h"
#include "splat/slab.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_PACKET = 8 };

/* Everything a thread needs, read-only. Layers are numbered q = 0, 1, ... in the order a ray meets them. */
typedef struct TiledJob {
    const uint16_t *layer0;      /* voxel (0, 0) of layer q = 0 */
    ptrdiff_t row_stride, layer_stride; /* the latter from q to q + 1: negative where rays run against the axis */
    int nu, nv, nk;
    bool rising;                 /* layer q is volume layer q; else nk - 1 - q */
    /* Where the ray of pixel (x, y) meets layer q: u = u_at[0] + u_at[1] x + u_at[2] y + u_at[3] q, v alike. */
    double u_at[4], v_at[4];
    double window_u, window_v;   /* largest first column and row of a window of 8 x 3 voxels */
    bool windowed;               /* half a packet fits such a window; else lane by lane */
    bool straight;               /* u_at[3] and v_at[3] are 0: every layer is met at the same place */
    int samples;                 /* sub-sheets per layer */
    float layer_mm;              /* ray length from layer to layer */
    float stop_transmittance;    /* a packet ends when all of its pixels have less than this left */
    CtsSlabTable table;
    CtsLeap leap;
    int width, height;
    float *rgba;                 /* the picture */
    float *depth_mm;             /* NULL: not wanted */
} TiledJob;

typedef struct TiledCounts {
    uint64_t samples;   /* field values, one a pixel and sheet */
    uint64_t slabs;     /* pixel slabs in which something could be seen */
    uint64_t packets;   /* packets that met the volume */
} TiledCounts;

/* Pixels x0..x1 of row y; x0 is a multiple of CTS_PACKET. */
typedef void (*tiled_row_fn)(const TiledJob *job, int y, int x0, int x1, TiledCounts *counts);

void tiled_row_c(const TiledJob *job, int y, int x0, int x1, TiledCounts *counts);
void tiled_row_avx2(const TiledJob *job, int y, int x0, int x1, TiledCounts *counts);

#endif
