/* Distances between macro-cells of a volume. */
#pragma once

#include <stdint.h>

enum { CTS_CELL_FAR = 255 };

/* distance[(k * nv + v) * nu + u]: a 0 stays, any other value becomes the Chebyshev distance to the nearest 0, at most
 * CTS_CELL_FAR, which is also the value without any 0. */
void cts_cell_distance(uint8_t *distance, int nu, int nv, int nk);
