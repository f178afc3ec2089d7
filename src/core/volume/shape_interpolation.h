/* Shape-based interpolation of layers: where a surface moves by more than the width of its edge from slice to slice,
 * blending gives terraces, two half surfaces in place of one. After Grevera and Udupa's shape-based interpolation of
 * grey levels (1996): signed distances to a surface are interpolated between the slices, and each grey level keeps its
 * distance from the surface. */
#pragma once

#include "ctsplat/volume.h"

/* n_slices slices, one after the other, and a box of the layers to be made of them. */
typedef struct CtsShapeStack {
    const uint16_t *slices; /* may be the first layers; then `layer` is NULL, `low` is 0, and they are overwritten */
    uint16_t *layers;       /* of the box alone */
    int n_columns, n_rows, n_slices;
    /* Columns, rows and layers of the box: from low[] on (columns and rows: even), before end[]. Grey levels are those
     * of the whole layers. */
    int low[3], end[3];
    const double *layer;    /* position of each slice in layers, rising; NULL: n_parts apart */
    int n_parts;            /* with `layer`: 1 */
    const CtsVolume *scale; /* the scale of the grey levels */
} CtsShapeStack;

/* Makes the layers by linear or cubic interpolation (core/volume/slice_interpolation.h), then, with
 * CTS_INTERPOLATION_SHAPE, overwrites pixels displaced with the surfaces of air and bone; layers that are slices are
 * copied. Adds to *made, including where memory for surfaces was too short. The result does not depend on the number of
 * threads. */
void cts_shape_interpolate_layers(const CtsShapeStack *stack, CtsInterpolation how, int n_threads,
                                  CtsInterpolationCounts *made);
