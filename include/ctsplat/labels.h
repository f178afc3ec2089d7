/* Labels: which of the scanned slices' voxels each of them holds, and what is counted of them. */
#ifndef CTSPLAT_LABELS_H
#define CTSPLAT_LABELS_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

struct CtsStored;    /* src/core/volume/stored.h */
struct CtsLabelSums; /* src/core/labels/label_sums.c */
/* Where the scanned voxels lie: voxel (i, j) of slice k has its centre at
 * position_lps[k] + i * step_lps[0] + j * step_lps[1]. */
typedef struct CtsLabelGrid {
    int columns, rows, n_slices;
    double step_lps[2][3]; /* mm */
    double normal_lps[3];  /* unit length; the slices' places along it rise */
    double (*position_lps)[3];
    double *at_mm;        /* of each slice along the normal */
    double *thickness_mm; /* half the sum of the gaps on both sides; at an end the one gap */
} CtsLabelGrid;

/* Voxels first <= i < end of a row; row j of slice k is number k * rows + j. */
typedef struct CtsLabelRun {
    uint32_t row;
    uint16_t first, end;
} CtsLabelRun;

/* A voxel that a label fills in part, of a FRACTIONAL segmentation or a mask on another grid: which share of
 * CTS_WHOLE_SHARE. It is in a run as well where that, or the mask's nearest voxel, says so. */
enum { CTS_WHOLE_SHARE = 65535 };
typedef struct CtsLabelShare {
    uint32_t row;
    uint16_t column, share;
} CtsLabelShare;

typedef struct CtsLabel {
    CtsLabelFact fact; /* its counts once cts_labels_count() has been called; the name is owned */
    bool surrounds;    /* the body's outline, or what supports it: owns what nothing else does */
    size_t object;     /* 1 + which of the objects it is a BINARY segment of, in the series' space; else 0 */
    bool coloured;     /* the file has a colour for it, */
    double rgb[3];     /* display values 0..1 */
    CtsLabelRun *runs; /* n_runs, by rising row and place; no two touch; owned */
    size_t n_runs;
    CtsLabelShare *shares; /* n_shares, by rising row and column; of other voxels it has all or nothing; owned */
    size_t n_shares;
    struct CtsLabelSums *sums; /* while slices are read */
} CtsLabel;

/* A DICOM object that labels come from; UIDs, "" where it has none. */
typedef struct CtsLabelObject {
    char class_uid[65], sop_uid[65], series_uid[65], study_uid[65];
} CtsLabelObject;

/* A name for several labels of one file, as nnU-Net's regions are. */
typedef struct CtsLabelRegion {
    int file;     /* the how manyth, from 1 */
    char *name;   /* owned */
    int *numbers; /* n, of labels that the file may have; owned */
    size_t n;
} CtsLabelRegion;

typedef struct CtsLabels {
    CtsLabelGrid grid;       /* owned */
    CtsLabelObject *objects; /* n_objects; owned */
    size_t n_objects;
    CtsLabel *items; /* n, in the order of the files, in each by rising number */
    size_t n;
    CtsLabelRegion *regions; /* n_regions; owned */
    size_t n_regions;
    bool counted;
} CtsLabels;

void cts_labels_free(CtsLabels **labels);

/* Before slices are read: room for the sums over their HU. */
CtsStatus cts_labels_begin(CtsLabels *labels, CtsError *err);
/* Words first <= n < end of a slice as it is stored, from `words` on: HU = slope * stored + intercept. In order, each
 * slice from one thread at a time; a slice that begins anew replaces what was told of it before. */
void cts_labels_take_words(CtsLabels *labels, int slice, const uint16_t *words, size_t first, size_t end,
                           const struct CtsStored *stored, double slope, double intercept);
/* Once all slices were read: slice_number[k], n_kept of them, rising, are those that were. The grid and the runs become
 * theirs alone, and all is counted; report (may be NULL) gets the facts and warnings. */
CtsStatus cts_labels_count(CtsLabels *labels, const int *slice_number, int n_kept, CtsReport *report, CtsError *err);

/* What is to be seen of the labels. A list has commas between names (* stands for any letters, capitals are small
 * letters), numbers as the files have them, N:NAME for the label of the N-th file, `all` labels and the `rest`. A name
 * may hold commas: the longest one that fits is taken; or the list is a JSON array of names. */
typedef struct CtsLabelChoice {
    const char *show;  /* all else is hidden, and labels that it does not name count as rest; NULL: all is shown */
    const char *hide;  /* hidden, whatever show says; NULL: nothing */
    const char *order; /* own what several labels hold, the first named first; then the smallest; NULL: none */
    const char *const *looks; /* n_looks times NAME=LOOK: a preset, #RRGGBB or #RRGGBB:OPACITY; the last one holds */
    int n_looks;
    bool show_present; /* names in show that no label has are left out, not refused */
    bool own_colours;  /* labels without a look have their files' colours, or one of a table */
} CtsLabelChoice;

/* The names of a list `show` that these labels lack, with commas between them, to be freed with free(); *any: there are
 * some that they have. */
CtsStatus cts_labels_lacking(const CtsLabels *labels, const char *show, char **lacking, bool *any, CtsError *err);

/* Gives the volume's voxels their owners, the last thing that is done to it: counted labels of the slices that it was
 * made of. Where nothing is hidden and all looks alike it stays without. CTS_ERR_USAGE for what names no label. */
CtsStatus cts_volume_take_labels(CtsVolume *volume, const CtsLabels *labels, const CtsLabelChoice *choice,
                                 int n_threads, CtsReport *report, CtsError *err);

/* What of a choice can be said by whole segments, as PS3.3 C.11.24 crops: those alone that are included, without those
 * that are excluded. Of labels that come from BINARY segmentations of that study, and hide no more nor less than the
 * picture does. crop[i], of labels->n, all CTS_CROP_NONE before: of label i. *unsaid: why some of it cannot be said, or
 * NULL. */
typedef enum CtsLabelCrop { CTS_CROP_NONE, CTS_CROP_INCLUDE, CTS_CROP_EXCLUDE } CtsLabelCrop;
CtsStatus cts_labels_crop(const CtsLabels *labels, const CtsLabelChoice *choice, const char *study_uid,
                          CtsLabelCrop *crop, const char **unsaid, CtsError *err);

/* The colours in which a volume shows labels: of the i-th, in rgb; its name, which is the volume's, and its number in
 * its file; NULL past the last. */
const char *cts_volume_label_colour(const CtsVolume *volume, size_t i, double rgb[3], int *number);

CTS_API_END
#endif
