/* What the readers of label files share. */
#ifndef CTS_LABELS_LABEL_READING_H
#define CTS_LABELS_LABEL_READING_H

#include "base/file_bytes.h"
#include "core/labels/label_set.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "dicom/header/head.h"
#include "input/files/nifti.h"
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

/* A JSON object of names by number or of numbers by name, nnU-Net's dataset.json, which has one as its "labels" and
 * may have regions there, or a table of ITK-SNAP, with colours. what: how messages call it. CTS_ERR_USAGE when it is
 * none of these. */
CtsStatus cts_label_names_parse(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err);
CtsStatus cts_label_names_read(const char *path, CtsLabelNames *names, CtsError *err);
/* Caret's XML (<Label Key="1">liver</Label>); names stays as it was where there is none. */
CtsStatus cts_label_names_xml(const char *text, size_t n, CtsLabelNames *names, CtsError *err);
void cts_label_names_free(CtsLabelNames *names);

/* NULL: it has none. */
const CtsLabelName *cts_label_names_find(const CtsLabelNames *names, int number);

/* A DICOM object whose header is held in memory and whose pixels are read frame by frame. */

typedef struct CtsPlainObject {
    CtsHead head;
    CtsScratch scratch;
    char class_uid[65], charset[65];
    const CtsSyntax *syntax;
    CtsElements elements;                       /* in front of the pixels */
    bool has_pixels, encapsulated, pixel_words; /* pixel_words: of 16 bits (OW), which big-endian files swap */
    CtsFileBytes source;                        /* of the pixels: the file, or a deflated data set */
    uint8_t *inflated;                          /* owned: that data set; else NULL */
    uint64_t pixel_offset, pixel_bytes;         /* of the value; where encapsulated all that is left of the source */
} CtsPlainObject;

/* Whether a file that begins so is DICOM; class_uid may then be "" (no meta header, or deflated). */
bool cts_plain_is_dicom(const uint8_t *head, size_t n, char class_uid[65]);

/* Close in any case. CTS_ERR_READ for what is damaged or claims more bytes than the file has. */
CtsStatus cts_plain_open(CtsPlainObject *object, const CtsFile *file, CtsError *err);
void cts_plain_close(CtsPlainObject *object);

/* A text as UTF-8, by the object's character set, cut to its size. */
void cts_plain_text(const CtsPlainObject *object, CtsElements elements, uint32_t tag, char *text, size_t size);

/* What the readers of label files share. */

/* One file on its way into the labels of one series. */
typedef struct CtsLabelReading {
    const CtsSeries *series;
    CtsLabels *labels;
    int file;                   /* the how manyth, from 1 */
    const char *name;           /* of a mask that is named by its file; else NULL */
    int number;                 /* of such a mask */
    const CtsLabelNames *names; /* for a label map's numbers; or NULL */
    CtsReport *report;          /* may be NULL */
} CtsLabelReading;

/* Readers of one object each. It was opened and belongs to the patient. */
CtsStatus cts_label_read_seg(const CtsLabelReading *reading, const CtsPlainObject *object, CtsError *err);
CtsStatus cts_label_read_rtstruct(const CtsLabelReading *reading, const CtsPlainObject *object, CtsError *err);
CtsStatus cts_label_read_nifti(const CtsLabelReading *reading, const CtsFileBytes *file, CtsError *err);

/* Which of a label map's two forms holds: where they differ the one that equals the series' grid. CTS_ERR_GEOMETRY
 * where they contradict each other and neither does, or both do. */
CtsStatus cts_label_take_form(const CtsLabelReading *reading, CtsNifti *nifti, CtsError *err);

/* The scanned slices of a series as a grid; free with cts_label_grid_free(). */
CtsStatus cts_label_grid_of(CtsLabelGrid *grid, const CtsSeries *series, CtsError *err);

/* The name of a file without its folders and its ending .nii or .nii.gz. */
void cts_label_stem(const char *path, char *stem, size_t size);

/* What a pattern with {series_uid}, {stem} and * names for a series; free with cts_label_paths_free(). ct: the path of
 * a NIfTI CT, or NULL, for which {stem} names nothing. One that names a single file names it whether it is there or
 * not. */
typedef struct CtsLabelPaths {
    char **items;
    size_t n;
} CtsLabelPaths;
CtsStatus cts_label_paths(const char *pattern, const char *uid, const char *ct, CtsLabelPaths *paths, CtsError *err);
void cts_label_paths_free(CtsLabelPaths *paths);

/* Whether an object names the series, or one of its slices. */
bool cts_label_refers(CtsElements elements, const CtsSeries *series);
bool cts_label_shares_space(const char *frame_uid, const CtsSeries *series);
/* Its patient is the series', and so is its space: frame_uid, "" where it tells none. */
CtsStatus cts_label_check_patient(const CtsLabelReading *reading, const CtsPlainObject *object, CtsError *err);
CtsStatus cts_label_check_space(const CtsLabelReading *reading, const CtsPlainObject *object, const char *frame_uid,
                                CtsError *err);

/* Masks on a grid of their own -> runs of the scanned voxels, each of which takes the mask's voxel nearest to it, and
 * shares of those that the mask's own field fills in part. */

enum { CTS_MASK_VALUES = 65536 };

/* A plane's pixels, valid until the next is read. */
typedef struct CtsMaskPlane {
    const uint16_t *values; /* 0 for no label */
    const uint16_t *shares; /* of CTS_WHOLE_SHARE: how much of each the label of value `sharer` fills; NULL: all */
    uint16_t sharer;
} CtsMaskPlane;

/* Planes that lie parallel, in any order. Pixel (i, j) of plane p has its centre at
 * position_lps[p] + i * step_lps[0] + j * step_lps[1]. */
typedef struct CtsMask {
    int columns, rows, n_planes;
    double step_lps[2][3];
    double (*position_lps)[3];
    double gap_mm; /* from plane to plane where none is left out; 0: not known */
    CtsStatus (*plane)(void *context, int number, CtsMaskPlane *plane, CtsError *err);
    void *context;
    const int32_t *label_of; /* CTS_MASK_VALUES: which of the labels, -1: none */
} CtsMask;

/* Directions dual to the pixel steps, within their plane: pixel = inverse * (point - position). False where the steps
 * span no plane. */
bool cts_mask_axes(const double step_lps[2][3], double inverse[2][3]);

/* *on_grid: whether its pixels are scanned voxels. Where they are not, no two planes may lie in one place. */
CtsStatus cts_mask_is_on_grid(const CtsMask *mask, const CtsLabelGrid *grid, bool *on_grid, CtsError *err);

/* Runs and shares are added to the labels, and sorted. What lies outside the volume is told; held_mm3 is added to: what
 * the mask's labels hold. */
CtsStatus cts_mask_place(const CtsMask *mask, const CtsLabelReading *reading, double *held_mm3, CtsError *err);

/* Refuses a file that holds something, in any unit, and has no voxel in the scan. */
CtsStatus cts_label_check_meets(const CtsLabelReading *reading, double held, CtsError *err);

/* Warns of a label of which so much, in any unit, lies outside. */
void cts_label_tell_share(const CtsLabelReading *reading, const CtsLabel *label, double inside, double whole);

#endif
