/* The header of an input file of any format: DICOM, or a NIfTI CT. */
#pragma once

#include "core/volume/box.h"
#include "dicom/header/header_reader.h"
#include "input/files/nifti.h"

/* Opens a file and queues its header, as cts_header_add(); also NIfTI: CTS_FILE_NIFTI, with slices placed by this form
 * where the file was named itself. cts_header_finish() completes the result. */
void cts_file_header_add(CtsHeaderReader *reader, const CtsFile *source, CtsNiftiForm form, CtsHeaderRead *result);

/* Number of threads, each with a process that reads headers, that n files are worth: a process takes as long to start
 * as it does to read some 30 headers. */
static inline int cts_file_header_threads(size_t n, int n_threads)
{
    return n < 100 ? 1 : n_threads;
}

/* A NIfTI CT as slices, with the fields that DICOM headers would have. It has no patient and no UIDs. */

/* True if a file that begins so is NIfTI, plain or packed with gzip; for gzip the name decides. */
bool cts_nifti_slices_are(const char *path, const uint8_t *head, size_t n);

/* Its voxels as a scanner would have stored them, in elements of the file: the slices lie along its third axis, as all
 * converters write them. */
CtsBox cts_nifti_box(const CtsNifti *nifti);

/* Fills a zeroed object with slices of 16-bit pixels, placed by this form; their pixel offsets and HU scale are not set
 * yet. */
CtsStatus cts_nifti_slices(const CtsFile *source, const CtsFileBytes *file, CtsNiftiForm form, CtsObject *object,
                           CtsError *err);
