/* Layers between unevenly spaced slices by linear interpolation. */
#pragma once

#include "ctsplat/volume.h"

/* The last slice at or below layer k. */
int cts_slice_below(const double *layer, int n_slices, int k);

/* n voxels at this fraction of the distance from the first row to the second; in place for either. */
void cts_slice_blend_row(uint16_t *to, const uint16_t *low, const uint16_t *high, size_t n, float share);

/* One layer: a slice (high is NULL), or one between two slices; share: fraction of the distance from low. */
typedef struct CtsLinearLayer {
    const uint16_t *low, *high;
    float share;
} CtsLinearLayer;

CtsLinearLayer cts_linear_layer(const CtsLinearLayers *layers, size_t layer_voxels, int k);
/* n voxels from voxel `first` on: of the slice, or made in `to`. */
const uint16_t *cts_linear_layer_row(const CtsLinearLayer *layer, size_t first, size_t n, uint16_t *to);
