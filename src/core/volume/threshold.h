/* Which voxels reach a grey level, as bits. */
#ifndef CTS_VOLUME_THRESHOLD_H
#define CTS_VOLUME_THRESHOLD_H

#include "base/bits.h"
#include "ctsplat/volume.h"
#include <math.h>

/* What counts as dense: below fat and skin, above foam, paper and most cloth. */
static const double CTS_DENSE_HU = -350;

/* The first grey level that does. */
static inline uint16_t cts_dense_grey(const CtsVolume *v)
{
    const double grey = ceil((CTS_DENSE_HU - v->hu_offset) / v->hu_step);
    return (uint16_t)fmin(fmax(grey, 1), UINT16_MAX);
}

/* One row: bit i tells whether level i of n is at least min. */
void cts_bits_threshold_row(uint64_t *row, const uint16_t *levels, int n, uint16_t min);

/* The voxels whose level is at least grey_min; grey has the dimensions of bits. Returns how many runs their rows have.
 */
uint64_t cts_bits_threshold(CtsBits *bits, const uint16_t *grey, uint16_t grey_min, int n_threads);

#endif
