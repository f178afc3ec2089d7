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
    for (int y = y0; y < y1 && !CTS_MUTATED(INDICATOR_CONTRAST); y++) {
        const float *const at = p->rgba + row * (size_t)y, *const rows[3] = {y > strip[0] ? at - row : at, at,
                                                                             y + 1 < strip[1] ? at + row : at};
        const uint8_t *const may_show = p->may_show + y / SHEETS_SIDE * sheets_groups_along(p->width);
        for (int from = x0, to; from < x1; from = to) {
            const bool marched = may_show[from / SHEETS_SIDE];
            for (to = from; to < x1 && may_show[to / SHEETS_SIDE] == marched;)
                to += SHEETS_SIDE;
            if (marched)
                add_row_contrast(rows, from, cts_smaller_int(to, x1), p->width, p->indicator + row / 4 * (size_t)y);
        }
    }
}
