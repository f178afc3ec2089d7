/* A copy of a volume with x and y exchanged: voxel (i, j, k) at (k * dims[0] + i) * dims[1] + j. For engines that take
 * voxels side by side within a layer across x. */
#pragma once

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdint.h>

typedef struct CtsTransposed CtsTransposed;

/* The place of the copy, which is not made yet: it takes as much memory as the volume. */
CtsStatus cts_transposed_new(CtsTransposed **transposed, CtsError *err);
void cts_transposed_free(CtsTransposed **transposed);
/* Makes the copy the first time, while other threads that ask for it wait. *grey belongs to transposed. */
CtsStatus cts_transposed_find(CtsTransposed *transposed, const CtsVolume *volume, int n_threads, const uint16_t **grey,
                              CtsError *err);
