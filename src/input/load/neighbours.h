/* What no header tells: whether the values of a series, the order of its slices and its lengths can be right, by
 * samples of all slices. */
#ifndef CTS_LOAD_NEIGHBOURS_H
#define CTS_LOAD_NEIGHBOURS_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "input/header/slice.h"

/* samples: CTS_SAMPLES of each of n slices in order of position. Adds the findings slice_off_neighbours,
 * hu_implausible, order_conflict and spacing_implausible; of a series that is right, none. */
CtsStatus cts_neighbours_tell(const CtsSlice *slices, int n, const uint16_t *samples, CtsReport *report, CtsError *err);

#endif
