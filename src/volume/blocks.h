/* Smallest and largest grey level of blocks of cells (a cell lies between 2 x 2 x 2 voxels), so that whatever is
 * interpolated inside a block lies between the two: of 8 x 8 x 8 cells, and of 4 x 4 x 4 for a closer look. What every
 * engine that skips void needs; made slice by slice, so that a reader can do it while a slice is still in the cache. */
#ifndef CTS_VOLUME_BLOCKS_H
#define CTS_VOLUME_BLOCKS_H

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdint.h>

enum { CTS_BLOCK = 8, CTS_FINE_BLOCK = 4 };

typedef struct CtsRange {
    uint16_t low, high;
} CtsRange;

/* Block (bi, bj, bk) is range[(bk * n[1] + bj) * n[0] + bi] and covers voxels 8 b to 8 b + 8 of each axis; the fine
 * ones likewise with 4. */
typedef struct CtsBlocks {
    int n[3], n_fine[3];
    CtsRange *range, *fine;
    CtsRange all;
    int dims[3];
    CtsRange *shared; /* while slices are added: ranges of the slices on which two fine blocks meet */
} CtsBlocks;

/* Empty blocks for a volume of these dimensions. */
CtsStatus cts_blocks_begin(CtsBlocks **blocks, const int dims[3], CtsError *err);
/* Rows first <= j < end of slice k, dims[0] * dims[1] voxels: the rows of a slice in order, in as many parts as one
 * likes; slices each once, in any order, but slices of the same k / CTS_FINE_BLOCK from one thread at a time. */
void cts_blocks_add(CtsBlocks *blocks, int k, const uint16_t *slice, int first, int end);
/* After the last slice. */
void cts_blocks_end(CtsBlocks *blocks, int n_threads);
/* The ranges of the coarse blocks and of all, once the fine ones have changed. */
void cts_blocks_sum(CtsBlocks *blocks, int n_threads);
/* Blocks of a volume that has been cropped to n_slices whole slices from `first` on, a multiple of CTS_FINE_BLOCK, and
 * whose levels now begin at grey. */
void cts_blocks_keep_slices(CtsBlocks *blocks, int first, int n_slices, const uint16_t *grey);
void cts_blocks_free(CtsBlocks **blocks);

/* Those of the volume in which grey level g has become level[g]; levels never fall as g rises. */
CtsStatus cts_blocks_map(CtsBlocks **mapped, const CtsBlocks *blocks, const uint16_t *level, CtsError *err);

/* All of it for a volume in memory, by n_threads. */
CtsStatus cts_blocks_new(CtsBlocks **blocks, const CtsVolume *volume, int n_threads, CtsError *err);

#endif
