/* Assignment of a volume's voxels to labels, or to none (unlabelled), and the appearance of each.
 *
 * At scanned voxels a label's field is 1 where the voxel is assigned to it and 0 elsewhere, or its fraction of the
 * voxel; between two slices it is linear, and trilinear within a cell; the label with the largest field gets a point,
 * of equal ones that with the lower number (Feng, Ju, Warren: "Piecewise Tri-linear Contouring for Multi-Material
 * Volumes", 2010). */
#ifndef CTS_VOLUME_OWNERS_H
#define CTS_VOLUME_OWNERS_H

#include "ctsplat/labels.h"
#include "ctsplat/preset.h"
#include "ctsplat/volume.h"
#include <stdint.h>

/* Appearances common to all pictures with labels; labels' own ones follow. */
enum { CTS_LOOK_HIDDEN, CTS_LOOK_PRESET, CTS_LOOK_OWN, CTS_MAX_LOOKS = 255, CTS_LOOKS_DIFFER = 255 };

/* An appearance: invisible; as the picture's preset; or a preset of its own, a colour of its own, or a constant opacity
 * per mm for all HU. */
typedef struct CtsOwnerLook {
    CtsPreset *preset; /* owned; NULL: the picture's */
    bool tinted;
    double rgb[3];  /* colour, if it has one of its own */
    double opacity; /* of a body; below 0: no body */
} CtsOwnerLook;

/* A voxel with fractions of several labels, in units of 1 / CTS_WHOLE_SHARE: the largest ones first, 0 after the
 * last. */
enum { CTS_SHARERS = 4 };
typedef struct CtsSharedVoxel {
    uint32_t at; /* in its plane */
    uint16_t owner[CTS_SHARERS], share[CTS_SHARERS];
} CtsSharedVoxel;

typedef struct CtsSharedPlane {
    CtsSharedVoxel *items; /* n, by rising place; owned */
    size_t n;
} CtsSharedPlane;

typedef struct CtsOwners {
    int dims[3]; /* the volume's */
    int n_planes;
    uint16_t
        *owner; /* n_planes scanned slices of dims[0] x dims[1] voxels, which the volume's layers lie on or between */
    CtsSharedPlane *shared; /* of each plane, voxels with fractions; `owner` has the first label of each */
    uint64_t *is_shared;    /* a bit for each voxel of `owner`; NULL where none has fractions */
    int *plane;             /* of each layer: the slice at or before it, */
    double *share;          /* and how much of the one behind it counts, 0 to 1 */
    int n;                  /* number of labels, and one for unlabelled voxels as the last */
    uint8_t *look;          /* of each label */
    CtsOwnerLook *looks;
    int n_looks;
    uint8_t *block;   /* of each fine macro-cell: the common appearance of its voxels, or CTS_LOOKS_DIFFER */
    int n_block[3];   /* fine macro-cells along each axis */
    char **name;      /* of each visible label with a colour of its own; else NULL */
    int *number;      /* of each such label, in its file */
    bool *on_skin;    /* of each label: it may contain skin, as unlabelled voxels always may */
    CtsVolume *shown; /* the volume with air for hidden voxels; NULL where nothing is hidden */
} CtsOwners;

/* With the fields volume and n, without planes, but with room for n_planes; free with cts_owners_free(). */
CtsStatus cts_owners_new(CtsOwners **owners, const CtsVolume *volume, int n, int n_planes, CtsError *err);
/* To be called after assignment and appearances: computes blocks and visible ranges. */
CtsStatus cts_owners_finish(CtsOwners *owners, const CtsVolume *volume, int n_threads, CtsError *err);
/* A step of finishing that is a file of its own: fills on_skin. */
CtsStatus cts_owners_find_skin(CtsOwners *owners, const CtsVolume *volume, int n_threads, CtsError *err);
void cts_owners_free(CtsOwners **owners);

/* True where a label has an appearance of its own. */
static inline bool cts_owners_coloured(const CtsOwners *owners)
{
    return owners && owners->n_looks > CTS_LOOK_OWN;
}

/* The effective preset of an appearance, given the picture's. */
void cts_owner_preset(const CtsOwnerLook *look, const CtsPreset *picture, CtsPreset *preset);

/* The label of a voxel of the volume. */
int cts_owner_of_voxel(const CtsOwners *owners, int i, int j, int k);
static inline int cts_look_of_voxel(const CtsOwners *owners, int i, int j, int k)
{
    return owners->look[cts_owner_of_voxel(owners, i, j, k)];
}

/* The labels in one cell, by rising number, and their fields at its vertices: bit a of a vertex's number is its
 * position along axis a. */
/* More than 16 occur only with fractions; labels beyond CTS_CELL_OWNERS are omitted. */
enum { CTS_CELL_OWNERS = 24 };
typedef struct CtsCellOwners {
    int n;
    int owner[CTS_CELL_OWNERS];
    double corner[CTS_CELL_OWNERS][8];
} CtsCellOwners;
void cts_cell_owners(const CtsOwners *owners, const int cell[3], CtsCellOwners *in_cell);
/* The common appearance of the labels of a scanned voxel, or of a cell; else CTS_LOOKS_DIFFER. */
int cts_look_of_place(const CtsOwners *owners, size_t at);
int cts_look_of_cell(const CtsOwners *owners, const int cell[3]);

/* Intervals of a line through a cell, in order: each ends where the appearance changes, `end` rising to 1. Ends have an
 * error of at most 1e-7 of the line; a shorter interval may be missed. */
enum { CTS_CELL_STRETCHES = 64 };
typedef struct CtsStretch {
    double end;
    int look;
} CtsStretch;
/* from and to: within the cell, 0 to 1. Returns how many there are. */
int cts_owner_stretches(const CtsOwners *owners, const int cell[3], const double from[3], const double to[3],
                        CtsStretch stretch[CTS_CELL_STRETCHES]);
/* The same for the trilinear field of eight vertices: hidden where it lies below the level, elsewhere as the preset. */
int cts_level_stretches(const double corner[8], double level, const double from[3], const double to[3],
                        CtsStretch stretch[CTS_CELL_STRETCHES]);

#endif
