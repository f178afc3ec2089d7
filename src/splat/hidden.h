/* What lies behind opaque pixels: a ray whose transmittance is 0 takes nothing more, so its samples can be left out,
 * and tiles that only such rays cross need no sheet. Exact, as all void skipping is. */
#ifndef CTS_SPLAT_HIDDEN_H
#define CTS_SPLAT_HIDDEN_H

#include "splat/raster.h"
#include "splat/tiles.h"

enum { CTS_BLOCK_WIDTH = 32, CTS_BLOCK_HEIGHT = 8 }; /* pixels; rows of a block belong to one thread */

typedef struct CtsHidden {
    int width, height, n_blocks; /* n_blocks: in a row of blocks */
    uint8_t *witness;     /* by picture row and block: a pixel of the block that is open, or CTS_BLOCK_WIDTH: none is */
    uint8_t *closed_rows; /* by block: how many of its rows are closed */
    /* A lattice point's pixel, from where the layer's lattice begins: x = inverse[0] . (u, v), y likewise. */
    double inverse[2][2];
} CtsHidden;

CtsStatus cts_hidden_init(CtsHidden *hidden, const CtsRaster *raster, CtsError *err);
void cts_hidden_free(CtsHidden *hidden);

/* Some of pixels xa..xb-1 of row y were closed: bring their blocks up to date. */
void cts_hidden_update(CtsHidden *hidden, const float *pixels, int y, int xa, int xb);

/* The first open stretch of pixels from *xa on, in *xa and the value returned; xb when there is none. */
int cts_hidden_next_open(const CtsHidden *hidden, int y, int *xa, int xb);

/* True when no open pixel looks at the tile within `spread` layers of layer k. */
bool cts_hidden_tile(const CtsHidden *hidden, const CtsRaster *raster, const CtsTiles *tiles, int k, double spread,
                     int tile_u, int tile_v);

#endif
