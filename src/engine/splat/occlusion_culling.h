/* Occlusion culling: a pixel whose transmittance is 0 is closed. Its further samples can be skipped, and patches that
 * only closed pixels sample need no sheet. Exact: the picture keeps its bytes. (FastSplats, Huang and others 2000, has
 * a similar occlusion map.) */
#pragma once

#include "engine/splat/patches.h"
#include "engine/splat/raster.h"

typedef struct CtsCulling {
    int width, height, first_row, n_words; /* first_row: of the view; n_words: in a row of bits */
    uint64_t *closed;                      /* by picture row, a bit for each pixel */
    /* A lattice point's pixel, relative to the start of the layer's lattice: x = inverse[0] . (u, v), y likewise. */
    double inverse[2][2];
} CtsCulling;

CtsStatus cts_culling_init(CtsCulling *culling, const CtsRaster *raster, CtsError *err);

/* Bits of the closed pixels of row y. */
static inline uint64_t *cts_culling_row(const CtsCulling *culling, int y)
{
    return culling->closed + (size_t)y * (size_t)culling->n_words;
}

/* Region of the search for open pixels: rows y0..y1-1 of the picture, and their samples within `spread` layers of
 * `layer`, a position across the layers. */
typedef struct CtsOcclusionQuery {
    double layer, spread;
    int y0, y1;
} CtsOcclusionQuery;

/* Sets bits for the patches of a swath that an open pixel may sample. */
void cts_culling_open_row(const CtsCulling *culling, const CtsRaster *raster, const CtsPatches *patches,
                          const CtsOcclusionQuery *query, int swath, uint64_t *row);
