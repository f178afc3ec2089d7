/* What there is to do: the series of an archive, found in one search and kept out of memory. */
#ifndef CTS_BATCH_BATCH_PLAN_H
#define CTS_BATCH_BATCH_PLAN_H

#include "app/batch/batch.h"
#include "base/hash.h"

typedef struct CtsPlan CtsPlan;

/* A segmentation or a structure set that the search has met, and the study that it is of. */
typedef struct CtsBatchLabelFile {
    char *path, *study_uid;
} CtsBatchLabelFile;

/* Files of one SeriesInstanceUID, or of one folder where files have none. */
typedef struct CtsPlanSeries {
    char own_uid[80];   /* as in the files; "uid-" and 16 hex digits where they have none */
    char uid[80];       /* what the batch calls it: the same, or a UID that stands for it under the key */
    char folder[80];    /* that UID where it is a valid one, else "uid-" and 16 hex digits */
    const char **paths; /* in order */
    int n_paths;
    char input_sha256[65]; /* of the files' SOP UIDs, sizes and times, and of what is known of its label files */
    uint64_t n_voxels;
    char *text;                           /* what paths points into */
    const CtsBatchLabelFile *label_files; /* n_label_files, of all series; the plan's */
    size_t n_label_files;
    const CtsStudyNumbers *numbers; /* of the slices of all series; the plan's */
} CtsPlanSeries;

typedef struct CtsPlanFound {
    size_t n_series;
    CtsArchiveCounts counts;
    const CtsArchives *archives; /* the zip files among the paths, unpacked; NULL: there are none. The plan's */
} CtsPlanFound;

/* The list of files is kept below -O, in a file without a name. key: series are named under it; NULL: as they are. Both
 * are the caller's, as long as the plan is there. Memory: 32 to 48 bytes a file and 24 a series. Files that cannot be
 * read go with the one series that has slices in their folder; where none or several have, they are one of their own.
 * Each folder that cannot be searched is a warning, up to a dozen. */
CtsStatus cts_plan_new(CtsPlan **plan, const CtsBatchSettings *settings, const CtsKey *key, CtsPlanFound *found,
                       CtsError *err);
void cts_plan_free(CtsPlan **plan);

/* Series i in the order in which their first files were met. Free with cts_plan_series_free(). */
CtsStatus cts_plan_series(const CtsPlan *plan, size_t i, CtsPlanSeries *series, CtsError *err);
void cts_plan_series_free(CtsPlanSeries *series);

#endif
