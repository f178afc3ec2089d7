/* Smallest and largest grey level of each block of 8 x 8 x 8 cells (a cell lies between 2 x 2 x 2 voxels), so that
 * whatever is interpolated inside the block lies between the two. Needed by every engine that skips what is void. */
#ifndef CTS_VOLUME_BLOCKS_H
#define CTS_VOLUME_BLOCKS_H

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdint.h>

enum { CTS_BLOCK = 8 };

typedef struct CtsRange {
    uint16_t low, high;
} CtsRange;

/* Block (bi, bj, bk) is range[(bk * n[1] + bj) * n[0] + bi] and covers voxels 8 b to 8 b + 8 of each axis. */
typedef struct CtsBlocks {
    int n[3];
    CtsRange *range;
    CtsRange all;
} CtsBlocks;

/* One pass over the volume by n_threads. */
CtsStatus cts_blocks_new(CtsBlocks **blocks, const CtsVolume *volume, int n_threads, CtsError *err);
void cts_blocks_free(CtsBlocks **blocks);

#endif
