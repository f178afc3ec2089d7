/* Levels of air and of bright voxels. */
#pragma once

#include "ctsplat/volume.h"

/* Sets air_limit, Otsu's threshold of the first n_slices slices; air_value, the median up to it; bright_value, the
 * 99.5th percentile above it. Unchanged for HU, and where all voxels are equal. */
CtsStatus cts_volume_measure_levels(CtsVolume *volume, int n_slices, int n_threads, CtsError *err);
