/* The header of a NIfTI-1 or NIfTI-2 file (Cox et al. 2004; nifti.nimh.nih.gov), and its numbers one by one. */
#pragma once

#include "base/file_bytes.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stdint.h>

/* Position of the voxels: the centre of the first one, and the steps from voxel to voxel. */
typedef struct CtsNiftiPlace {
    bool given;                           /* with a code above 0, and axes that span space */
    double origin_lps[3], step_lps[3][3]; /* mm */
} CtsNiftiPlace;

typedef struct CtsNifti {
    int dims[3];
    CtsNiftiPlace sform, qform;
    CtsNiftiPlace place;      /* by the form in use: the sform, else the qform */
    double slope, intercept;  /* value = slope * number + intercept */
    int datatype, bytes;      /* of a number */
    bool is_whole, is_signed; /* an integer type */
    char *extension;          /* n_extension bytes; owned, or NULL */
    size_t n_extension;
    /* The source of the numbers: */
    const CtsFileBytes *file;
    bool big_endian;
    uint64_t at;                  /* of the numbers' bytes */
    bool is_packed;               /* with gzip */
    struct CtsSandbox *unpacker;  /* of a packed file */
    uint64_t file_at, n_unpacked; /* bytes that it has taken, and made */
    const uint8_t *part;          /* n_part bytes that it has made and that are not read */
    size_t n_part;
} CtsNifti;

/* True if a file that begins so is NIfTI, plain or packed with gzip. */
bool cts_nifti_is(const uint8_t *head, size_t n);
/* Advice for converting another format, recognised by its name or first bytes, to NIfTI; NULL for an unknown one. */
const char *cts_nifti_other(const uint8_t *head, size_t n, const char *path);

/* Reads up to the first number. Close in any case. */
CtsStatus cts_nifti_open(CtsNifti *nifti, const CtsFileBytes *file, CtsError *err);
void cts_nifti_close(CtsNifti *nifti);

/* Result of comparing both forms; smaller differences than CTS_NIFTI_FORMS_DIFFER are not reported. */
typedef enum CtsNiftiForms {
    CTS_NIFTI_FORMS_AGREE,  /* or one is not given */
    CTS_NIFTI_FORMS_DIFFER, /* voxel size by more than 1 %, an axis by more than 1 degree, or, sizes aside, a corner by
                             * more than a voxel */
    CTS_NIFTI_FORMS_CONTRADICT /* one is mirrored, or an axis points elsewhere by more than 45 degrees */
} CtsNiftiForms;
enum { CTS_NIFTI_FORMS_TEXT = 240 };
/* text: a description of the difference, to follow the subject "its sform and its qform". */
CtsNiftiForms cts_nifti_compare_forms(const CtsNifti *nifti, char text[CTS_NIFTI_FORMS_TEXT]);
/* Uses this form where it is given, else the other; AUTO: the sform first. */
void cts_nifti_take_form(CtsNifti *nifti, CtsNiftiForm form);

/* The count of numbers, each of which takes bytes_each bytes in memory. Refuses more than the free memory, and more
 * than the file can hold. */
CtsStatus cts_nifti_count(const CtsNifti *nifti, size_t bytes_each, size_t *n, CtsError *err);
/* Reads the n numbers and calls take, for as long as it succeeds, with some thousand values at a time: from number
 * `first` on, in order. *stop (stop may be NULL) ends it with CTS_ERR_INTERRUPTED. */
typedef CtsStatus (*CtsNiftiSink)(void *context, const double *values, size_t first, size_t n, CtsError *err);
CtsStatus cts_nifti_read(CtsNifti *nifti, size_t n, const volatile sig_atomic_t *stop, CtsNiftiSink take, void *context,
                         CtsError *err);
