#include "engine/sheets/lattice.h"

#include "base/mutation.h"

/* Share of a pixel's difference to its neighbours: where they differ, samples may have missed an edge between them. */
#define CONTRAST_SHARE (1.0F / 16)

/* Ranges of the channels of some pixels. */
typedef struct ChannelRange {
    f32x4 low, high;
} ChannelRange;

static ChannelRange join(ChannelRange a, ChannelRange b)
{
    return (ChannelRange){f32x4_min(a.low, b.low), f32x4_max(a.high, b.high)};
}

/* Pixel x of a row. */
static ChannelRange range_at(const float *row, int x)
{
    const f32x4 rgba = *(const f32x4 *)(row + 4 * (size_t)x);
    return (ChannelRange){rgba, rgba};
}

/* Pixel x of a row, the one above and the one below. */
static ChannelRange column(const float *const row[3], int x)
{
    return join(join(range_at(row[0], x), range_at(row[2], x)), range_at(row[1], x));
}

/* True if any of n pixels of row y, which has to lie in the strip, is visible. */
static bool row_visible(const SheetsPatch *p, int y, const int strip[2], int first, int n)
{
    enum { STEP = 8 }; /* a branch for each pixel would cost more */
    u32x4 any = {0};
    if (y < strip[0] || y >= strip[1])
        return false;
    const u32x4 *const row = (const u32x4 *)(p->rgba + 4 * ((size_t)y * (size_t)p->width + (size_t)first));
    for (int i = 0; i < n && !(any[0] | any[1] | any[2] | any[3]); i += STEP)
        for (int k = i; k < cts_smaller_int(i + STEP, n); k++)
            any |= row[k];
    return any[0] | any[1] | any[2] | any[3];
}

/* Adds the largest difference of each pixel of row[1] to one of its eight neighbours, over channels; row[0] is the one
 * above, row[2] the one below. Columns of three pixels are joined once and used by three pixels. */
static void add_row_contrast(const float *const row[3], int from, int to, int width, float *indicator)
{
    ChannelRange left = column(row, from > 0 ? from - 1 : 0), middle = column(row, from);
    for (int x = from; x < to; x += 4) {
        const int n = cts_smaller_int(4, to - x);
        f32x4 spread[4] = {{0}};
        for (int i = 0; i < n; i++) {
            const ChannelRange right = column(row, cts_smaller_int(x + i + 1, width - 1)),
                               all = join(join(left, middle), right);
            const f32x4 here = range_at(row[1], x + i).low;
            spread[i] = f32x4_max(all.high - here, here - all.low);
            left = middle;
            middle = right;
        }
        const f32x4 most = CONTRAST_SHARE * sheets_largest_channels(spread[0], spread[1], spread[2], spread[3]);
        if (n == 4)
            *(f32x4 *)(indicator + x) += most;
        for (int i = 0; i < n && n < 4; i++)
            indicator[x + i] += most[i];
    }
}

void cts_sheets_add_contrast(const SheetsPatch *p, int x0, int x1, int y0, int y1, const int strip[2])
{
    const size_t row = 4 * (size_t)p->width;
    const int first = cts_larger_int(x0 - 1, 0), n = cts_smaller_int(x1 + 1, p->width) - first;
    bool above, here = row_visible(p, y0 - 1, strip, first, n), below = row_visible(p, y0, strip, first, n);
    for (int y = y0; y < y1 && !CTS_MUTATED(INDICATOR_CONTRAST); y++) {
        above = here;
        here = below;
        below = row_visible(p, y + 1, strip, first, n);
        const float *const at = p->rgba + row * (size_t)y;
        if (above || here || below)
            add_row_contrast((const float *const[]){y > strip[0] ? at - row : at, at, y + 1 < strip[1] ? at + row : at},
                             x0, x1, p->width, p->indicator + row / 4 * (size_t)y);
    }
}
