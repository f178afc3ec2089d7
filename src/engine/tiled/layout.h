/* The volume as layers across the principal axis, each row of a layer contiguous along the axis that the picture's
 * rows follow best. Where the volume already lies so it is used in place; else a transposed copy is made. */
#ifndef CTS_TILED_LAYOUT_H
#define CTS_TILED_LAYOUT_H

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include "core/scene/view.h"
#include <stdint.h>

enum { CTS_LAYOUT_MIN_U = 8, CTS_LAYOUT_MIN_V = 3 }; /* what vector loads may touch; smaller volumes are padded */

typedef struct CtsLayout {
    int axis_u, axis_v, axis_k; /* volume axes: along a row, from row to row, from layer to layer */
    int nu, nv, nk;             /* voxels */
    int alloc_u, alloc_v;       /* voxels that may be read: at least the minima above */
    const uint16_t *grey;       /* voxel (u, v, k) is grey[k * layer_stride + v * row_stride + u] */
    ptrdiff_t row_stride, layer_stride;
    uint16_t *copy; /* owned; NULL where the volume is used in place */
} CtsLayout;

/* What the layout of this view is like, without its copy: grey is NULL where one must be made. */
CtsLayout cts_layout_plan(const CtsVolume *volume, const CtsView *view);
/* Which macro-cells of 8 x 8 x 8 voxels a copy needs: in the layout's axes, those whose distance is above `above` and
 * at most `reach`. */
typedef struct CtsLayoutCells {
    const uint8_t *distance;
    int nu, nv, nk; /* macro-cells along each axis */
    int above, reach;
} CtsLayoutCells;

/* Make room for the copy, if the plan needs one: layout->copy and layout->grey. */
CtsStatus cts_layout_make(CtsLayout *layout, CtsError *err);
/* Copy these macro-cells; what is not copied is undefined. Returns how many they are. */
int64_t cts_layout_copy(const CtsLayout *layout, const CtsVolume *volume, const CtsLayoutCells *macrocells,
                        int n_threads);
void cts_layout_free(CtsLayout *layout);

#endif
