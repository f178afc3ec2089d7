/* Macro-cells: smallest and largest grey level of 4 x 4 x 4 cells of the volume. A cell lies between 2 x 2 x 2 voxels,
 * so that any value interpolated inside a macro-cell lies within its range. For engines with empty-space skipping. */
#pragma once

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <pthread.h>
#include <stdint.h>

enum { CTS_FINE_MACROCELL = 4 };

typedef struct CtsRange {
    uint16_t low, high;
} CtsRange;

static inline CtsRange cts_range_union(CtsRange a, CtsRange b)
{
    return (CtsRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

/* The cells between a volume's voxels along each axis, at least 1, and the distance to the next voxel, 0 along an axis
 * of one. */
static inline void cts_volume_cells(const CtsVolume *v, int n_cells[3], ptrdiff_t stride[3])
{
    ptrdiff_t step = 1;
    for (int a = 0; a < 3; a++) {
        n_cells[a] = v->dims[a] > 1 ? v->dims[a] - 1 : 1;
        stride[a] = v->dims[a] > 1 ? step : 0;
        step *= v->dims[a];
    }
}

/* Macro-cell (bi, bj, bk) is fine[(bk * n_fine[1] + bj) * n_fine[0] + bi] and covers voxels 4 b to 4 b + 4 of each
 * axis. */
typedef struct CtsMacrocells {
    int n_fine[3];
    CtsRange *fine;
    CtsRange all;
    int dims[3];
    uint16_t *transposed; /* copy of the same volume, for all pictures (core/model/transposed.h); NULL: not made */
    pthread_mutex_t lock; /* of the copy */
} CtsMacrocells;

/* For a volume of these dimensions; the ranges are the caller's to set. */
CtsStatus cts_macrocells_new_unset(CtsMacrocells **macrocells, const int dims[3], CtsError *err);
/* The range of all, once those of the macro-cells have changed. */
void cts_macrocells_sum(CtsMacrocells *macrocells);
void cts_macrocells_free(CtsMacrocells **macrocells);

/* Computes those of a volume with n_threads. */
CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err);
