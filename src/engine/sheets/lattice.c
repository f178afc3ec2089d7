#include "engine/sheets/lattice.h"

#include "base/mem.h"
#include <math.h>

#define INLINE static inline __attribute__((always_inline))

/* Difference of neighbours, in requested errors, from which the pixels between them are marched: bilinear interpolation
 * is off by an eighth of the change of slope, so that a difference of eight requested errors is off by about one; such
 * pixels are few. */
#define REFINED_FROM 8.0
/* Opacity from which a point counts as visible: a step of eight bits. Of bodies of which its ray passes the border
 * alone, nothing says what lies between. */
#define VISIBLE_FROM (1.0F / 256)
/* Error of an interpolated pixel as a share of the difference of the marched ones around it. */
#define INTERPOLATED_SHARE 0.25F

static float largest_channel(f32x4 rgba)
{
    return cts_larger_float(cts_larger_float(rgba[0], rgba[1]), cts_larger_float(rgba[2], rgba[3]));
}

/* The largest range of a channel. */
static float range_of(const f32x4 rgba[], int n)
{
    f32x4 low = rgba[0], high = rgba[0];
    for (int i = 1; i < n; i++) {
        low = f32x4_min(rgba[i], low);
        high = f32x4_max(rgba[i], high);
    }
    return largest_channel(high - low);
}

/* Pixel of a patch as the mean of n (1, 2 or 4) marched ones. Where these are invisible, or lie far apart in depth, the
 * first one's depth stands for them. */
static void interpolate(SheetsPatch *to, size_t at, const SheetsPatch *from, const size_t corner[], int n)
{
    f32x4 rgba[4], sum = {0};
    const float share = 1 / (float)n;
    float indicator = 0, depth_mm = 0;
    for (int i = 0; i < n; i++) {
        rgba[i] = *(const f32x4 *)(from->rgba + 4 * corner[i]);
        sum += rgba[i];
        indicator += from->indicator[corner[i]] * share;
    }
    *(f32x4 *)(to->rgba + 4 * at) = sum * share;
    to->indicator[at] = indicator + INTERPOLATED_SHARE * range_of(rgba, n);
    if (!to->depth_mm)
        return;
    for (int i = 0; i < n; i++)
        depth_mm += from->depth_mm[corner[i]] * share;
    to->depth_mm[at] = depth_mm < SHEETS_FAR / 8 ? depth_mm : from->depth_mm[corner[0]];
}

/* Two neighbouring points of a row. */
typedef struct Pair {
    f32x4 sum, low, high;
} Pair;

static Pair pair_of(const f32x4 *point)
{
    return (Pair){point[0] + point[1], f32x4_min(point[0], point[1]), f32x4_max(point[0], point[1])};
}

/* interpolate() for two rows of four pixels. point, pair: of the row of three points above, and of the one below;
 * a, b: indicators of these points, and one number more. */
static void interpolate_rows(float *rgba, float *indicator, size_t width, const f32x4 *const point[2],
                             const Pair pair[2][2], f32x4 a, f32x4 b)
{
    const f32x4 none = {0}, marched = {1, 0.5F, 1, 0.5F}, between = {0.5F, 0.25F, 0.5F, 0.25F};
    f32x4 *const upper = (f32x4 *)rgba, *const lower = (f32x4 *)(rgba + 4 * width), range[2], under[4];
    for (int i = 0; i < 2; i++) {
        const f32x4 above = point[0][i], below = point[1][i];
        const Pair *const first = &pair[0][i], *const second = &pair[1][i];
        upper[2 * i] = above;
        upper[2 * i + 1] = first->sum * 0.5F;
        lower[2 * i] = (above + below) * 0.5F;
        lower[2 * i + 1] = (first->sum + below + point[1][i + 1]) * 0.25F;
        range[i] = first->high - first->low;
        under[2 * i] = f32x4_max(above, below) - f32x4_min(above, below);
        under[2 * i + 1] = f32x4_max(first->high, second->high) - f32x4_min(first->low, second->low);
    }
    *(f32x4 *)indicator = SHUFFLE(a, a, 0, 0, 1, 1) * marched + SHUFFLE(a * 0.5F, none, 4, 1, 4, 2) +
                          INTERPOLATED_SHARE * sheets_largest_channels(none, range[0], none, range[1]);
    *(f32x4 *)(indicator + width) =
        SHUFFLE(a, a, 0, 0, 1, 1) * between + SHUFFLE(a * 0.25F, none, 4, 1, 4, 2) +
        SHUFFLE(b, b, 0, 0, 1, 1) * between + SHUFFLE(b * 0.25F, none, 4, 1, 4, 2) +
        INTERPOLATED_SHARE * sheets_largest_channels(under[0], under[1], under[2], under[3]);
}

/* Prefetches the group in the next tile, since processors do not foresee rows as short as a tile's: half of the time of
 * interpolation (measured). Addresses beyond the end do no harm. gcc removes the call where it is not inlined. */
INLINE void prefetch_group(const SheetsPatch *to, size_t at, const SheetsPatch *from, size_t corner)
{
    for (size_t j = 0; j < SHEETS_SIDE; j++) {
        const size_t pixel = at + SHEETS_TILE_X + j * (size_t)to->width;
        __builtin_prefetch(to->rgba + 4 * pixel, 1);
        __builtin_prefetch(to->indicator + pixel, 1);
    }
    for (size_t j = 0; j < 3; j++) {
        const size_t point = corner + SHEETS_TILE_X / 2 + j * (size_t)from->width;
        __builtin_prefetch(from->rgba + 4 * point);
        __builtin_prefetch(from->indicator + point);
    }
}

/* cts_sheets_interpolate() for a whole group without depth: the same numbers in fewer steps. */
static bool interpolate_whole(const SheetsPatch *to, const SheetsPatch *from, int x0, int y0, float refined_from)
{
    const size_t across = (size_t)from->width, width = (size_t)to->width;
    const size_t corner = (size_t)(y0 / 2) * across + (size_t)(x0 / 2), at = (size_t)y0 * width + (size_t)x0;
    const f32x4 *point[3];
    Pair pair[3][2];
    f32x4 low[3], high[3];
    prefetch_group(to, at, from, corner);
    for (size_t j = 0; j < 3; j++) {
        point[j] = (const f32x4 *)(from->rgba + 4 * (corner + j * across));
        for (int i = 0; i < 2; i++)
            pair[j][i] = pair_of(point[j] + i);
        low[j] = f32x4_min(pair[j][0].low, pair[j][1].low);
        high[j] = f32x4_max(pair[j][0].high, pair[j][1].high);
    }
    const f32x4 most = f32x4_max(f32x4_max(high[0], high[1]), high[2]),
                least = f32x4_min(f32x4_min(low[0], low[1]), low[2]);
    if (!(most[3] > VISIBLE_FROM) || largest_channel(most - least) > refined_from)
        return false;
    for (size_t j = 0; j < 2; j++) {
        const size_t row = at + 2 * j * width;
        const float *const indicator = from->indicator + corner + j * across;
        interpolate_rows(to->rgba + 4 * row, to->indicator + row, width, point + j, pair + j, *(const f32x4 *)indicator,
                         *(const f32x4 *)(indicator + across));
    }
    return true;
}

/* The 4 x 4 pixels of a group between 3 x 3 points of the lattice, two by two. */
static void interpolate_group(SheetsPatch *to, const SheetsPatch *from, int x0, int y0)
{
    const size_t across = (size_t)from->width, width = (size_t)to->width;
    for (int j = 0; j < SHEETS_SIDE && y0 + j < to->height; j += 2)
        for (int i = 0; i < SHEETS_SIDE && x0 + i < to->width; i += 2) {
            const size_t first = (size_t)((y0 + j) / 2) * across + (size_t)((x0 + i) / 2);
            const size_t beside[4] = {first, first + 1, first + across, first + across + 1};
            const size_t above[2] = {first, first + across}, at = (size_t)(y0 + j) * width + (size_t)(x0 + i);
            const bool right = x0 + i + 1 < to->width, below = y0 + j + 1 < to->height;
            interpolate(to, at, from, beside, 1);
            if (right)
                interpolate(to, at + 1, from, beside, 2);
            if (below)
                interpolate(to, at + width, from, above, 2);
            if (right && below)
                interpolate(to, at + width + 1, from, beside, 4);
        }
}

/* True if the second difference of depth exceeds half a slab between 3 x 3 points of the lattice, of those that have a
 * depth. */
static bool is_curved(const SheetsPatch *from, size_t at, double slab_mm)
{
    const size_t across = (size_t)from->width;
    for (int i = 0; i < 3; i++)
        for (int down = 0; down < 2; down++) {
            const size_t step = down ? across : 1;
            const float *const d = from->depth_mm + at + (size_t)i * (down ? 1 : across);
            const double second_difference = (double)d[0] - 2 * (double)d[step] + (double)d[2 * step];
            if (fabs(second_difference) > slab_mm / 2 && fabs(second_difference) < (double)SHEETS_FAR / 8)
                return true;
        }
    return false;
}

float cts_sheets_refined_from(const CtsScene *scene)
{
    return (float)(REFINED_FROM * cts_scene_requested_error(scene));
}

void cts_sheets_lattice_free(SheetsPatch *l)
{
    cts_free(&l->rgba);
    cts_free(&l->indicator);
    cts_free(&l->depth_mm);
}

SheetsPatch cts_sheets_lattice_of(const SheetsJob *job, const SheetsPatch *pixels)
{
    return (SheetsPatch){.grid = &job->grid[1],
                         .x0 = pixels->x0,
                         .y0 = pixels->y0,
                         .width = SHEETS_POINTS(pixels->width),
                         .height = SHEETS_POINTS(pixels->height)};
}

CtsStatus cts_sheets_lattice_init(SheetsPatch *l, const SheetsJob *job, const SheetsPatch *pixels, CtsError *err)
{
    CtsStatus st;
    *l = cts_sheets_lattice_of(job, pixels);
    const size_t n = (size_t)l->width * (size_t)l->height;
    if ((st = cts_alloc_zeroed(&l->rgba, 4 * n, err)) || (st = cts_alloc_zeroed(&l->indicator, n + 1, err)) ||
        (pixels->depth_mm && (st = cts_alloc_array(&l->depth_mm, n, err))))
        return st;
    for (size_t i = 0; l->depth_mm && i < n; i++)
        l->depth_mm[i] = SHEETS_FAR;
    return CTS_OK;
}

bool cts_sheets_interpolate(SheetsPatch *to, const SheetsPatch *from, int x0, int y0, float refined_from,
                            double slab_mm)
{
    if (x0 + SHEETS_SIDE <= to->width && y0 + SHEETS_SIDE <= to->height && !to->depth_mm)
        return interpolate_whole(to, from, x0, y0, refined_from);
    f32x4 corner[9];
    bool any = false;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) {
            const int x = cts_smaller_int(x0 / 2 + i, from->width - 1),
                      y = cts_smaller_int(y0 / 2 + j, from->height - 1);
            const size_t at = (size_t)y * (size_t)from->width + (size_t)x;
            corner[3 * j + i] = *(const f32x4 *)(from->rgba + 4 * at);
            any |= corner[3 * j + i][3] > VISIBLE_FROM;
        }
    const size_t at = (size_t)(y0 / 2) * (size_t)from->width + (size_t)(x0 / 2);
    const bool has_nine = x0 / 2 + 2 < from->width && y0 / 2 + 2 < from->height;
    if (!any || range_of(corner, 9) > refined_from || (from->depth_mm && has_nine && is_curved(from, at, slab_mm)))
        return false;
    interpolate_group(to, from, x0, y0);
    return true;
}
