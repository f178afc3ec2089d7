/* A copy of a volume with x and y exchanged: voxel (i, j, k) at (k * dims[0] + i) * dims[1] + j. For engines that take
 * voxels side by side within a layer across x. */
#pragma once

#include "ctsplat/model.h"
#include <stdint.h>

/* Makes the copy the first time, which takes as much memory as the volume, while other threads that ask for it wait.
 * *grey belongs to the model's macro-cells. */
CtsStatus cts_model_transposed(const CtsModel *model, int n_threads, const uint16_t **grey, CtsError *err);
