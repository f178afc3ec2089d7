/* A chamfer transform: each macro-cell from those visited before it, forwards and then backwards, which is exact for
 * Chebyshev distances (Borgefors 1986). */
#include "engine/tiled/cell_distance.h"

#include <stdbool.h>
#include <stddef.h>

/* The distance d, unless the neighbour's and a step are less. */
static inline uint8_t by_neighbour(uint8_t d, uint8_t neighbour)
{
    return neighbour < d ? (uint8_t)(neighbour + 1) : d;
}

/* Distances of a row by those of a row beside it. */
static void reach_from_row(uint8_t *restrict d, const uint8_t *restrict beside, int n)
{
    for (int i = 0; i < n; i++)
        d[i] = by_neighbour(d[i], beside[i]);
    for (int i = 1; i < n; i++)
        d[i] = by_neighbour(d[i], beside[i - 1]);
    for (int i = 1; i < n; i++)
        d[i - 1] = by_neighbour(d[i - 1], beside[i]);
}

static void reach_along_row(uint8_t *d, int n, bool backwards)
{
    for (int i = 1; i < n && !backwards; i++)
        d[i] = by_neighbour(d[i], d[i - 1]);
    for (int i = n - 1; i > 0 && backwards; i--)
        d[i - 1] = by_neighbour(d[i - 1], d[i]);
}

void cts_cell_distance(uint8_t *distance, int nu, int nv, int nk)
{
    const int n_rows = nv * nk;
    for (size_t i = 0; i < (size_t)nu * (size_t)n_rows; i++)
        distance[i] = distance[i] ? CTS_CELL_FAR : 0;
    for (int pass = 0; pass < 2; pass++)
        for (int n = 0; n < n_rows; n++) {
            const int row = pass ? n_rows - 1 - n : n, v = row % nv, sign = pass ? 1 : -1;
            uint8_t *const d = distance + (size_t)row * (size_t)nu;
            const ptrdiff_t next = (ptrdiff_t)sign * nu, layer = next * nv;
            for (int dv = -1; dv <= 1; dv++)
                if (n >= nv && v + dv >= 0 && v + dv < nv)
                    reach_from_row(d, d + layer + (ptrdiff_t)dv * nu, nu);
            if (v + sign >= 0 && v + sign < nv)
                reach_from_row(d, d + next, nu);
            reach_along_row(d, nu, pass);
        }
}
