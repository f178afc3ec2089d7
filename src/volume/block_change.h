/* Block ranges after voxels have become air, without reading what did not change. */
#ifndef CTS_VOLUME_BLOCK_CHANGE_H
#define CTS_VOLUME_BLOCK_CHANGE_H

#include "volume/bits.h"

/* For each slice, which fine blocks over it have lost a voxel there, and which have kept one; a block's voxels as
 * blocks.h has them, those it shares with its neighbours included. */
typedef struct CtsBlockChange {
    CtsBlocks *blocks; /* NULL: nothing to do */
    CtsBits lost, kept;
} CtsBlockChange;

/* blocks may be NULL, and all of the following then do nothing. A zero-initialised one may be freed. */
CtsStatus cts_block_change_new(CtsBlockChange *change, CtsBlocks *blocks, CtsError *err);
void cts_block_change_free(CtsBlockChange *change);

/* Voxels of a row that become air, as a row of a CtsBits of the volume's dimensions, and what is gone of the rows of
 * the block at hand, in some row and in all. */
typedef struct CtsBlockRows {
    uint64_t gone[CTS_BITS_ROW_WORDS], some[CTS_BITS_ROW_WORDS], all[CTS_BITS_ROW_WORDS];
} CtsBlockRows;

/* Before the first row of a slice. */
void cts_block_rows_start(CtsBlockRows *rows);
/* Row j of slice k: the caller has set rows->gone and added it to rows->some and rows->all, spare bits 0. Rows of a
 * slice come in order and from one thread. */
void cts_block_change_row(CtsBlockChange *change, CtsBlockRows *rows, int j, int k);

/* Slices first <= k < end lose nothing and are not gone through row by row. */
void cts_block_change_keep(CtsBlockChange *change, int first, int end);

/* The blocks' new ranges, once all voxels are air that become it. */
void cts_block_change_apply(const CtsBlockChange *change, const CtsVolume *volume, int n_threads);

#endif
