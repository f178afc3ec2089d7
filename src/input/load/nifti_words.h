/* Voxels of a NIfTI CT -> 16-bit pixels in memory, which are read like those of any slice. */
#ifndef CTS_LOAD_NIFTI_WORDS_H
#define CTS_LOAD_NIFTI_WORDS_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "input/header/slice.h"
#include <signal.h>

/* Reads all voxels of the file whose n slices these are, and tells each slice where its pixels lie and what HU they
 * mean: exactly where the values are whole and span at most 65535, else to 1/131068 of their span. What is not finite
 * is padding. stop: as of a CtsWordWatch. *words is the caller's, also after a failure; free with cts_free(). */
CtsStatus cts_nifti_words(CtsSlice *slices, int n, const volatile sig_atomic_t *stop, uint16_t **words,
                          CtsReport *report, CtsError *err);

#endif
