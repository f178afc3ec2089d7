/* Layers between the slices of a thick stack, by monotone cubics (Fritsch and Carlson 1980). */
#ifndef CTS_VOLUME_REFINE_H
#define CTS_VOLUME_REFINE_H

#include <stdint.h>

/* Values at 0..1 between b and c, of four neighbours a b c d one slice apart: Hermite's cubic whose slopes are harmonic
 * means of the differences on both sides, and 0 where these differ in sign. It never leaves the range of b and c. */
typedef struct CtsRefineWeights {
    float b, c, slope_b, slope_c; /* of Hermite's basis at one place; b + c = 1 */
} CtsRefineWeights;

CtsRefineWeights cts_refine_weights(int part, int n_parts);

/* n voxels of one layer; a is b where the stack begins, d is c where it ends. */
void cts_refine_row(uint16_t *to, const uint16_t *const slices[4], int n, const CtsRefineWeights *weights);

#endif
