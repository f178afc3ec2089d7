/* Assignment of a volume's voxels to labels, or to none (unlabelled), and the appearance of each.
 *
 * At scanned voxels a label's field is 1 where the voxel is assigned to it and 0 elsewhere, or its fraction of the
 * voxel; between two slices it is linear, and trilinear within a cell; the label with the largest field gets a point,
 * of equal ones that with the lower number (Feng, Ju, Warren: "Piecewise Tri-linear Contouring for Multi-Material
 * Volumes", 2010). */
#pragma once

#include "ctsplat/labels.h"
#include "ctsplat/model.h"
#include "ctsplat/preset.h"
#include <stdint.h>

/* Appearances common to all pictures with labels; labels' own ones follow. */
enum {
    CTS_APPEARANCE_HIDDEN,
    CTS_APPEARANCE_PRESET,
    CTS_APPEARANCE_OWN,
    CTS_MAX_APPEARANCES = 255,
    CTS_APPEARANCES_DIFFER = 255
};

/* An appearance: invisible; as the picture's preset; or a preset of its own, a colour of its own, or a constant opacity
 * per mm for all HU. */
typedef struct CtsAppearance {
    CtsPreset *preset; /* owned; NULL: the picture's */
    bool tinted;
    double rgb[3];  /* colour, if it has one of its own */
    double opacity; /* of a body; below 0: no body */
} CtsAppearance;

/* A voxel with fractions of several labels, in units of 1 / CTS_WHOLE_SHARE: the largest ones first, 0 after the
 * last. */
enum { CTS_MAX_FRACTIONS = 4 };
typedef struct CtsFractionalVoxel {
    uint32_t at; /* in its plane */
    uint16_t voxel_label[CTS_MAX_FRACTIONS], share[CTS_MAX_FRACTIONS];
} CtsFractionalVoxel;

/* For qsort() and bsearch(). */
static inline int cts_fractional_by_place(const void *a, const void *b)
{
    const uint32_t p = ((const CtsFractionalVoxel *)a)->at, q = ((const CtsFractionalVoxel *)b)->at;
    return (p > q) - (p < q);
}

typedef struct CtsFractionalPlane {
    CtsFractionalVoxel *items; /* n, by rising place; owned */
    size_t n;
} CtsFractionalPlane;

typedef struct CtsVoxelLabels {
    int dims[3]; /* the volume's */
    int n_planes;
    uint16_t *voxel_label; /* n_planes scanned slices of dims[0] x dims[1] voxels, which the volume's layers lie on or
                              between */
    CtsFractionalPlane *shared; /* of each plane, voxels with fractions; `voxel_label` has the first label of each */
    uint64_t *is_shared;        /* a bit for each voxel of `voxel_label`; NULL where none has fractions */
    int *plane;                 /* of each layer: the slice at or before it, */
    double *share;              /* and how much of the one behind it counts, 0 to 1 */
    int n;                      /* number of labels, and one for unlabelled voxels as the last */
    uint8_t *appearance;        /* of each label */
    CtsAppearance *appearances;
    int n_appearances;
    uint8_t *block; /* of each fine macro-cell: the common appearance of its voxels, or CTS_APPEARANCES_DIFFER */
    int n_block[3]; /* fine macro-cells along each axis */
    char **name;    /* of each visible label with a colour of its own; else NULL */
    int *number;    /* of each such label, in its file */
    bool *on_skin;  /* of each label: it may contain skin, as unlabelled voxels always may */
    CtsModel shown; /* the model with air for hidden voxels; its volume is NULL where nothing is hidden */
} CtsVoxelLabels;

/* With the fields volume and n, without planes, but with room for n_planes; free with cts_voxel_labels_free(). */
CtsStatus cts_voxel_labels_new(CtsVoxelLabels **voxel_labels, const CtsVolume *volume, int n, int n_planes,
                               CtsError *err);
/* To be called after assignment and appearances of model->voxel_labels: computes blocks and visible ranges. */
CtsStatus cts_voxel_labels_finish(CtsModel *model, int n_threads, CtsError *err);
/* A step of finishing that is a file of its own: fills on_skin. */
CtsStatus cts_voxel_labels_find_skin(CtsVoxelLabels *voxel_labels, const CtsVolume *volume, int n_threads,
                                     CtsError *err);
void cts_voxel_labels_free(CtsVoxelLabels **voxel_labels);

/* True where a label has an appearance of its own. */
static inline bool cts_voxel_labels_coloured(const CtsVoxelLabels *voxel_labels)
{
    return voxel_labels && voxel_labels->n_appearances > CTS_APPEARANCE_OWN;
}

/* The model with air for hidden voxels, or the model itself where nothing is hidden. */
static inline const CtsModel *cts_model_shown(const CtsModel *model)
{
    return model->voxel_labels && model->voxel_labels->shown.volume ? &model->voxel_labels->shown : model;
}

/* The effective preset of an appearance, given the picture's. */
void cts_appearance_preset(const CtsAppearance *appearance, const CtsPreset *picture, CtsPreset *preset);

/* The label of a voxel of the volume. */
int cts_label_of_voxel(const CtsVoxelLabels *voxel_labels, int i, int j, int k);
static inline int cts_appearance_of_voxel(const CtsVoxelLabels *voxel_labels, int i, int j, int k)
{
    return voxel_labels->appearance[cts_label_of_voxel(voxel_labels, i, j, k)];
}

/* The labels in one cell, by rising number, and their fields at its vertices: bit a of a vertex's number is its
 * position along axis a. */
/* More than 16 occur only with fractions; labels beyond CTS_MAX_CELL_LABELS are omitted. */
enum { CTS_MAX_CELL_LABELS = 24 };
typedef struct CtsCellLabels {
    int n;
    int voxel_label[CTS_MAX_CELL_LABELS];
    double corner[CTS_MAX_CELL_LABELS][8];
} CtsCellLabels;
void cts_cell_labels(const CtsVoxelLabels *voxel_labels, const int cell[3], CtsCellLabels *in_cell);
/* The common appearance of the labels of a scanned voxel, or of a cell; else CTS_APPEARANCES_DIFFER. */
int cts_appearance_of_scanned_voxel(const CtsVoxelLabels *voxel_labels, size_t at);
int cts_appearance_of_cell(const CtsVoxelLabels *voxel_labels, const int cell[3]);

/* Intervals of a line through a cell, in order: each ends where the appearance changes, `end` rising to 1. Ends have an
 * error of at most 1e-7 of the line; a shorter interval may be missed. */
enum { CTS_MAX_CELL_INTERVALS = 64 };
typedef struct CtsLineInterval {
    double end;
    int appearance;
} CtsLineInterval;
/* from and to: within the cell, 0 to 1. Returns how many there are. */
int cts_label_intervals(const CtsVoxelLabels *voxel_labels, const int cell[3], const double from[3], const double to[3],
                        CtsLineInterval interval[CTS_MAX_CELL_INTERVALS]);
/* The trilinear field of eight vertices, bit a of a vertex's number being its place along axis a. */
double cts_cell_at(const double v[8], double x, double y, double z);
/* The same for such a field: hidden where it lies below the threshold, elsewhere as the preset. */
int cts_threshold_intervals(const double corner[8], double threshold, const double from[3], const double to[3],
                            CtsLineInterval interval[CTS_MAX_CELL_INTERVALS]);
