/* A NIfTI CT as slices: what a scanner's headers would have said of them. It has no patient and no UIDs. */
#ifndef CTS_HEADER_NIFTI_SLICES_H
#define CTS_HEADER_NIFTI_SLICES_H

#include "core/volume/box.h"
#include "input/files/nifti.h"
#include "input/files/scan.h"
#include "input/header/slice.h"

/* Whether a file that begins so is one, alone or packed with gzip; of what gzip packed the name tells. */
bool cts_nifti_slices_are(const char *path, const uint8_t *head, size_t n);

/* Its voxels as a scanner would have stored them, in elements of the file: the slices lie along its third axis, as all
 * converters write them. */
CtsBox cts_nifti_box(const CtsNifti *nifti);

/* Slices of 16-bit pixels into a zeroed object; where these are, and what HU they mean, is not told. */
CtsStatus cts_nifti_slices(const CtsFile *source, const CtsFileBytes *file, CtsObject *object, CtsError *err);

#endif
