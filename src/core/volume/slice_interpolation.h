/* Layers between slices by cubic interpolation through the slices (Catmull and Rom 1974): slopes of the parabola
 * through a slice and its neighbours, clamped to the range of the two adjacent slices. */
#pragma once

#include <stdint.h>

/* Of four neighbours a b c d, at one place between b and c. */
typedef struct CtsInterpolationWeights {
    float a, b, c, d;
} CtsInterpolationWeights;

/* t: 0 at b, 1 at c. distance: from a to b, b to c, c to d, in any unit. */
CtsInterpolationWeights cts_slice_interpolation_weights(double t, const double distance[3]);

/* n voxels of one layer; a is b where the stack begins, d is c where it ends. */
void cts_slice_interpolation_row(uint16_t *to, const uint16_t *const slices[4], int n,
                                 const CtsInterpolationWeights *weights);
