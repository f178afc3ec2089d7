/* An unevenly spaced stack becomes an evenly spaced one in its own memory, by cubics along the stack
 * (core/volume/refine.h) or by straight lines. */
#ifndef CTS_VOLUME_RESAMPLE_H
#define CTS_VOLUME_RESAMPLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* layer[i] is where slice i lies, in layers: rising from 0 to n_layers - 1. The slot for slice 0, so that no layer
 * is written over a slice still needed: slice i goes to slot offset + i. */
int cts_resample_offset(const double *layer, int n_slices, int n_layers);

typedef struct CtsResampling {
    size_t layer_voxels;
    const double *layer; /* as above */
    int n_slices, n_layers, offset;
    bool linear;
} CtsResampling;

/* From slots offset ... offset + n_slices - 1 to slots 0 ... n_layers - 1, each of layer_voxels grey levels. */
void cts_resample_stack(uint16_t *grey, const CtsResampling *resampling, int n_threads);

#endif
