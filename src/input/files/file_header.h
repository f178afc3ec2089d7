/* The header of an input file of any format: DICOM, or a NIfTI CT. */
#pragma once

#include "core/volume/box.h"
#include "dicom/header/header_reader.h"
#include "input/files/nifti.h"

/* Reads the headers of n files by at most n_threads of the readers; also NIfTI, with slices placed by
 * this form where the file was named itself. The objects must not outlive the readers' texts. */
void cts_file_headers_read(const CtsFile *files, size_t n, CtsNiftiForm form, CtsHeaderReader *readers, int n_threads,
                           CtsHeaderRead *results);

/* Voxels of a NIfTI file as a scanner would have stored them, in elements of the file: the slices lie along its third
 * axis, as all converters write them. */
CtsBox cts_nifti_box(const CtsNifti *nifti);
