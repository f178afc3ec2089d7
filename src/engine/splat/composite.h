/* Classified after splatting and composited front to back: one plane of samples under the picture's pixels. */
#ifndef CTS_SPLAT_COMPOSITE_H
#define CTS_SPLAT_COMPOSITE_H

#include "core/scene/engine.h"
#include "core/transfer/lut.h"
#include "ctsplat/picture.h"
#include "engine/splat/occlusion.h"
#include "engine/splat/patches.h"
#include "engine/splat/raster.h"

/* The transfer function for a length of ray. */
CtsStatus cts_entries_init(CtsEntries *entries, const CtsLut *lut, double length_mm, CtsError *err);
void cts_entries_free(CtsEntries *entries);

typedef struct CtsPlane {
    double layer; /* coordinate across the layers; between two, a fraction */
    CtsSheetPair sheets;
    const CtsEntries *entries;
    const CtsLight *light; /* NULL: unlit */
    const uint64_t *shown; /* by row of cells, a bit for each cell that may show something; NULL: all do */
} CtsPlane;

/* One thread's state. */
typedef struct CtsCompositor {
    const CtsSimd *simd;
    CtsPatches patches;
    CtsPicture *picture;     /* red, green, blue and, until the end, transmittance */
    CtsOcclusion *occlusion; /* NULL: look at all pixels, also behind opaque ones */
    CtsRasterRow row;
    uint16_t *grey;
    uint64_t *shown;   /* pixels of a row that may show something */
    int shown_row;     /* the row of cells that they look at, where the next row may have the same; or -1 */
    CtsRowMarks marks; /* of those the ones that are open; then those that do show */
    int *border;        /* where it is known for all planes: the first pixel behind that below a cell */
    bool borders_known;
    double depth_mm[4]; /* from the camera plane: [0] + [1] * x + [2] * y + [3] * layer */
    uint64_t samples;
    double timed_ms, timed_blend_ms; /* of the rows that are timed, one in sixteen: all of it, and blending */
} CtsCompositor;

CtsStatus cts_compositor_init(CtsCompositor *c, const CtsSimd *simd, const CtsPatches *patches, const CtsRaster *raster,
                              const CtsScene *scene, CtsPicture *picture, CtsError *err);
void cts_compositor_free(CtsCompositor *c);

/* Rows y0..y1-1 of the picture. */
void cts_composite_rows(CtsCompositor *c, const CtsPlane *plane, int y0, int y1);

#endif
