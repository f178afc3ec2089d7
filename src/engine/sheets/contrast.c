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

/* True if any of n pixels is visible. */
static bool any_visible(const float *rgba, int n)
{
    u32x4 any = {0};
    for (int i = 0; i < n; i++)
        any |= *(const u32x4 *)(rgba + 4 * (size_t)i);
    return any[0] | any[1] | any[2] | any[3];
}

/* Pixels of a row: the first, and one past the last. */
typedef struct Extent {
    int from, to;
} Extent;

/* Part of an extent of row y outside of which nothing is visible, in whole steps: they cost less than a branch for each
 * pixel. */
static Extent visible_extent(const SheetsPatch *p, int y, Extent e)
{
    enum { STEP = 16 };
    const float *const row = p->rgba + 4 * (size_t)p->width * (size_t)y;
    while (e.from < e.to && !any_visible(row + 4 * (size_t)e.from, cts_smaller_int(STEP, e.to - e.from)))
        e.from += STEP;
    while (e.from < e.to &&
           !any_visible(row + 4 * (size_t)cts_larger_int(e.to - STEP, e.from), cts_smaller_int(STEP, e.to - e.from)))
        e.to -= STEP;
    return e.from < e.to ? e : (Extent){p->width, 0};
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

void cts_sheets_add_contrast(const SheetsPatch *p, int x0, int x1, int y0, int y1)
{
    const size_t width = (size_t)p->width;
    const Extent all = {cts_larger_int(x0 - 1, 0), cts_smaller_int(x1 + 1, p->width)}, none = {p->width, 0};
    Extent above, here = none, below = visible_extent(p, y0, all);
    for (int y = y0; y < y1 && !CTS_MUTATED(INDICATOR_CONTRAST); y++) {
        above = here;
        here = below;
        below = y + 1 < y1 ? visible_extent(p, y + 1, all) : none;
        const int from = cts_smaller_int(cts_smaller_int(above.from, below.from), here.from),
                  to = cts_larger_int(cts_larger_int(above.to, below.to), here.to);
        const float *const row = p->rgba + 4 * width * (size_t)y;
        if (from < to)
            add_row_contrast(
                (const float *const[]){y > y0 ? row - 4 * width : row, row, y + 1 < y1 ? row + 4 * width : row},
                cts_larger_int(from - 1, x0), cts_smaller_int(to + 1, x1), p->width, p->indicator + width * (size_t)y);
    }
}
