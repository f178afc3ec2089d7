/* Which cells of a volume (a cell lies between 2 x 2 x 2 voxels) lie inside the patient's body: what minip and average
 * look at, as air around the body would be all that they show. */
#ifndef CTS_VOLUME_BODY_MASK_H
#define CTS_VOLUME_BODY_MASK_H

#include "base/bits.h"

/* Kept by sections across volume axis axis[2], n_slices slices to a section; axis[0] and axis[1] are a section's
 * columns and rows. Bit (u, v) of section w stands for the square between the voxels u, u + 1 and v, v + 1: it is set
 * where all four are body in all slices of the section. first[] is where the volume begins, along its own axes. */
typedef struct CtsBodyMask {
    CtsBits squares;
    int axis[3], n_slices;
    int first[3];
    int parts; /* the volume's layers of one slice distance, as cts_volume_refine() makes them; at first 1 */
} CtsBodyMask;

CtsStatus cts_body_mask_copy(CtsBodyMask **copy, const CtsBodyMask *mask, CtsError *err);
void cts_body_mask_free(CtsBodyMask **mask);

/* Cell (i, j, k) has the voxels i and i + 1 ...; an axis of one voxel has one cell. */
static inline bool cts_body_mask_has(const CtsBodyMask *mask, const int cell[3])
{
    int at[3];
    for (int n = 0; n < 3; n++)
        at[n] = (mask->axis[n] == 2 ? cell[2] / mask->parts : cell[mask->axis[n]]) + mask->first[mask->axis[n]];
    const int low = at[2] / mask->n_slices, last = mask->squares.dims[2] - 1;
    const int high = (at[2] + 1) / mask->n_slices < last ? (at[2] + 1) / mask->n_slices : last;
    return cts_bits_get(&mask->squares, at[0], at[1], low) &&
           (high == low || cts_bits_get(&mask->squares, at[0], at[1], high));
}

/* Cells (0, j, k) to (n_cells - 1, j, k) as bits of (n_cells + 63) / 64 words. */
void cts_body_mask_row(const CtsBodyMask *mask, int j, int k, int n_cells, uint64_t *row);

#endif
