/* Slices that are each the only one of a series, and lie as one stack all the same. */
#pragma once

#include "ctsplat/series.h"
#include "dicom/header/slice.h"

/* Grid and position of a slice; false for one without a sound position, a scout, a page or a frame. */
bool cts_slice_place(const CtsSlice *slice, CtsSlicePlace *place);

/* Adds a note for each stack of single slices in a complete list. */
CtsStatus cts_single_slices_report(CtsSeriesList *list, CtsError *err);
