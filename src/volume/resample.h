/* An unevenly spaced stack becomes an evenly spaced one, linearly along the stack and in its own memory. */
#ifndef CTS_VOLUME_RESAMPLE_H
#define CTS_VOLUME_RESAMPLE_H

#include <stddef.h>
#include <stdint.h>

/* layer[i] is where slice i lies, in layers: rising from 0 to n_layers - 1. The slot for slice 0, so that no layer
 * is written over a slice still needed: slice i goes to slot offset + i. */
int cts_resample_offset(const double *layer, int n_slices, int n_layers);

/* From slots offset ... offset + n_slices - 1 to slots 0 ... n_layers - 1, each of layer_voxels grey levels. */
void cts_resample_stack(uint16_t *grey, size_t layer_voxels, const double *layer, int n_slices, int n_layers,
                        int offset, int n_threads);

#endif
