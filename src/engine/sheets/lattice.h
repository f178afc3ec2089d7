/* Rectangles of pixels, and level lattice: every second or fourth pixel each way is marched. Between four marched ones
 * the others are interpolated, from grid to grid, unless these differ by so much that the group is marched. */
#pragma once

#include "base/compare.h"
#include "base/simd_fixed.h"
#include "engine/sheets/sheets.h"

/* The largest channel of each of four pixels: they are transposed, half by half. */
static inline f32x4 sheets_largest_channels(f32x4 a, f32x4 b, f32x4 c, f32x4 d)
{
    const f32x4 ab = f32x4_max(SHUFFLE(a, b, 0, 4, 1, 5), SHUFFLE(a, b, 2, 6, 3, 7)),
                cd = f32x4_max(SHUFFLE(c, d, 0, 4, 1, 5), SHUFFLE(c, d, 2, 6, 3, 7));
    return f32x4_max(SHUFFLE(ab, cd, 0, 1, 4, 5), SHUFFLE(ab, cd, 2, 3, 6, 7));
}

/* The points that a patch is interpolated from, of the next grid; they are functions of their place alone, so that no
 * band or tile shows its borders. Indicators of three points are loaded as four. lattice: zeroed, or one whose memory
 * is taken again if it has the size. */
CtsStatus cts_sheets_lattice_init(SheetsPatch *lattice, const SheetsPatch *patch, CtsError *err);
void cts_sheets_lattice_free(SheetsPatch *lattice);

#define INLINE static inline __attribute__((always_inline))

/* Stores n rows of a group, and so many pixels of each. */
INLINE void sheets_store_rows(SheetsPatch *to, size_t at, int across, int down, const f32x4 rgba[SHEETS_LANES],
                              const float indicator[SHEETS_LANES])
{
    for (int j = 0; j < down; j++, at += (size_t)to->width)
        for (int i = 0; i < across; i++) {
            ((f32x4 *)to->rgba)[at + (size_t)i] = rgba[SHEETS_SIDE * j + i];
            to->indicator[at + (size_t)i] = indicator[SHEETS_SIDE * j + i];
        }
}

/* Stores those pixels of the group at (x0, y0) that lie in a patch. */
INLINE void sheets_store(SheetsPatch *to, int x0, int y0, const f32x4 rgba[SHEETS_LANES],
                         const float indicator[SHEETS_LANES])
{
    const size_t at = (size_t)y0 * (size_t)to->width + (size_t)x0;
    const int across = cts_smaller_int(SHEETS_SIDE, to->width - x0),
              down = cts_smaller_int(SHEETS_SIDE, to->height - y0);
    if (across == SHEETS_SIDE && down == SHEETS_SIDE)
        sheets_store_rows(to, at, SHEETS_SIDE, SHEETS_SIDE, rgba, indicator);
    else
        sheets_store_rows(to, at, across, down, rgba, indicator);
}

/* Groups of a row of a patch. */
static inline int sheets_groups_along(int n)
{
    return (n + SHEETS_SIDE - 1) / SHEETS_SIDE;
}

/* True if nothing is visible at the points around a group of pixels, nor at any place between them. */
bool cts_sheets_is_void(const SheetsPatch *lattice, int x0, int y0);
/* Interpolates the group at (x0, y0) of a patch from its lattice. False where it has to be marched: points around it
 * differ too much, or are next to invisible and bodies smaller than a pixel may lie between them. */
bool cts_sheets_interpolate(SheetsPatch *to, const SheetsPatch *lattice, int x0, int y0, const SheetsJob *job);

/* Adds to the indicators of pixels x0 to x1 - 1 (x0: of a group's first column) of rows y0 to y1 - 1 of a patch a share
 * of their contrast to their neighbours in rows strip[0] to strip[1] - 1; where the group was marched and may show
 * something, since interpolated pixels' indicators have more than that. */
void cts_sheets_add_contrast(const SheetsPatch *patch, int x0, int x1, int y0, int y1, const int strip[2]);
