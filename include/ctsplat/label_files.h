/* Label files of one series: DICOM Segmentations, RT Structure Sets, NIfTI label maps and folders of masks. */
#ifndef CTSPLAT_LABEL_FILES_H
#define CTSPLAT_LABEL_FILES_H

#include "ctsplat/labels.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"

CTS_API_BEGIN

typedef struct CtsLabelRequest {
    const char *const *paths; /* files, folders of masks, "auto"; {series_uid}, {stem} and * are filled in */
    int n_paths;
    const char *names;               /* a file of names for the numbers of label maps; NULL: none */
    const char *const *series_paths; /* where the series was looked for: auto looks there and beside its slices */
    int n_series_paths;
    bool listed;                 /* these are all label files that auto may take, members of archives too */
    const CtsArchives *archives; /* that hold some of them; or NULL */
    bool unnamed;                /* messages tell a label file by its number, not by its path */
} CtsLabelRequest;

/* The labels of a series, as runs of its slices' voxels, not counted yet; free with cts_labels_free(). What is odd
 * about the files goes into the report; messages name the file. CTS_ERR_READ for what cannot be read, CTS_ERR_GEOMETRY
 * or CTS_ERR_PIXELS for labels of another patient or place, or without sense. */
CtsStatus cts_labels_read(const CtsLabelRequest *request, const CtsSeries *series, CtsLabels **labels,
                          CtsReport *report, CtsError *err);

/* The series that one of the label files names or shares its space with; else the one that would be taken. */
CtsStatus cts_labels_choose(const CtsLabelRequest *request, const CtsSeriesList *list, const CtsSeries **series,
                            CtsError *err);

/* Names, sizes and times of the files that one of request's paths names for a series: a text that changes where they
 * do, to be freed with free(). Of "auto" it is empty. ct: the path of a NIfTI CT, else NULL. */
CtsStatus cts_labels_stamp(const char *path, const char *series_uid, const char *ct, char **stamp, CtsError *err);

CTS_API_END
#endif
