#include "engine/sheets/lattice.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

/* Difference of neighbours, in requested errors, from which the pixels between them are marched: bilinear interpolation
 * is off by an eighth of the change of slope, so that a difference of eight requested errors is off by about one; such
 * pixels are few. */
#define REFINED_FROM 8.0
/* Opacity from which a point counts as visible: a step of eight bits. Of bodies of which its ray passes the border
 * alone, nothing says what lies between. */
#define VISIBLE_FROM (1.0F / 256)
/* The same for points of a coarse lattice, which see the edge alone of a body that fine ones see more of: with 1/256 a
 * picture of specks as steep as `vessel` shows them was off by 4.4 of 255, and 3.0 were reported. */
#define VISIBLE_FROM_COARSE (1.0F / 4)
/* Error of an interpolated pixel as a share of the difference of the marched ones around it. */
#define INTERPOLATED_SHARE 0.25F

static float largest_channel(f32x4 rgba)
{
    return cts_larger_float(cts_larger_float(rgba[0], rgba[1]), cts_larger_float(rgba[2], rgba[3]));
}

/* Two neighbouring points of a row. */
typedef struct Pair {
    f32x4 sum, low, high;
} Pair;

static Pair pair_of(const f32x4 *point)
{
    return (Pair){point[0] + point[1], f32x4_min(point[0], point[1]), f32x4_max(point[0], point[1])};
}

/* Two rows of four pixels as means of 1, 2 or 4 points each, and their indicators. point, pair: of the row of three
 * points above, and of the one below; a, b: indicators of these points, and one number more. */
static void interpolate_rows(f32x4 rgba[8], f32x4 indicator[2], const f32x4 *const point[2], const Pair pair[2][2],
                             f32x4 a, f32x4 b)
{
    const f32x4 none = {0}, marched = {1, 0.5F, 1, 0.5F}, between = {0.5F, 0.25F, 0.5F, 0.25F};
    f32x4 *const upper = rgba, *const lower = rgba + SHEETS_SIDE, range[2], under[4];
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
    indicator[0] = SHUFFLE(a, a, 0, 0, 1, 1) * marched + SHUFFLE(a * 0.5F, none, 4, 1, 4, 2) +
                   INTERPOLATED_SHARE * sheets_largest_channels(none, range[0], none, range[1]);
    indicator[1] = SHUFFLE(a, a, 0, 0, 1, 1) * between + SHUFFLE(a * 0.25F, none, 4, 1, 4, 2) +
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

/* Means of the depths of the same points. Where one of them is invisible, the first one's depth stands for them. */
static void interpolate_depths(SheetsPatch *to, const SheetsPatch *from, int x0, int y0)
{
    for (int y = y0; y < y0 + SHEETS_SIDE && y < to->height; y++)
        for (int x = x0; x < x0 + SHEETS_SIDE && x < to->width; x++) {
            const float *const first = from->depth_mm + y / 2 * from->width + x / 2;
            float depth_mm = 0;
            for (int j = 0; j <= y % 2; j++)
                for (int i = 0; i <= x % 2; i++)
                    depth_mm += first[j * from->width + i] / (float)((1 + x % 2) * (1 + y % 2));
            to->depth_mm[y * to->width + x] = isinf(depth_mm) ? *first : depth_mm;
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
            if (fabs(second_difference) > slab_mm / 2 && !isinf(second_difference))
                return true;
        }
    return false;
}

void cts_sheets_lattice_free(SheetsPatch *l)
{
    cts_free(&l->rgba);
    cts_free(&l->indicator);
    cts_free(&l->depth_mm);
    cts_free(&l->may_show);
}

static CtsStatus alloc_lattice(SheetsPatch *l, size_t n, size_t n_groups, bool with_depth, CtsError *err)
{
    CtsStatus st;
    const size_t beyond = 3;
    if ((st = cts_alloc_array(&l->rgba, 4 * n, err)) || (st = cts_alloc_array(&l->indicator, n + beyond, err)) ||
        (with_depth && (st = cts_alloc_array(&l->depth_mm, n, err))) ||
        (st = cts_alloc_array(&l->may_show, n_groups, err)))
        return st;
    memset(l->indicator + n, 0, beyond * sizeof *l->indicator);
    return CTS_OK;
}

CtsStatus cts_sheets_lattice_init(SheetsPatch *l, const SheetsPatch *patch, CtsError *err)
{
    /* One point beyond the last pixel. */
    const int width = patch->width / 2 + 1, height = patch->height / 2 + 1;
    const size_t n = (size_t)width * (size_t)height,
                 n_groups = (size_t)sheets_groups_along(width) * (size_t)sheets_groups_along(height);
    CtsStatus st = CTS_OK;
    if (!l->may_show || width != l->width || height != l->height || !patch->depth_mm != !l->depth_mm) {
        cts_sheets_lattice_free(l);
        st = alloc_lattice(l, n, n_groups, patch->depth_mm, err);
    }
    l->grid = patch->grid + 1;
    l->x0 = patch->x0;
    l->y0 = patch->y0;
    l->width = width;
    l->height = height;
    for (size_t i = 0; !st && l->depth_mm && i < n; i++)
        l->depth_mm[i] = INFINITY;
    if (!st)
        memset(l->may_show, 0, n_groups * sizeof *l->may_show);
    return st;
}

bool cts_sheets_is_void(const SheetsPatch *from, int x0, int y0)
{
    const int across = sheets_groups_along(from->width), last_x = cts_smaller_int(x0 / 2 + 2, from->width - 1),
              last_y = cts_smaller_int(y0 / 2 + 2, from->height - 1);
    bool may_show = !from->grid->dense;
    for (int j = y0 / 2 / SHEETS_SIDE; j <= last_y / SHEETS_SIDE; j++)
        for (int i = x0 / 2 / SHEETS_SIDE; i <= last_x / SHEETS_SIDE; i++)
            may_show |= from->may_show[j * across + i];
    return !may_show;
}

bool cts_sheets_interpolate(SheetsPatch *to, const SheetsPatch *from, int x0, int y0, const SheetsJob *job)
{
    const float refined_from = (float)(REFINED_FROM * cts_scene_requested_error(job->scene));
    const size_t across = (size_t)from->width, column = (size_t)(x0 / 2);
    const bool whole = x0 + SHEETS_SIDE <= to->width && y0 + SHEETS_SIDE <= to->height;
    const f32x4 *point[3];
    f32x4 beside[3][3], indicator[3], low[3], high[3], rgba[SHEETS_LANES], of_pixels[SHEETS_SIDE];
    Pair pair[3][2];
    prefetch_group(to, (size_t)y0 * (size_t)to->width + (size_t)x0, from, (size_t)(y0 / 2) * across + column);
    for (int j = 0; j < 3; j++) {
        const size_t row = (size_t)cts_smaller_int(y0 / 2 + j, from->height - 1) * across;
        indicator[j] = *(const f32x4 *)(from->indicator + row + column);
        point[j] = (const f32x4 *)from->rgba + row + column;
        /* Beyond the lattice the last points stand for others. */
        for (int i = 0; i < 3 && !whole; i++)
            beside[j][i] = ((const f32x4 *)from->rgba)[row + (size_t)cts_smaller_int(x0 / 2 + i, from->width - 1)];
        point[j] = whole ? point[j] : beside[j];
        for (int i = 0; i < 2; i++)
            pair[j][i] = pair_of(point[j] + i);
        low[j] = f32x4_min(pair[j][0].low, pair[j][1].low);
        high[j] = f32x4_max(pair[j][0].high, pair[j][1].high);
    }
    const f32x4 most = f32x4_max(f32x4_max(high[0], high[1]), high[2]),
                least = f32x4_min(f32x4_min(low[0], low[1]), low[2]);
    if (!(most[3] > (from->grid->pitch > 2 ? VISIBLE_FROM_COARSE : VISIBLE_FROM)) ||
        largest_channel(most - least) > refined_from ||
        (from->depth_mm && whole && is_curved(from, (size_t)(y0 / 2) * across + column, job->view.slab_mm)))
        return false;
    for (int j = 0; j < 2; j++)
        interpolate_rows(rgba + 8 * j, of_pixels + 2 * j, point + j, pair + j, indicator[j], indicator[j + 1]);
    sheets_store(to, x0, y0, rgba, (const float *)of_pixels);
    if (to->depth_mm)
        interpolate_depths(to, from, x0, y0);
    return true;
}
