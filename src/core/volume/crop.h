/* Boxes of voxels low[] to high[], inclusive, for crops. */
#pragma once

#include "ctsplat/volume.h"

/* Widens the box of the voxels above air by what cts_volume_crop_air() keeps around it. An empty one (low > high)
 * becomes the whole volume. */
void cts_volume_widen_box(const CtsVolume *volume, int low[3], int high[3]);

/* Sets the place and the size of the box; the others are counted as air. Grey levels are the caller's. */
void cts_volume_become_air_box(CtsVolume *volume, const int low[3], const int high[3]);
