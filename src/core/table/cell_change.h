/* Macro-cell ranges after voxels have become air, without reading what did not change. */
#ifndef CTS_TABLE_CELL_CHANGE_H
#define CTS_TABLE_CELL_CHANGE_H

#include "base/bits.h"
#include "core/volume/macrocells.h"

/* For each slice, which fine macro-cells over it have lost a voxel there, and which have kept one; a macro-cell's
 * voxels as macrocells.h has them, those it shares with its neighbours included. */
typedef struct CtsCellChange {
    CtsMacrocells *macrocells; /* NULL: nothing to do */
    CtsBits lost, kept;
} CtsCellChange;

/* macro-cells may be NULL, and all of the following then do nothing. A zero-initialised one may be freed. */
CtsStatus cts_cell_change_new(CtsCellChange *change, CtsMacrocells *macrocells, CtsError *err);
void cts_cell_change_free(CtsCellChange *change);

/* What is gone of the rows of the macro-cell at hand, in some row and in all. */
typedef struct CtsCellRows {
    uint64_t some[CTS_BITS_ROW_WORDS], all[CTS_BITS_ROW_WORDS];
} CtsCellRows;

/* Row j of slice k: the voxels that become air, as a row of a CtsBits of the volume's dimensions. Rows of a slice come
 * in order, all of them, and from one thread. */
void cts_cell_change_row(CtsCellChange *change, CtsCellRows *rows, const uint64_t *gone, int j, int k);

/* The same for all rows of slice k, which loses what slice k - 1 does; that one's rows have come. */
void cts_cell_change_same(CtsCellChange *change, int k);

/* The macro-cells' new ranges, once all voxels are air that become it. */
void cts_cell_change_apply(const CtsCellChange *change, const CtsVolume *volume, int n_threads);

#endif
