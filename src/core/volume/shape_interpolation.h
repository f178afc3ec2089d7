/* Shape-based interpolation of layers: where a surface moves by more than the width of its edge from slice to slice,
 * blending gives terraces, two half surfaces in place of one. After Grevera and Udupa's shape-based interpolation of
 * grey levels (1996): signed distances to a surface are interpolated between the slices, and each grey level keeps its
 * distance from the surface. */
#pragma once

#include "ctsplat/volume.h"

/* n_slices slices, one after the other, and n_layers layers to be made of them. */
typedef struct CtsShapeStack {
    const uint16_t *slices; /* may be the first layers; then `layer` is NULL, and they are overwritten */
    uint16_t *layers;
    int n_columns, n_rows, n_slices, n_layers;
    const double *layer; /* position of each slice in layers, rising; NULL: n_parts apart */
    int n_parts;         /* with `layer`: 1 */
    double hu_offset, hu_step;
} CtsShapeStack;

/* Makes the layers by cubic interpolation (core/volume/slice_interpolation.h), then, with CTS_INTERPOLATION_SHAPE,
 * overwrites pixels displaced with the surfaces of air and bone; layers that are slices are copied. Adds to *made,
 * including where memory for surfaces was too short. The result does not depend on the number of threads. */
void cts_shape_interpolate_layers(const CtsShapeStack *stack, CtsInterpolation how, int n_threads,
                                  CtsInterpolationCounts *made);
