#include "splat/hidden.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

/* Rows of blocks: a new one after CTS_BLOCK_HEIGHT picture rows, and at each cut. Returns how many. */
static int set_block_rows(CtsHidden *h, const int *cuts, int n_cuts)
{
    int block = -1, height = CTS_BLOCK_HEIGHT;
    for (int y = 0, cut = 0; y < h->height; y++) {
        bool begins = height == CTS_BLOCK_HEIGHT;
        for (; cut < n_cuts && cuts[cut] <= y; cut++)
            begins |= cuts[cut] == y;
        block += begins;
        height = begins ? 1 : height + 1;
        h->block_row[y] = block;
        h->height_of[block] = (uint8_t)height;
    }
    return block + 1;
}

CtsStatus cts_hidden_init(CtsHidden *h, const CtsRaster *r, const int *cuts, int n_cuts, CtsError *err)
{
    const double det = r->by_x[0] * r->by_y[1] - r->by_x[1] * r->by_y[0];
    CtsStatus st;
    *h = (CtsHidden){.width = r->width,
                     .height = r->height,
                     .first_row = r->first_row,
                     .n_blocks = (r->width + CTS_BLOCK_WIDTH - 1) / CTS_BLOCK_WIDTH,
                     .inverse = {{r->by_y[1] / det, -r->by_y[0] / det}, {-r->by_x[1] / det, r->by_x[0] / det}}};
    if ((st = cts_alloc_zeroed(&h->witness, (size_t)r->height * (size_t)h->n_blocks, err)) ||
        (st = cts_alloc_array(&h->block_row, (size_t)r->height, err)) ||
        (st = cts_alloc_array(&h->height_of, (size_t)r->height, err)))
        return st;
    const int n_block_rows = set_block_rows(h, cuts, n_cuts);
    return cts_alloc_zeroed(&h->closed_rows, (size_t)n_block_rows * (size_t)h->n_blocks, err);
}

void cts_hidden_free(CtsHidden *h)
{
    cts_free(&h->witness);
    cts_free(&h->block_row);
    cts_free(&h->height_of);
    cts_free(&h->closed_rows);
}

void cts_hidden_update(CtsHidden *h, const float *pixels, int y, int xa, int xb)
{
    const float *row = pixels + 4 * (size_t)y * (size_t)h->width;
    for (int b = xa / CTS_BLOCK_WIDTH; b <= (xb - 1) / CTS_BLOCK_WIDTH; b++) {
        uint8_t *witness = h->witness + (size_t)y * (size_t)h->n_blocks + (size_t)b;
        const int x0 = b * CTS_BLOCK_WIDTH, left = h->width - x0;
        const int n = left < CTS_BLOCK_WIDTH ? left : CTS_BLOCK_WIDTH;
        if (*witness == CTS_BLOCK_WIDTH || row[4 * (x0 + *witness) + 3] > 0)
            continue;
        int i = 0;
        while (i < n && !(row[4 * (x0 + i) + 3] > 0))
            i++;
        *witness = (uint8_t)(i < n ? i : CTS_BLOCK_WIDTH);
        if (i == n)
            h->closed_rows[(size_t)h->block_row[y] * (size_t)h->n_blocks + (size_t)b]++;
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
static bool rectangle_open(const CtsHidden *h, const double centre[2], const double half[2], int from_y, int past_y)
{
    int x0, x1, y0, y1;
    const double x = h->inverse[0][0] * centre[0] + h->inverse[0][1] * centre[1];
    const double y = h->inverse[1][0] * centre[0] + h->inverse[1][1] * centre[1] - h->first_row;
    const double x_half = fabs(h->inverse[0][0]) * half[0] + fabs(h->inverse[0][1]) * half[1];
    const double y_half = fabs(h->inverse[1][0]) * half[0] + fabs(h->inverse[1][1]) * half[1];
    if (!pixels_within(x - x_half, x + x_half, 0, h->width, &x0, &x1) ||
        !pixels_within(y - y_half, y + y_half, from_y, past_y, &y0, &y1))
        return false;
    for (int by = h->block_row[y0]; by <= h->block_row[y1]; by++)
        for (int b = x0 / CTS_BLOCK_WIDTH; b <= x1 / CTS_BLOCK_WIDTH; b++)
            if (h->closed_rows[(size_t)by * (size_t)h->n_blocks + (size_t)b] < h->height_of[by])
                return true;
    return false;
}

void cts_hidden_open_row(const CtsHidden *h, const CtsRaster *r, const CtsTiles *tiles, double layer, double spread,
                         int band, int y0, int y1, uint64_t *row)
{
    enum { GROUP = 4 }; /* tiles judged together */
    const int size[2] = {GROUP * CTS_TILE * tiles->density[0], CTS_BAND * CTS_TILE * tiles->density[1]};
    double half[2], centre[2], start[2];
    for (int c = 0; c < 2; c++) {
        half[c] = 0.5 * size[c] + spread * fabs(r->by_layer[c]);
        start[c] = 0.5 * size[c] - (r->origin[c] + r->by_layer[c] * layer);
    }
    centre[1] = start[1] + (double)band * size[1];
    memset(row, 0, (size_t)tiles->n_words * sizeof *row);
    for (int t = 0; t < tiles->n[0]; t += GROUP) {
        centre[0] = start[0] + (double)(t / GROUP) * size[0];
        if (rectangle_open(h, centre, half, y0, y1))
            row[t / 64] |= UINT64_C(15) << (t & 63);
    }
}
