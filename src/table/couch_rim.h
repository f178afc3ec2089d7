/* Table removal: make air of what is neither the body, nor in it, nor the thin rim around it. */
#ifndef CTS_TABLE_COUCH_RIM_H
#define CTS_TABLE_COUCH_RIM_H

#include "table/couch_grid.h"

/* The slices first <= k < end that the rim of the scene's slices may come from. */
int couch_rim_first(const CouchScene *scene);
int couch_rim_end(const CouchScene *scene);

/* Keep body, the cells of inside that are not foreign, and the partial-volume rim around body: 3 mm, at least 2
 * voxels within a slice and 1 between slices. Where a foreign part comes that close, the rim ends half-way. All else in
 * the slices of the scene becomes grey 0, and n_cleared counts it. body and foreign have no voxel in common;
 * body_cells are the cells of grid that hold body. The volume's blocks, if it has some, follow the
 * change. */
CtsStatus couch_clear(const CouchScene *scene, CtsVolume *volume, const CtsBits *body, const CtsBits *foreign,
                      const CouchGrid *grid, const CtsBits *body_cells, const CtsBits *inside, uint64_t *n_cleared,
                      CtsError *err);

#endif
