/* Where a packet's 8 rays meet a sheet: two windows of 8 x 3 voxels, one for each half of the packet. */
#ifndef CTS_SPLAT_TILED_TAPS_H
#define CTS_SPLAT_TILED_TAPS_H

#include "splat/vec8.h"

typedef struct Taps {
    const uint16_t *at[2]; /* first voxel of each half packet's window, in layer q = 0 */
    v8i pick, row1;        /* what finds the column x0 in the window; all ones where the upper row is its second */
    v8i weights;           /* 14-bit weights of columns x0 and x0 + 1, packed as two int16 */
    v8f fy;
} Taps;

#endif
