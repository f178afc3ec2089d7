/* Layers between slices by the shape of what they show: where a surface moves by more than its own edge from slice to
 * slice, grey levels blended in place give terraces, two half surfaces instead of one in between. After Grevera and
 * Udupa's shape-based interpolation of grey levels (1996): signed distances to a surface go over from one slice to the
 * other, and each grey level stays as far from the surface as it was. */
#ifndef CTS_VOLUME_SHAPE_H
#define CTS_VOLUME_SHAPE_H

#include "ctsplat/volume.h"

/* n_slices slices, which may be layers, and n_layers layers made of them, as blended in place. */
typedef struct CtsShapeStack {
    const uint16_t *slices;
    size_t slice_step; /* voxels from a slice to the next one */
    uint16_t *layers;
    int n_columns, n_rows, n_slices, n_layers;
    const double *layer; /* where each slice lies, in layers, rising; NULL: n_parts apart */
    int n_parts;
    double hu_offset, hu_step;
} CtsShapeStack;

/* Puts into the layers between slices what moves with the air's surface and with bone's; layers that are slices stay.
 * Adds to *made, which says where memory was too short for some of it. Threads never change the result. */
void cts_shape_layers(const CtsShapeStack *stack, int n_threads, CtsMadeUp *made);

#endif
