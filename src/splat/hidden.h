/* What lies behind opaque pixels: a ray whose transmittance is 0 takes nothing more, so its samples can be left out,
 * and tiles that only such rays cross need no sheet. Exact, as all void skipping is. */
#ifndef CTS_SPLAT_HIDDEN_H
#define CTS_SPLAT_HIDDEN_H

#include "splat/raster.h"
#include "splat/tiles.h"

enum { CTS_BLOCK_WIDTH = 32, CTS_BLOCK_HEIGHT = 8 }; /* pixels, at most; rows of a block belong to one thread */

typedef struct CtsHidden {
    int width, height, first_row, n_blocks; /* first_row: of the view; n_blocks: in a row of blocks */
    uint8_t *witness;     /* by picture row and block: a pixel of the block that is open, or CTS_BLOCK_WIDTH: none is */
    int *block_row;       /* by picture row: which row of blocks it lies in */
    uint8_t *height_of;   /* by row of blocks: picture rows */
    uint8_t *closed_rows; /* by block: how many of its rows are closed */
    /* A lattice point's pixel, from where the layer's lattice begins: x = inverse[0] . (u, v), y likewise. */
    double inverse[2][2];
} CtsHidden;

/* cuts: n ascending picture rows at which rows of blocks must begin, so that threads may share rows out there too. */
CtsStatus cts_hidden_init(CtsHidden *hidden, const CtsRaster *raster, const int *cuts, int n_cuts, CtsError *err);
void cts_hidden_free(CtsHidden *hidden);

/* Some of pixels xa..xb-1 of row y were closed: bring their blocks up to date. */
void cts_hidden_update(CtsHidden *hidden, const float *pixels, int y, int xa, int xb);

static inline bool cts_hidden_closed(const CtsHidden *hidden, int y, int x)
{
    return hidden->witness[(size_t)y * (size_t)hidden->n_blocks + (size_t)(x / CTS_BLOCK_WIDTH)] == CTS_BLOCK_WIDTH;
}

/* The first pixel of xa..xb whose block is open, or closed; xb when there is none. */
static inline int cts_hidden_next(const CtsHidden *hidden, int y, int xa, int xb, bool closed)
{
    while (xa < xb && cts_hidden_closed(hidden, y, xa) != closed)
        xa = (xa / CTS_BLOCK_WIDTH + 1) * CTS_BLOCK_WIDTH;
    return xa < xb ? xa : xb;
}

/* Set bits for the tiles of a band that an open pixel of rows y0..y1-1 may look at within `spread` layers of a place
 * across the layers. */
void cts_hidden_open_row(const CtsHidden *hidden, const CtsRaster *raster, const CtsTiles *tiles, double layer,
                         double spread, int band, int y0, int y1, uint64_t *row);

#endif
