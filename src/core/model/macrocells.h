/* Macro-cells: smallest and largest grey level of 8 x 8 x 8 cells of the volume, or of 4 x 4 x 4 in the fine ones. A
 * cell lies between 2 x 2 x 2 voxels, so that any value interpolated inside a macro-cell lies within its range. For
 * engines with empty-space skipping. */
#pragma once

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdint.h>

enum { CTS_MACROCELL = 8, CTS_FINE_MACROCELL = 4 };

typedef struct CtsRange {
    uint16_t low, high;
} CtsRange;

static inline CtsRange cts_range_union(CtsRange a, CtsRange b)
{
    return (CtsRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}

/* Macro-cell (bi, bj, bk) is range[(bk * n[1] + bj) * n[0] + bi] and covers voxels 8 b to 8 b + 8 of each axis; the
 * fine ones likewise with 4. */
typedef struct CtsMacrocells {
    int n[3], n_fine[3];
    CtsRange *range, *fine;
    CtsRange all;
    int dims[3];
    struct CtsTransposed *transposed; /* of the same volume, for all pictures of it, by any preset */
} CtsMacrocells;

/* For a volume of these dimensions; the ranges are the caller's to set. */
CtsStatus cts_macrocells_new_unset(CtsMacrocells **macrocells, const int dims[3], CtsError *err);
/* The ranges of the coarse macro-cells and of all, once the fine ones have changed. */
void cts_macrocells_sum(CtsMacrocells *macrocells, int n_threads);
void cts_macrocells_free(CtsMacrocells **macrocells);

/* Computes those of a volume with n_threads. */
CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err);
