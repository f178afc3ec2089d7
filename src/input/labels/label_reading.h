/* What the readers of label files share. */
#ifndef CTS_LABELS_LABEL_READING_H
#define CTS_LABELS_LABEL_READING_H

#include "core/labels/label_set.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "input/files/file_bytes.h"
#include "input/labels/label_names.h"
#include "input/labels/plain_object.h"

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

/* The scanned slices of a series as a grid; free with cts_label_grid_free(). */
CtsStatus cts_label_grid_of(CtsLabelGrid *grid, const CtsSeries *series, CtsError *err);

/* A pattern with the series' UID in it, to be freed with free(); NULL without memory. */
char *cts_label_path(const char *pattern, const char *uid);

/* Whether an object names the series, or one of its slices. */
bool cts_label_refers(CtsElements elements, const CtsSeries *series);
bool cts_label_shares_space(const char *frame_uid, const CtsSeries *series);
/* Its patient is the series', and so is its space: frame_uid, "" where it tells none. */
CtsStatus cts_label_check_patient(const CtsLabelReading *reading, const CtsPlainObject *object, CtsError *err);
CtsStatus cts_label_check_space(const CtsLabelReading *reading, const CtsPlainObject *object, const char *frame_uid,
                                CtsError *err);

#endif
