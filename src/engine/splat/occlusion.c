#include "engine/splat/occlusion.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

/* Rows of zones: a new one after CTS_ZONE_HEIGHT picture rows, and at each cut. Returns how many. */
static int set_zone_rows(CtsOcclusion *o, const int *cuts, int n_cuts)
{
    int zone = -1, height = CTS_ZONE_HEIGHT;
    for (int y = 0, cut = 0; y < o->height; y++) {
        bool begins = height == CTS_ZONE_HEIGHT;
        for (; cut < n_cuts && cuts[cut] <= y; cut++)
            begins |= cuts[cut] == y;
        zone += begins;
        height = begins ? 1 : height + 1;
        o->zone_row[y] = zone;
        o->height_of[zone] = (uint8_t)height;
    }
    return zone + 1;
}

CtsStatus cts_occlusion_init(CtsOcclusion *o, const CtsRaster *r, const int *cuts, int n_cuts, CtsError *err)
{
    const double det = r->by_x[0] * r->by_y[1] - r->by_x[1] * r->by_y[0];
    CtsStatus st;
    *o = (CtsOcclusion){.width = r->width,
                        .height = r->height,
                        .first_row = r->first_row,
                        .n_zones = (r->width + CTS_ZONE_WIDTH - 1) / CTS_ZONE_WIDTH,
                        .inverse = {{r->by_y[1] / det, -r->by_y[0] / det}, {-r->by_x[1] / det, r->by_x[0] / det}}};
    if ((st = cts_alloc_zeroed(&o->witness, (size_t)r->height * (size_t)o->n_zones, err)) ||
        (st = cts_alloc_array(&o->zone_row, (size_t)r->height, err)) ||
        (st = cts_alloc_array(&o->height_of, (size_t)r->height, err)))
        return st;
    const int n_zone_rows = set_zone_rows(o, cuts, n_cuts);
    return cts_alloc_zeroed(&o->closed_rows, (size_t)n_zone_rows * (size_t)o->n_zones, err);
}

void cts_occlusion_free(CtsOcclusion *o)
{
    cts_free(&o->witness);
    cts_free(&o->zone_row);
    cts_free(&o->height_of);
    cts_free(&o->closed_rows);
}

void cts_occlusion_update(CtsOcclusion *o, const float *pixels, int y, int xa, int xb)
{
    const float *row = pixels + 4 * (size_t)y * (size_t)o->width;
    for (int b = xa / CTS_ZONE_WIDTH; b <= (xb - 1) / CTS_ZONE_WIDTH; b++) {
        uint8_t *witness = o->witness + (size_t)y * (size_t)o->n_zones + (size_t)b;
        const int x0 = b * CTS_ZONE_WIDTH, left = o->width - x0;
        const int n = left < CTS_ZONE_WIDTH ? left : CTS_ZONE_WIDTH;
        if (*witness == CTS_ZONE_WIDTH || row[4 * (x0 + *witness) + 3] > 0)
            continue;
        int i = 0;
        while (i < n && !(row[4 * (x0 + i) + 3] > 0))
            i++;
        *witness = (uint8_t)(i < n ? i : CTS_ZONE_WIDTH);
        if (i == n)
            o->closed_rows[(size_t)o->zone_row[y] * (size_t)o->n_zones + (size_t)b]++;
    }
}

/* Whole numbers within low..high, a pixel wider for rounding and clipped to from..past-1; false when none is left. */
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

/* Whether an open pixel may look at a rectangle of lattice points: its centre, from where the layer's lattice begins,
 * and half its sides. */
static bool rectangle_open(const CtsOcclusion *o, const double centre[2], const double half[2], int from_y, int past_y)
{
    int x0, x1, y0, y1;
    const double x = o->inverse[0][0] * centre[0] + o->inverse[0][1] * centre[1];
    const double y = o->inverse[1][0] * centre[0] + o->inverse[1][1] * centre[1] - o->first_row;
    const double x_half = fabs(o->inverse[0][0]) * half[0] + fabs(o->inverse[0][1]) * half[1];
    const double y_half = fabs(o->inverse[1][0]) * half[0] + fabs(o->inverse[1][1]) * half[1];
    if (!pixels_within(x - x_half, x + x_half, 0, o->width, &x0, &x1) ||
        !pixels_within(y - y_half, y + y_half, from_y, past_y, &y0, &y1))
        return false;
    for (int by = o->zone_row[y0]; by <= o->zone_row[y1]; by++)
        for (int b = x0 / CTS_ZONE_WIDTH; b <= x1 / CTS_ZONE_WIDTH; b++)
            if (o->closed_rows[(size_t)by * (size_t)o->n_zones + (size_t)b] < o->height_of[by])
                return true;
    return false;
}

void cts_occlusion_open_row(const CtsOcclusion *o, const CtsRaster *r, const CtsPatches *patches,
                            const CtsOcclusionQuery *query, int swath, uint64_t *row)
{
    enum { GROUP = 4 }; /* patches judged together */
    const int size[2] = {GROUP * CTS_PATCH * patches->density[0], CTS_SWATH * CTS_PATCH * patches->density[1]};
    double half[2], centre[2], start[2];
    for (int c = 0; c < 2; c++) {
        half[c] = 0.5 * size[c] + query->spread * fabs(r->by_layer[c]);
        start[c] = 0.5 * size[c] - (r->origin[c] + r->by_layer[c] * query->layer);
    }
    centre[1] = start[1] + (double)swath * size[1];
    memset(row, 0, (size_t)patches->n_words * sizeof *row);
    for (int t = 0; t < patches->n[0]; t += GROUP) {
        centre[0] = start[0] + (double)(t / GROUP) * size[0];
        if (rectangle_open(o, centre, half, query->y0, query->y1))
            row[t / 64] |= UINT64_C(15) << (t & 63);
    }
}
