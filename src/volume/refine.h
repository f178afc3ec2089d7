/* Layers between slices by monotone cubics: Hermite's, with slopes that are weighted harmonic means of the differences
 * on both sides, and 0 where these differ in sign (Fritsch and Butland 1984). No value leaves the range of its two
 * slices. */
#ifndef CTS_VOLUME_REFINE_H
#define CTS_VOLUME_REFINE_H

#include <stdint.h>

/* One place between slices b and c, of four neighbours a b c d. */
typedef struct CtsRefineWeights {
    float b, c, slope_b, slope_c;     /* of Hermite's basis; b + c = 1 */
    float per_before, per_behind;     /* the distance of b and c in distances of a and b, and of c and d */
    float share_before, share_behind; /* of the first difference in the mean at b, and at c */
} CtsRefineWeights;

/* t: 0 at b, 1 at c. distance: from a to b, b to c, c to d, in any unit. */
CtsRefineWeights cts_refine_weights(double t, const double distance[3]);

/* n voxels of one layer; a is b where the stack begins, d is c where it ends. */
void cts_refine_row(uint16_t *to, const uint16_t *const slices[4], int n, const CtsRefineWeights *weights);

#endif
