/* Labels: sets of voxels of the scanned slices, and their statistics. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

struct CtsStored;    /* src/core/volume/stored.h */
struct CtsLabelSums; /* src/core/labels/label_sums.c */
/* Geometry of the scanned voxels: voxel (i, j) of slice k has its centre at position_lps[k] + i * step_lps[0] + j *
 * step_lps[1]. */
typedef struct CtsLabelGrid {
    int columns, rows, n_slices;
    double step_lps[2][3]; /* mm */
    double normal_lps[3];  /* unit length; slices are in order of position along it */
    double (*position_lps)[3];
    CtsQuantity quantity; /* of the voxels */
} CtsLabelGrid;

/* Voxels first <= i < end of a row; row j of slice k is number k * rows + j. */
typedef struct CtsLabelRun {
    uint32_t row;
    uint16_t first, end;
} CtsLabelRun;

/* A voxel that a label fills in part, of a FRACTIONAL segmentation or a mask on another grid: its fraction of
 * CTS_WHOLE_SHARE. It is in a run too if the fraction is at least one half, or the mask's nearest voxel is set. */
enum { CTS_WHOLE_SHARE = 65535 };
typedef struct CtsLabelShare {
    uint32_t row;
    uint16_t column, share;
} CtsLabelShare;

typedef struct CtsLabel {
    CtsLabelFact fact; /* its counts once cts_labels_count() has been called; the name is owned */
    bool surrounds;    /* the body's outline, or its support: gets only voxels that no other label has */
    size_t object;     /* 1 + which of the objects it is a BINARY segment of, in the series' space; else 0 */
    bool coloured;     /* the file has a colour for it, */
    double rgb[3];     /* display values 0..1 */
    CtsLabelRun *runs; /* n_runs, by rising row and position; not adjacent; owned */
    size_t n_runs;
    CtsLabelShare *shares; /* n_shares, by rising row and column; of other voxels it has all or nothing; owned */
    size_t n_shares;
    struct CtsLabelSums *sums; /* while slices are read */
} CtsLabel;

/* A DICOM object with labels; UIDs, "" where missing. */
typedef struct CtsLabelObject {
    char class_uid[65], sop_uid[65], series_uid[65], study_uid[65];
} CtsLabelObject;

/* A name for several labels of one file, as nnU-Net's regions are. */
typedef struct CtsLabelRegion {
    int file;     /* index of the label file, from 1 */
    char *name;   /* owned */
    int *numbers; /* n, of labels that the file may have; owned */
    size_t n;
} CtsLabelRegion;

/* A label that cannot be in this scan, such as a structure of another frame of reference. */
typedef struct CtsLabelLeftOut {
    CtsLabelFact fact; /* without counts; the name is owned */
    char *reason;      /* owned */
} CtsLabelLeftOut;

typedef struct CtsLabels {
    CtsLabelGrid grid;       /* owned */
    CtsLabelObject *objects; /* n_objects; owned */
    size_t n_objects;
    CtsLabel *items; /* n, in the order of the files, in each by rising number */
    size_t n;
    CtsLabelRegion *regions; /* n_regions; owned */
    size_t n_regions;
    CtsLabelLeftOut *left_out; /* n_left_out; owned */
    size_t n_left_out;
    bool counted;
} CtsLabels;

void cts_labels_free(CtsLabels **labels);

/* Before slices are read: room for the sums over their HU. */
CtsStatus cts_labels_begin(CtsLabels *labels, CtsError *err);
/* Adds words first <= n < end of a slice as stored, from `words` on, to the statistics: HU = slope * stored +
 * intercept (CtsWordWatch.take). In order, each slice by one thread at a time; a slice that begins again replaces its
 * former statistics. labels: a CtsLabels. */
void cts_labels_take_words(void *labels, int slice, const uint16_t *words, size_t first, size_t end,
                           const struct CtsStored *stored, double slope, double intercept);
/* Once all slices were read: slice_number[k], n_kept of them, rising, are those that were. The grid and the runs become
 * theirs alone, and all is counted; report (may be NULL) gets the facts and warnings. */
CtsStatus cts_labels_count(CtsLabels *labels, const int *slice_number, int n_kept, CtsReport *report, CtsError *err);

/* Visibility and appearance of labels. A list has names separated by commas (* stands for any characters, case does not
 * matter), numbers as in the files, N:NAME for a label of the N-th file, `all` labels and `rest`, the unlabelled
 * voxels. A name may contain commas: the longest match is used; or the list is a JSON array of names. */
typedef struct CtsLabelChoice {
    const char *show;  /* all others are hidden, and labels not named count as unlabelled; NULL: all are visible */
    const char *hide;  /* hidden, whatever show says; NULL: none */
    const char *order; /* labels that get overlapping voxels, by priority; then the smallest; NULL: none */
    const char *const
        *appearances; /* n_appearances times NAME=LOOK: a preset, #RRGGBB or #RRGGBB:OPACITY; the last one applies */
    int n_appearances;
    bool show_present; /* unknown names in show are skipped; else with a warning, and refused where all are unknown */
    bool own_colours;  /* labels without an appearance get their files' colours, or one of a table */
} CtsLabelChoice;

/* The names in a list `show` that these labels lack, separated by commas, as many as a message holds; *any: some names
 * exist. */
enum { CTS_LACKING_TEXT = 400 };
CtsStatus cts_labels_lacking(const CtsLabels *labels, const char *show, char lacking[CTS_LACKING_TEXT], bool *any,
                             CtsError *err);

/* True if an appearance of the choice may show air: a body whose opacity is the same for all HU, or a preset that has
 * one there. */
bool cts_labels_show_air(const CtsLabelChoice *choice);

/* Assigns the model's voxels to labels, which replace earlier ones: labels with statistics, of the slices that the
 * volume was made of. Skipped where no label is hidden or has an appearance of its own. CTS_ERR_USAGE for an unknown
 * label. */
CtsStatus cts_model_take_labels(CtsModel *model, const CtsLabels *labels, const CtsLabelChoice *choice, int n_threads,
                                CtsReport *report, CtsError *err);

/* The part of a choice that cropping by whole segments can express (PS3.3 C.11.24): only the included ones, without the
 * excluded ones. Only for labels of BINARY segmentations of that study, if the result equals the picture's. crop[i], of
 * labels->n, initially CTS_CROP_NONE: of label i. *unsaid: the reason why a part cannot be expressed, or NULL. */
typedef enum CtsLabelCrop { CTS_CROP_NONE, CTS_CROP_INCLUDE, CTS_CROP_EXCLUDE } CtsLabelCrop;
CtsStatus cts_labels_crop(const CtsLabels *labels, const CtsLabelChoice *choice, const char *study_uid,
                          CtsLabelCrop *crop, const char **unsaid, CtsError *err);

/* The legend of a model's labels: the colour of the i-th, in rgb; returns its name, owned by the model, and its
 * number in its file; NULL past the last. */
const char *cts_model_label_colour(const CtsModel *model, size_t i, double rgb[3], int *number);

CTS_API_END
