/* Who owns each voxel of a volume, a label or the rest, and how what each of them owns looks.
 *
 * At the scanned voxels an owner's field is 1 where it owns the voxel and 0 elsewhere, or the share that it has of it;
 * between two slices linear, and trilinear within a cell; the largest field owns a point, of equal ones that of the
 * lower number (Feng, Ju, Warren: "Piecewise Tri-linear Contouring for Multi-Material Volumes", 2010). */
#ifndef CTS_VOLUME_OWNERS_H
#define CTS_VOLUME_OWNERS_H

#include "ctsplat/labels.h"
#include "ctsplat/preset.h"
#include "ctsplat/volume.h"
#include <stdint.h>

/* The looks of every picture with labels; labels' own follow. */
enum { CTS_LOOK_HIDDEN, CTS_LOOK_PRESET, CTS_LOOK_OWN, CTS_MAX_LOOKS = 255, CTS_LOOKS_DIFFER = 255 };

/* Emits and absorbs nothing; as the picture's preset does; or as a preset of its own, in a colour of its own, or as a
 * body of one opacity per mm whatever its HU. */
typedef struct CtsOwnerLook {
    CtsPreset *preset; /* owned; NULL: the picture's */
    bool tinted;
    double rgb[3];  /* where it is tinted */
    double opacity; /* of a body; below 0: no body */
} CtsOwnerLook;

/* A voxel that several owners have a field at, of CTS_WHOLE_SHARE each: the largest ones first, 0 for no more. */
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
    CtsSharedPlane *shared; /* of each plane, voxels that are shared; in `owner` stands the first of each */
    uint64_t *is_shared;    /* a bit for each voxel of `owner`; NULL where none is shared */
    int *plane; /* of each layer: the slice at or before it, */
    double *share; /* and how much of the one behind it counts, 0 to 1 */
    int n;         /* owners; the last one is the rest */
    uint8_t *look; /* of each owner */
    CtsOwnerLook *looks;
    int n_looks;
    uint8_t *block;   /* of each fine macro-cell: the one look that all its voxels have, or CTS_LOOKS_DIFFER */
    int n_block[3];   /* fine macro-cells along each axis */
    char **name;      /* of each owner that is seen in a colour of its own; else NULL */
    int *number;      /* of each such owner in its file */
    bool *on_skin;    /* of each owner: it may hold skin, as the rest always may */
    CtsVolume *shown; /* the volume with air for hidden voxels; NULL where nothing is hidden */
} CtsOwners;

/* Of volume and owners without planes, with room for n_planes; free with cts_owners_free(). */
CtsStatus cts_owners_new(CtsOwners **owners, const CtsVolume *volume, int n, int n_planes, CtsError *err);
/* Once owners and looks stand: blocks, and what of the volume is shown. */
CtsStatus cts_owners_finish(CtsOwners *owners, const CtsVolume *volume, int n_threads, CtsError *err);
/* A step of finishing that is a file of its own: fills on_skin. */
CtsStatus cts_owners_find_skin(CtsOwners *owners, const CtsVolume *volume, int n_threads, CtsError *err);
void cts_owners_free(CtsOwners **owners);

/* True where a label has a look of its own. */
static inline bool cts_owners_coloured(const CtsOwners *owners)
{
    return owners && owners->n_looks > CTS_LOOK_OWN;
}

/* The preset that a look makes of the picture's. */
void cts_owner_preset(const CtsOwnerLook *look, const CtsPreset *picture, CtsPreset *preset);

/* Who owns the place of a voxel of the volume. */
int cts_owner_of_voxel(const CtsOwners *owners, int i, int j, int k);
static inline int cts_look_of_voxel(const CtsOwners *owners, int i, int j, int k)
{
    return owners->look[cts_owner_of_voxel(owners, i, j, k)];
}

/* The owners in one cell, by rising number, and their fields at its corners: bit a of a corner's number is its place
 * along axis a. */
/* More than 16 need voxels that are shared; what is more than these is left out. */
enum { CTS_CELL_OWNERS = 24 };
typedef struct CtsCellOwners {
    int n;
    int owner[CTS_CELL_OWNERS];
    double corner[CTS_CELL_OWNERS][8];
} CtsCellOwners;
void cts_cell_owners(const CtsOwners *owners, const int cell[3], CtsCellOwners *in_cell);
/* The one look of all owners of a scanned voxel, or of a cell; else CTS_LOOKS_DIFFER. */
int cts_look_of_place(const CtsOwners *owners, size_t at);
int cts_look_of_cell(const CtsOwners *owners, const int cell[3]);

/* Stretches of a straight way through a cell, in order: each ends where the look changes, `end` rising to 1. Ends are
 * off by 1e-7 of the way at most; a stretch that is shorter may be missed. */
enum { CTS_CELL_STRETCHES = 64 };
typedef struct CtsStretch {
    double end;
    int look;
} CtsStretch;
/* from and to: within the cell, 0 to 1. Returns how many there are. */
int cts_owner_stretches(const CtsOwners *owners, const int cell[3], const double from[3], const double to[3],
                        CtsStretch stretch[CTS_CELL_STRETCHES]);
/* The same for the trilinear field of eight corners: hidden where it lies below the level, elsewhere as the preset. */
int cts_level_stretches(const double corner[8], double level, const double from[3], const double to[3],
                        CtsStretch stretch[CTS_CELL_STRETCHES]);

#endif
