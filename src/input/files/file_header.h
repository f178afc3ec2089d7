/* The header of an input file of any format: DICOM, or a NIfTI CT. */
#ifndef CTS_FILES_FILE_HEADER_H
#define CTS_FILES_FILE_HEADER_H

#include "core/volume/box.h"
#include "dicom/header/slice.h"
#include "input/files/nifti.h"

/* As cts_slice_read_header(), of NIfTI too: CTS_FILE_NIFTI, with slices placed by this form where the file was named.
 */
CtsFileKind cts_file_read_header(const CtsFile *source, CtsNiftiForm form, CtsScratch *scratch, CtsObject *object,
                                 uint64_t *bytes_read, CtsError *err);

/* A NIfTI CT as slices: what a scanner's headers would have said of them. It has no patient and no UIDs. */

/* Whether a file that begins so is one, alone or packed with gzip; of what gzip packed the name tells. */
bool cts_nifti_slices_are(const char *path, const uint8_t *head, size_t n);

/* Its voxels as a scanner would have stored them, in elements of the file: the slices lie along its third axis, as all
 * converters write them. */
CtsBox cts_nifti_box(const CtsNifti *nifti);

/* Slices of 16-bit pixels into a zeroed object, placed by this form; where these are, and what HU they mean, is not
 * told. */
CtsStatus cts_nifti_slices(const CtsFile *source, const CtsFileBytes *file, CtsNiftiForm form, CtsObject *object,
                           CtsError *err);

#endif
