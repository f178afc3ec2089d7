/* The header of a NIfTI-1 or NIfTI-2 file (Cox et al. 2004; nifti.nimh.nih.gov), and its numbers one by one. */
#ifndef CTS_FILES_NIFTI_H
#define CTS_FILES_NIFTI_H

#include "ctsplat/status.h"
#include "input/files/file_bytes.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct CtsNifti {
    int dims[3];
    double origin_lps[3], step_lps[3][3]; /* mm: the centre of the first voxel, and from voxel to voxel */
    double slope, intercept;              /* value = slope * number + intercept */
    int datatype, bytes;                  /* of a number */
    bool is_whole, is_signed;             /* an integer type */
    char *extension;                      /* n_extension bytes; owned, or NULL */
    size_t n_extension;
    /* Where the numbers come from: */
    const CtsFileBytes *file;
    bool big_endian;
    bool is_packed;          /* with gzip */
    struct gzFile_s *stream; /* zlib's, of the file unpacked */
} CtsNifti;

/* Whether a file that begins so is NIfTI, alone or packed with gzip. */
bool cts_nifti_is(const uint8_t *head, size_t n);
/* A format that is told by its name: how to make NIfTI of it; NULL: none of them. */
const char *cts_nifti_other(const uint8_t *head, size_t n, const char *path);

/* Reads up to the first number. Close in any case. */
CtsStatus cts_nifti_open(CtsNifti *nifti, const CtsFileBytes *file, CtsError *err);
void cts_nifti_close(CtsNifti *nifti);

/* How many numbers there are, each of which takes so many bytes once it is read. Refuses more than memory has room for,
 * and more than the file can hold. */
CtsStatus cts_nifti_count(const CtsNifti *nifti, size_t bytes_each, size_t *n, CtsError *err);
/* The next n numbers as values. */
CtsStatus cts_nifti_read(CtsNifti *nifti, double *values, size_t n, CtsError *err);

#endif
