/* Void blocks: the blocks of 4^3 cells in which a rectangle of pixels may see anything, layer by layer. */
#pragma once

#include "engine/sheets/sheets.h"

#include "base/mutation.h"

enum {
    /* Bits of a position's fraction, and those that a block's slabs add. */
    SHEETS_FRACTION = 32,
    SHEETS_BLOCK_FRACTION = SHEETS_FRACTION + 2,
};
_Static_assert(SHEETS_BLOCK == 1 << (SHEETS_BLOCK_FRACTION - SHEETS_FRACTION), "a block's fraction holds its slabs");

/* Box of voxels along a and b that the rays of a rectangle of pixels pass in layer 0 of blocks, and its shift from
 * layer to layer; voxels, 32 bits of fraction. */
typedef struct SheetsShaft {
    int64_t low[2], high[2], shift[2];
} SheetsShaft;

/* Of pixels x[0] to x[1], y[0] to y[1]. */
SheetsShaft cts_sheets_shaft(const SheetsView *view, const int x[2], const int y[2]);

static inline int64_t cts_sheets_in_range(int64_t x, int64_t most)
{
    return x < 0 ? 0 : x > most ? most : x;
}

/* True if any block that the shaft meets in this layer may show something. */
static inline bool cts_sheets_shaft_is_visible(const SheetsShaft *s, const SheetsView *view, const SheetsVoid *v,
                                               int layer)
{
    const size_t width = (size_t)v->n[0] + 1, area = width * ((size_t)v->n[1] + 1);
    size_t from[2], to[2];
    for (int c = 0; c < 2; c++) {
        const int64_t low = s->low[c] + layer * s->shift[c], high = s->high[c] + layer * s->shift[c];
        if (high < 0 || low > (int64_t)(view->n[c] - 1) << SHEETS_FRACTION)
            return false;
        const int off = CTS_MUTATED(SHEET_SHAFT);
        from[c] = (size_t)cts_sheets_in_range((low >> SHEETS_BLOCK_FRACTION) - off, v->n[c] - 1);
        to[c] = (size_t)cts_sheets_in_range((high >> SHEETS_BLOCK_FRACTION) - off, v->n[c] - 1) + 1;
    }
    const uint32_t *const top = v->at + (size_t)layer * area + from[1] * width;
    const uint32_t *const bottom = v->at + (size_t)layer * area + to[1] * width;
    return bottom[to[0]] - bottom[from[0]] - top[to[0]] + top[from[0]] > 0;
}
