/* Rows of voxels to the ranges of the fine macro-cells along them: the innermost step of making macrocells.h. */
#ifndef CTS_VOLUME_FOLD_H
#define CTS_VOLUME_FOLD_H

#include "core/volume/macrocells.h"
#include <stddef.h>

/* n_rows rows of n columns, 1 or more of each and row_stride voxels apart, widen the ranges of the n_macrocells fine
 * macro-cells side by side: macro-cell b has columns 4 b to 4 b + 4, those behind the last column left out; 4
 * (n_macrocells - 1) < n. The plain version is the truth; the fast one gives the same ranges. */
typedef void (*cts_fold_fn)(const uint16_t *row, size_t row_stride, int n_rows, int n, CtsRange *range,
                            int n_macrocells);
void cts_fold_plain(const uint16_t *row, size_t row_stride, int n_rows, int n, CtsRange *range, int n_macrocells);
/* The fastest version for these processor flags (base/cpu.h). */
cts_fold_fn cts_fold(unsigned cpu);

#endif
