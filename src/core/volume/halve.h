/* A volume at half the resolution, for pictures that may err. */
#ifndef CTS_VOLUME_HALVE_H
#define CTS_VOLUME_HALVE_H

#include "ctsplat/volume.h"

/* Along an axis of n voxels, n >= 3, n / 2 + 1 nodes in their place, the first and the last where the first and the
 * last voxel are: the box of voxel centres stays, and a step is two voxels, or a little less where n is even. An axis
 * whose spacing is 1.5 times the finest one or more keeps its voxels.
 *
 * What is linearly interpolated between voxels is looked at in half steps and weighed by -1 2 6 2 -1 eighths: the
 * low-pass of the 5/3 wavelet (Le Gall and Tabatabai 1988), which is made for nodes that are linearly interpolated in
 * turn. Straight lines stay, beyond the border the last voxel goes on, and what overshoots 0 to 65535 is cut. Each axis
 * rounds to whole grey levels: columns, then rows, then slices.
 *
 * slice_layers counts the new layers; macro-cells and the mask of the body do not fit and are NULL. n_threads 0: all
 * cores; neither threads nor SIMD paths change the result. Free with cts_volume_free(). On CTS_ERR_MEMORY, which takes
 * in that too little is free, *half is NULL. */
CtsStatus cts_volume_halve(const CtsVolume *volume, int n_threads, CtsVolume **half, CtsError *err);

#endif
