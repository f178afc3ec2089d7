/* Block ranges after voxels have become air, without reading what did not change. */
#ifndef CTS_TABLE_BLOCK_CHANGE_H
#define CTS_TABLE_BLOCK_CHANGE_H

#include "volume/bits.h"

/* For each slice, which fine blocks over it have lost a voxel there, and which have kept one; a block's voxels as
 * blocks.h has them, those it shares with its neighbours included. */
typedef struct CtsBlockChange {
    CtsMacrocells *blocks; /* NULL: nothing to do */
    CtsBits lost, kept;
} CtsBlockChange;

/* blocks may be NULL, and all of the following then do nothing. A zero-initialised one may be freed. */
CtsStatus cts_block_change_new(CtsBlockChange *change, CtsMacrocells *blocks, CtsError *err);
void cts_block_change_free(CtsBlockChange *change);

/* What is gone of the rows of the block at hand, in some row and in all. */
typedef struct CtsBlockRows {
    uint64_t some[CTS_BITS_ROW_WORDS], all[CTS_BITS_ROW_WORDS];
} CtsBlockRows;

/* Row j of slice k: the voxels that become air, as a row of a CtsBits of the volume's dimensions. Rows of a slice come
 * in order, all of them, and from one thread. */
void cts_block_change_row(CtsBlockChange *change, CtsBlockRows *rows, const uint64_t *gone, int j, int k);

/* The blocks' new ranges, once all voxels are air that become it. */
void cts_block_change_apply(const CtsBlockChange *change, const CtsVolume *volume, int n_threads);

#endif
