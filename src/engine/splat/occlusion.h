/* Occlusion culling: a pixel whose transmittance is 0 is closed. Its ray takes nothing more, so its samples can be left
 * out, and patches that only closed pixels look at need no sheet. Exact: the picture keeps its bytes. The map of what
 * is open is kept by zones of the picture (FastSplats, Huang and others 2000, keep an occlusion map likewise). */
#ifndef CTS_SPLAT_OCCLUSION_H
#define CTS_SPLAT_OCCLUSION_H

#include "engine/splat/patches.h"
#include "engine/splat/raster.h"

enum { CTS_ZONE = 32 }; /* pixels of a row, at most */

typedef struct CtsOcclusion {
    int width, height, first_row, n_zones; /* first_row: of the view; n_zones: in a row of zones */
    uint8_t *witness; /* by picture row and zone: a pixel of the zone that is open, or CTS_ZONE: none is */
    /* A lattice point's pixel, from where the layer's lattice begins: x = inverse[0] . (u, v), y likewise. */
    double inverse[2][2];
} CtsOcclusion;

CtsStatus cts_occlusion_init(CtsOcclusion *occlusion, const CtsRaster *raster, CtsError *err);
void cts_occlusion_free(CtsOcclusion *occlusion);

/* Some of pixels xa..xb-1 of row y were closed: bring their zones up to date. */
void cts_occlusion_update(CtsOcclusion *occlusion, const float *pixels, int y, int xa, int xb);

static inline bool cts_occlusion_closed(const CtsOcclusion *occlusion, int y, int x)
{
    return occlusion->witness[(size_t)y * (size_t)occlusion->n_zones + (size_t)(x / CTS_ZONE)] == CTS_ZONE;
}

/* The first pixel of xa..xb whose zone is open, or closed; xb when there is none. */
static inline int cts_occlusion_next(const CtsOcclusion *occlusion, int y, int xa, int xb, bool closed)
{
    while (xa < xb && cts_occlusion_closed(occlusion, y, xa) != closed)
        xa = (xa / CTS_ZONE + 1) * CTS_ZONE;
    return xa < xb ? xa : xb;
}

/* Where open pixels are looked for: rows y0..y1-1 of the picture, and what they look at within `spread` layers of
 * `layer`, a place across the layers. */
typedef struct CtsOcclusionQuery {
    double layer, spread;
    int y0, y1;
} CtsOcclusionQuery;

/* Set bits for the patches of a swath that an open pixel may look at. */
void cts_occlusion_open_row(const CtsOcclusion *occlusion, const CtsRaster *raster, const CtsPatches *patches,
                            const CtsOcclusionQuery *query, int swath, uint64_t *row);

#endif
