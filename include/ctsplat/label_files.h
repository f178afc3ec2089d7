/* Label files of one series: DICOM Segmentations, RT Structure Sets, NIfTI label maps and folders of masks. */
#pragma once

#include "ctsplat/labels.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"

CTS_API_BEGIN

typedef struct CtsLabelRequest {
    const char *const *paths; /* files, folders of masks, "auto"; {series_uid}, {stem} and * are filled in */
    int n_paths;
    const char *names; /* file with names for the numbers of label maps; NULL: none */
    /* paths that were searched for the series: auto searches these and its slices' folders */
    const char *const *series_paths;
    int n_series_paths;
    bool listed;                 /* label_paths are all files that auto may use, members of archives too */
    const CtsArchives *archives; /* archives that contain some of them; or NULL */
    bool unnamed;                /* messages identify a label file by its number, not by its path */
} CtsLabelRequest;

/* The labels of a series, as runs of its slices' voxels, without statistics yet; free with cts_labels_free(). The
 * report gets notes and warnings; messages name the file. CTS_ERR_READ for an unreadable file, CTS_ERR_GEOMETRY or
 * CTS_ERR_PIXELS for labels of another patient or position, or invalid ones. */
CtsStatus cts_labels_read(const CtsLabelRequest *request, const CtsSeries *series, CtsLabels **labels,
                          CtsReport *report, CtsError *err);

/* The series that one of the label files refers to or shares its frame of reference with; else the default choice. */
CtsStatus cts_labels_choose(const CtsLabelRequest *request, const CtsSeriesList *list, const CtsSeries **series,
                            CtsError *err);

/* Names, sizes and times of the files that one of request's paths names for a series: a text that changes where they
 * do, to be freed with free(). Of "auto" it is empty. ct: the path of a NIfTI CT, else NULL. */
CtsStatus cts_labels_stamp(const char *path, const char *series_uid, const char *ct, char **stamp, CtsError *err);

CTS_API_END
