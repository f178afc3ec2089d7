/* Classified after splatting and composited front to back: one plane of samples under the picture's pixels. */
#pragma once

#include "core/scene/engine.h"
#include "core/transfer/lut.h"
#include "ctsplat/picture.h"
#include "engine/splat/occlusion_culling.h"
#include "engine/splat/patches.h"
#include "engine/splat/raster.h"

/* The transfer function for a length of ray. */
CtsStatus cts_entries_init(CtsEntries *entries, const CtsLut *lut, double length_mm, CtsError *err);

typedef struct CtsPlane {
    double layer; /* coordinate across the layers; between two, a fraction */
    CtsSheetPair sheets;
    const CtsEntries *entries;
    const CtsLight *light; /* NULL: unlit */
    const uint64_t *shown; /* by row of cells, a bit for each potentially visible cell; NULL: all */
} CtsPlane;

/* One thread's state. */
typedef struct CtsCompositor {
    const CtsSimd *simd;
    CtsPatches patches;
    CtsPicture *picture; /* red, green, blue and, until the end, transmittance */
    CtsCulling *culling; /* NULL: no occlusion culling */
    CtsRasterRow row;
    uint16_t *grey;
    uint64_t *shown;    /* potentially visible pixels of a row; behind them the marks' bits */
    int shown_row;      /* the row of cells that they sample, reused if the next row has the same; or -1 */
    CtsRowMarks marks;  /* open ones among those; then the visible ones */
    double depth_mm[4]; /* from the camera plane: [0] + [1] * x + [2] * y + [3] * layer */
    uint64_t samples;
} CtsCompositor;

CtsStatus cts_compositor_init(CtsCompositor *c, const CtsSimd *simd, const CtsPatches *patches, const CtsRaster *raster,
                              const CtsScene *scene, CtsPicture *picture, CtsError *err);
void cts_compositor_free(CtsCompositor *c);

/* Rows y0..y1-1 of the picture. */
void cts_composite_rows(CtsCompositor *c, const CtsPlane *plane, int y0, int y1);
