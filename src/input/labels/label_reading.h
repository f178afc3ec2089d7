/* Shared functions of the label readers. */
#pragma once

#include "base/file_bytes.h"
#include "core/labels/label_set.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "dicom/header/dicom_object.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Names for the numbers of a label map: from --label-names, or from the extension of a NIfTI file. */

typedef struct CtsLabelName {
    int number;
    char *name;
    bool coloured;
    double rgb[3]; /* display values 0..1 */
} CtsLabelName;

typedef struct CtsLabelNames {
    CtsLabelName *items;
    size_t n;
    CtsLabelRegion *regions; /* n_regions, file not set: names for several numbers */
    size_t n_regions;
} CtsLabelNames;

/* Parses a JSON object of names by number or of numbers by name, nnU-Net's dataset.json, whose "labels" is one and may
 * contain regions, or a table of ITK-SNAP, with colours. what: the file's name in messages. CTS_ERR_USAGE when it is
 * none of these. */
CtsStatus cts_label_names_parse(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err);
CtsStatus cts_label_names_read(const char *path, CtsLabelNames *names, CtsError *err);
/* Parses Caret's XML (<Label Key="1">liver</Label>); names stays unchanged where there is none. */
CtsStatus cts_label_names_xml(const char *text, size_t n, CtsLabelNames *names, CtsError *err);
void cts_label_names_free(CtsLabelNames *names);

/* NULL if the number has no name. */
const CtsLabelName *cts_label_names_find(const CtsLabelNames *names, int number);

/* A DICOM object whose header is held in memory and whose pixels are read frame by frame. */

typedef struct CtsLabelDicom {
    CtsDicomObject head;
    char class_uid[65], charset[65];
    CtsFileBytes source;    /* of the pixels: the file, or the pixels of a deflated data set */
    uint8_t *inflated;      /* owned: these; else NULL */
    CtsPixelFraming pixels; /* in the source; where encapsulated, n_bytes are all that is left of it */
} CtsLabelDicom;

/* True if a file that begins so is DICOM; class_uid may then be "" (no meta header, or deflated). */
bool cts_label_is_dicom(const uint8_t *head, size_t n, char class_uid[65]);

/* Close in any case. CTS_ERR_READ for a damaged file or one that claims more bytes than it has. */
CtsStatus cts_label_dicom_open(CtsLabelDicom *object, const CtsFile *file, CtsError *err);
void cts_label_dicom_close(CtsLabelDicom *object);

/* A text as UTF-8, decoded by the object's character set, truncated to size. */
void cts_label_dicom_text(const CtsLabelDicom *object, CtsElements elements, uint32_t tag, char *text, size_t size);

/* Shared state of the label readers. */

/* A label file that is being read for one series. */
typedef struct CtsLabelReading {
    const CtsSeries *series;
    CtsLabels *labels;
    int file;                   /* index of the label file, from 1 */
    const char *name;           /* of a mask that is named by its file; else NULL */
    int number;                 /* of such a mask */
    const CtsLabelNames *names; /* for a label map's numbers; or NULL */
    CtsReport *report;          /* may be NULL */
} CtsLabelReading;

/* Readers of one object each. It was opened and belongs to the patient. */
CtsStatus cts_label_read_seg(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err);
CtsStatus cts_label_read_rtstruct(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err);
CtsStatus cts_label_read_nifti(const CtsLabelReading *reading, const CtsFileBytes *file, CtsError *err);

/* The scanned slices of a series as a grid, which labels take over. */
CtsStatus cts_label_grid_of(CtsLabelGrid *grid, const CtsSeries *series, CtsError *err);

/* The name of a file without its folders and its ending .nii or .nii.gz. */
void cts_label_stem(const char *path, char *stem, size_t size);

/* Files that match a pattern with {series_uid}, {stem} and * for a series; free with cts_label_paths_free(). ct: the
 * path of a NIfTI CT, or NULL, for which {stem} matches nothing. A pattern for a single file gives its path whether it
 * exists or not. */
typedef struct CtsLabelPaths {
    char **items;
    size_t n;
} CtsLabelPaths;
CtsStatus cts_label_paths(const char *pattern, const char *uid, const char *ct, CtsLabelPaths *paths, CtsError *err);
void cts_label_paths_free(CtsLabelPaths *paths);

/* True if an object refers to the series, or to one of its slices; NULL: to any series or image. */
bool cts_label_refers(CtsElements elements, const CtsSeries *series);
/* Its Frame of Reference UID, "" if missing. */
const char *cts_label_series_frame(const CtsSeries *series);
bool cts_label_shares_space(const char *frame_uid, const CtsSeries *series);
/* Checks that its patient is the series', and its frame of reference too: frame_uid, "" where it has none. */
CtsStatus cts_label_check_patient(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err);
CtsStatus cts_label_check_space(const CtsLabelReading *reading, const CtsLabelDicom *object, const char *frame_uid,
                                CtsError *err);

/* Masks on a grid of their own, resampled to runs of the scanned voxels: each voxel takes the mask's nearest one, and a
 * fraction where the mask's own field covers it in part. */

enum { CTS_MASK_VALUES = 65536 };

/* A plane's pixels, valid until the next is read. */
typedef struct CtsMaskPlane {
    const uint16_t *values; /* 0 for no label */
    const uint16_t
        *shares; /* of CTS_WHOLE_SHARE: how much of each the label of value `shared_value` fills; NULL: all */
    uint16_t shared_value;
} CtsMaskPlane;

/* Planes that lie parallel, in any order. Pixel (i, j) of plane p has its centre at
 * position_lps[p] + i * step_lps[0] + j * step_lps[1]. */
typedef struct CtsMask {
    int columns, rows, n_planes;
    double step_lps[2][3];
    double (*position_lps)[3];
    double gap_mm; /* between planes where none is missing; 0: not known */
    CtsStatus (*plane)(void *context, int number, CtsMaskPlane *plane, CtsError *err);
    void *context;
    const int32_t *label_of; /* CTS_MASK_VALUES: label index of each value, -1: none */
} CtsMask;

/* Directions dual to the pixel steps, within their plane: pixel = inverse * (point - position). False where the steps
 * span no plane. */
bool cts_mask_axes(const double step_lps[2][3], double inverse[2][3]);

/* Adds runs and fractions to the labels, sorted. Warns about parts outside the volume; adds the volume of the mask's
 * labels to held_mm3. A mask whose pixels are no scanned voxels must have no two planes in one place; with only_on_grid
 * (may be NULL) it is left alone, and *only_on_grid false. */
CtsStatus cts_mask_place(const CtsMask *mask, const CtsLabelReading *reading, bool *only_on_grid, double *held_mm3,
                         CtsError *err);

/* Refuses a file whose labels are not empty (held, in any unit) but have no voxel in the scan. */
CtsStatus cts_label_check_meets(const CtsLabelReading *reading, double held, CtsError *err);
