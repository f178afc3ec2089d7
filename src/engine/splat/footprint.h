/* The footprint of one voxel on its layer's lattice, in integer weights.
 *
 * A layer's sheet is a lattice with density[0] x density[1] samples per voxel, so that every voxel falls on a lattice
 * point and one table serves the whole volume. A lattice point's phase is its position within a voxel; the weights
 * that meet at a phase sum to CTS_WEIGHT_ONE exactly (except for cone-paper), so that sheets are exact in 32 bits and a
 * constant volume gives a constant sheet. */
#pragma once

#include "ctsplat/bounds.h"
#include "ctsplat/render.h"
#include "ctsplat/status.h"
#include <stdint.h>

enum {
    CTS_WEIGHT_BITS = 15,
    CTS_WEIGHT_ONE = 1 << CTS_WEIGHT_BITS,
    CTS_MAX_DENSITY = 4,
    CTS_MAX_TAPS = 32 /* a row of taps, padded for vector code */
};

typedef struct CtsFootprint {
    int density[2]; /* lattice samples per voxel: 1, 2 or 4, so that a tent's weights need no rounding */
    int reach[2];   /* taps are at lattice offsets -reach..reach */
    int apron;      /* voxels beyond a region that reach into it: the support, rounded up, less one */
    uint32_t weight[CTS_MAX_TAPS][CTS_MAX_TAPS]; /* [v + reach[1]][u + reach[0]], zero beyond the taps */
    uint32_t sum_low, sum_high; /* smallest and largest sum of a phase: CTS_WEIGHT_ONE unless cone-paper */
} CtsFootprint;

/* CTS_ERR_USAGE when the radius leaves some lattice point without a tap, or is out of bounds. */
CtsStatus cts_footprint_init(CtsFootprint *footprint, CtsKernelId kernel, double radius, const int density[2],
                             CtsError *err);
