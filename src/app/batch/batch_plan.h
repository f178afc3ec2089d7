/* The series of an archive, found in one search; the list of files is kept on disk. */
#pragma once

#include "app/batch/batch.h"
#include "base/hash.h"

typedef struct CtsBatchPlan CtsBatchPlan;

/* A segmentation or a structure set that the search has met, and the study that it is of. */
typedef struct CtsBatchLabelFile {
    char *path, *study_uid;
} CtsBatchLabelFile;

/* Files of one SeriesInstanceUID, or of one folder where files have none. */
typedef struct CtsPlanSeries {
    char own_uid[80];   /* as in the files; "uid-" and 16 hex digits where they have none */
    char uid[80];       /* name in the batch: the same, or a pseudonymous UID under the key */
    char folder[80];    /* that UID where it is valid, else "uid-" and 16 hex digits */
    const char **paths; /* in order; their texts are the plan's */
    int n_paths;
    char input_sha256[65]; /* hash of the files' SOP UIDs, sizes and times, and of its label files */
    uint64_t n_voxels;
    int64_t newest_ns; /* time at which the last of the files came, since 1970; 0 without `settled` */
    int n_stacked;     /* slices of the stack that its single slice lies in, with those of other series; 0: in none */
    const CtsBatchLabelFile *label_files; /* n_label_files, of all series; the plan's */
    size_t n_label_files;
    const CtsStudyNumbers *numbers; /* of the slices of all series; the plan's */
} CtsPlanSeries;

typedef struct CtsPlanFound {
    size_t n_series;
    CtsArchiveCounts counts;
    const CtsArchives *archives; /* zip files among the paths, unpacked; owned by the plan; NULL: none */
} CtsPlanFound;

/* The list of files is kept below -O, in an unlinked file. key: series are named under it; NULL: named as they are.
 * Both belong to the caller and must outlive the plan. Memory: 16 to 32 bytes per file and about 170 per series. Each
 * stack of single slices causes a note. Unreadable
 * files are reported with the only series in their folder; where it has none or several, they form one of their own.
 * Each folder that cannot be searched causes a warning, up to a dozen. */
CtsStatus cts_plan_new(CtsBatchPlan **plan, const CtsBatchSettings *settings, const CtsKey *key, CtsPlanFound *found,
                       CtsError *err);
void cts_plan_free(CtsBatchPlan **plan);

/* Series i in the order in which their first files were met. Free with cts_plan_series_free(). */
CtsStatus cts_plan_series(const CtsBatchPlan *plan, size_t i, CtsPlanSeries *series, CtsError *err);
void cts_plan_series_free(CtsPlanSeries *series);
