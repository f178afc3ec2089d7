/* Table removal on cells of about 2 mm: how thick a part is, what of it lies far from anything thick, what the body
 * encloses. Coarse on purpose; the cuts themselves are made on the voxels. */
#ifndef CTS_TABLE_COUCH_GRID_H
#define CTS_TABLE_COUCH_GRID_H

#include "ctsplat/volume.h"
#include "table/parts.h"

/* What all steps need to know about the volume. */
typedef struct CouchScene {
    const CtsVolume *volume;
    int n_threads;
    int first_slice, end_slice; /* what the caller wants cleared; the whole is looked at */
    double spacing_mm[3];
    double voxel_mm3;
    int head_axis; /* the index axis nearest to the patient's head-foot axis, along which a table runs */
} CouchScene;

/* Cells of block[] voxels over the voxels lo[] <= n <= hi[]; the last cell of an axis may be cut. */
typedef struct CouchGrid {
    int lo[3], hi[3], block[3], dims[3];
    double cell_mm[3];
    double step_mm; /* the smallest cell_mm: what one layer of growth means */
    int every[3];   /* an axis takes part in every n-th layer only, so that long cells do not outrun short ones */
} CouchGrid;

CouchGrid couch_grid(const CouchScene *scene, const int lo[3], const int hi[3]);
CouchGrid couch_grid_whole(const CouchScene *scene);

static inline int couch_cell(const CouchGrid *grid, int axis, int voxel)
{
    return (voxel - grid->lo[axis]) / grid->block[axis];
}

/* One past the last voxel of a cell; where a walk along a run of voxels comes to the next cell. */
static inline int couch_cell_end(const CouchGrid *grid, int axis, int cell)
{
    return grid->lo[axis] + (cell + 1) * grid->block[axis];
}

/* any: cells that hold a voxel of a flagged part; solid: cells that hold it in half of their voxels or more. Both are
 * made here; solid may be NULL. What of the parts lies beyond the grid is left out. */
CtsStatus couch_cells(const CouchScene *scene, const CouchGrid *grid, const CtsParts *parts, const uint8_t *flags,
                      CtsBits *any, CtsBits *solid, CtsError *err);

/* The same once parts have got flags that had none before; the grid covers the whole volume. */
CtsStatus couch_more_cells(const CouchScene *scene, const CouchGrid *grid, const CtsParts *parts, const uint8_t *flags,
                           const uint8_t *flags_before, CtsBits *any, CtsBits *solid, CtsError *err);

/* The thickness of one part in mm, to about a cell: the diameter of the largest ball in it, at most limit_mm. */
CtsStatus couch_thickness(const CouchScene *scene, const CtsParts *parts, uint32_t part, double limit_mm,
                          double *thickness_mm, CtsError *err);

/* An opening: core are the cells of solid deep enough to be in something opening_mm thick, as far as they hang together
 * with some in something bulky_mm thick; thick are the cells of any within as much again of core, and a cell more. */
CtsStatus couch_thick(const CouchScene *scene, const CouchGrid *grid, const CtsBits *any, const CtsBits *solid,
                      double opening_mm, double bulky_mm, CtsBits *core, CtsBits *thick, CtsError *err);

/* The cells that the outer air does not reach past the set cells, when mouths narrower than about 10 mm count as
 * closed: the set cells, lungs, bowel gas, the nose. The outer air comes from the sides of the slices where the voxels
 * are air or padding; *has_outside is false when there is none, as in a field of view within the body. */
CtsStatus couch_inside(const CouchScene *scene, const CouchGrid *grid, const CtsBits *set, CtsBits *inside,
                       bool *has_outside, CtsError *err);

/* Cells within near_mm of a set one. */
CtsStatus couch_near(const CouchScene *scene, const CouchGrid *grid, const CtsBits *set, double near_mm, CtsBits *near,
                     CtsError *err);

/* Whether most cells of held have a cell of ring on all four sides, across the head-foot axis. */
CtsStatus couch_surrounds(const CouchScene *scene, const CtsBits *ring, const CtsBits *held, bool *yes, CtsError *err);

/* Cells of any that lie further than reach_mm from thick, yet hang together with it, walking through any, and not
 * inside; scattered ones that extend over less than 40 mm are left out. */
CtsStatus couch_far(const CouchScene *scene, const CouchGrid *grid, const CtsBits *any, const CtsBits *thick,
                    const CtsBits *inside, double reach_mm, CtsBits *far, CtsError *err);

#endif
