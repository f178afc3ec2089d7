#include "splat/hidden.h"

#include "base/mem.h"
#include <math.h>

CtsStatus cts_hidden_init(CtsHidden *h, const CtsRaster *r, CtsError *err)
{
    const double det = r->by_x[0] * r->by_y[1] - r->by_x[1] * r->by_y[0];
    CtsStatus st;
    *h = (CtsHidden){.width = r->width,
                     .height = r->height,
                     .n_blocks = (r->width + CTS_BLOCK_WIDTH - 1) / CTS_BLOCK_WIDTH,
                     .inverse = {{r->by_y[1] / det, -r->by_y[0] / det}, {-r->by_x[1] / det, r->by_x[0] / det}}};
    const size_t n_block_rows = ((size_t)r->height + CTS_BLOCK_HEIGHT - 1) / CTS_BLOCK_HEIGHT;
    if ((st = cts_alloc_zeroed(&h->witness, (size_t)r->height * (size_t)h->n_blocks, err)))
        return st;
    return cts_alloc_zeroed(&h->closed_rows, n_block_rows * (size_t)h->n_blocks, err);
}

void cts_hidden_free(CtsHidden *h)
{
    cts_free(&h->witness);
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
            h->closed_rows[(size_t)(y / CTS_BLOCK_HEIGHT) * (size_t)h->n_blocks + (size_t)b]++;
    }
}

int cts_hidden_next_open(const CtsHidden *h, int y, int *xa, int xb)
{
    const uint8_t *witness = h->witness + (size_t)y * (size_t)h->n_blocks;
    int x = *xa;
    while (x < xb && witness[x / CTS_BLOCK_WIDTH] == CTS_BLOCK_WIDTH)
        x = (x / CTS_BLOCK_WIDTH + 1) * CTS_BLOCK_WIDTH;
    *xa = x < xb ? x : xb;
    while (x < xb && witness[x / CTS_BLOCK_WIDTH] != CTS_BLOCK_WIDTH)
        x = (x / CTS_BLOCK_WIDTH + 1) * CTS_BLOCK_WIDTH;
    return x < xb ? x : xb;
}

/* Whole numbers within low..high, a pixel wider for rounding and clipped to 0..n-1; false when none is left. */
static bool pixels_within(double low, double high, int n, int *first, int *last)
{
    low = floor(low) - 1;
    high = ceil(high) + 1;
    if (!(high >= 0 && low <= n - 1))
        return false;
    *first = low > 0 ? (int)low : 0;
    *last = high < n - 1 ? (int)high : n - 1;
    return true;
}

bool cts_hidden_tile(const CtsHidden *h, const CtsRaster *r, const CtsTiles *tiles, int k, double spread, int tile_u,
                     int tile_v)
{
    const int tile[2] = {tile_u, tile_v};
    double centre[2], half[2];
    for (int c = 0; c < 2; c++) {
        half[c] = 0.5 * CTS_TILE * tiles->density[c] + spread * fabs(r->by_layer[c]);
        centre[c] = (tile[c] + 0.5) * CTS_TILE * tiles->density[c] - (r->origin[c] + r->by_layer[c] * k);
    }
    int x0, x1, y0, y1;
    const double x = h->inverse[0][0] * centre[0] + h->inverse[0][1] * centre[1];
    const double y = h->inverse[1][0] * centre[0] + h->inverse[1][1] * centre[1] - r->first_row;
    const double x_half = fabs(h->inverse[0][0]) * half[0] + fabs(h->inverse[0][1]) * half[1];
    const double y_half = fabs(h->inverse[1][0]) * half[0] + fabs(h->inverse[1][1]) * half[1];
    if (!pixels_within(x - x_half, x + x_half, h->width, &x0, &x1) ||
        !pixels_within(y - y_half, y + y_half, h->height, &y0, &y1))
        return true;
    for (int by = y0 / CTS_BLOCK_HEIGHT; by <= y1 / CTS_BLOCK_HEIGHT; by++) {
        const int left = h->height - by * CTS_BLOCK_HEIGHT;
        const int n = left < CTS_BLOCK_HEIGHT ? left : CTS_BLOCK_HEIGHT;
        for (int b = x0 / CTS_BLOCK_WIDTH; b <= x1 / CTS_BLOCK_WIDTH; b++)
            if (h->closed_rows[(size_t)by * (size_t)h->n_blocks + (size_t)b] < n)
                return false;
    }
    return true;
}
