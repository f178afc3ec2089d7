#include "engine/splat/occlusion_culling.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

CtsStatus cts_culling_init(CtsCulling *c, const CtsRaster *r, CtsError *err)
{
    const double det = r->by_x[0] * r->by_y[1] - r->by_x[1] * r->by_y[0];
    *c = (CtsCulling){.width = r->width,
                      .height = r->height,
                      .first_row = r->first_row,
                      .n_words = (r->width + 63) / 64,
                      .inverse = {{r->by_y[1] / det, -r->by_y[0] / det}, {-r->by_x[1] / det, r->by_x[0] / det}}};
    return cts_alloc_zeroed(&c->closed, (size_t)r->height * (size_t)c->n_words, err);
}

/* True if any of pixels x0..x1 of row y is open. */
static bool row_open(const CtsCulling *c, int y, int x0, int x1)
{
    const uint64_t *closed = cts_culling_row(c, y);
    for (int w = x0 / 64; w <= x1 / 64; w++) {
        const uint64_t from = w == x0 / 64 ? ~UINT64_C(0) << (x0 & 63) : ~UINT64_C(0);
        const uint64_t to = w == x1 / 64 ? ~UINT64_C(0) >> (63 - (x1 & 63)) : ~UINT64_C(0);
        if (~closed[w] & from & to)
            return true;
    }
    return false;
}

/* Integers within low..high, extended by a pixel for rounding and clipped to from..past-1; false when there are
 * none. */
static bool pixels_within(double low, double high, int from, int past, int *first, int *last)
{
    low = floor(low) - 1;
    high = ceil(high) + 1;
    if (from >= past || !(high >= from && low <= past - 1))
        return false;
    *first = low > from ? (int)low : from;
    *last = high < past - 1 ? (int)high : past - 1;
    return true;
}

/* True if an open pixel may sample a rectangle of lattice points, given by its centre, relative to the start of the
 * layer's lattice, and half its sides. */
static bool rectangle_open(const CtsCulling *c, const double centre[2], const double half[2], int from_y, int past_y)
{
    int x0, x1, y0, y1;
    const double x = c->inverse[0][0] * centre[0] + c->inverse[0][1] * centre[1];
    const double y = c->inverse[1][0] * centre[0] + c->inverse[1][1] * centre[1] - c->first_row;
    const double x_half = fabs(c->inverse[0][0]) * half[0] + fabs(c->inverse[0][1]) * half[1];
    const double y_half = fabs(c->inverse[1][0]) * half[0] + fabs(c->inverse[1][1]) * half[1];
    if (!pixels_within(x - x_half, x + x_half, 0, c->width, &x0, &x1) ||
        !pixels_within(y - y_half, y + y_half, from_y, past_y, &y0, &y1))
        return false;
    for (int y_at = y0; y_at <= y1; y_at++)
        if (row_open(c, y_at, x0, x1))
            return true;
    return false;
}

void cts_culling_open_row(const CtsCulling *culling, const CtsRaster *r, const CtsPatches *patches,
                          const CtsOcclusionQuery *query, int swath, uint64_t *row)
{
    const int size[2] = {CTS_PATCH * patches->density[0], CTS_SWATH * CTS_PATCH * patches->density[1]};
    double half[2], centre[2], start[2];
    for (int c = 0; c < 2; c++) {
        half[c] = 0.5 * size[c] + query->spread * fabs(r->by_layer[c]);
        start[c] = 0.5 * size[c] - (r->origin[c] + r->by_layer[c] * query->layer);
    }
    centre[1] = start[1] + (double)swath * size[1];
    memset(row, 0, (size_t)patches->n_words * sizeof *row);
    for (int t = 0; t < patches->n[0]; t++) {
        centre[0] = start[0] + (double)t * size[0];
        if (rectangle_open(culling, centre, half, query->y0, query->y1))
            row[t / 64] |= UINT64_C(1) << (t & 63);
    }
}
