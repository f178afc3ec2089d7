/* Steps of loading a series. */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "dicom/header/slice.h"
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Voxels of a NIfTI file -> 16-bit pixels in memory, which are read like those of any slice. */

/* Reads all voxels of the file of these n slices, by the rules' form and quantity, and sets each slice's pixel offset
 * and scale. HU: exact where the values are whole and span at most 65534, else in steps of 1/65534 of their span;
 * others: as volumes have them (core/volume/grey.h). Non-finite values become padding. Values that are no HU are
 * refused unless the rules name the quantity. stop: as in CtsWordWatch. *words is the caller's, also after a failure;
 * free with cts_free(). */
CtsStatus cts_nifti_words(CtsSlice *slices, int n, const CtsSeriesRules *rules, const volatile sig_atomic_t *stop,
                          uint16_t **words, CtsReport *report, CtsError *err);

/* Plausibility checks of a series' values, slice order and lengths, by samples of all slices. */

/* samples: CTS_SAMPLES of each of n slices in order of position. is_hu: else only their order is checked. Adds the
 * findings slice_off_neighbours, hu_implausible, order_conflict and spacing_implausible; a correct series gets none. */
CtsStatus cts_slice_consistency_report(const CtsSlice *slices, int n, const uint16_t *samples, bool is_hu,
                                       CtsReport *report, CtsError *err);

/* Voxels of a layer. */
static inline size_t cts_scanned_layer_voxels(const CtsScanned *s)
{
    return (size_t)s->even->dims[0] * (size_t)s->even->dims[1];
}
