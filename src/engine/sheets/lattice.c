#include "engine/sheets/lattice.h"

#include "base/mem.h"
#include <math.h>

/* Points of a lattice that hold n pixels between them, with one point beyond the last pixel. */
static int lattice_points(int n)
{
    return n / 2 + 1;
}

/* Difference of neighbours, in requested errors, from which the pixels between them are marched: bilinear interpolation
 * is off by an eighth of the change of slope, so that a difference of eight requested errors is off by about one; such
 * pixels are few. */
#define REFINED_FROM 8.0
/* Opacity from which a point sees anything: a step of eight bits. Of what passes faint borders alone, nothing says what
 * lies between. */
#define SEEN_FROM (1.0F / 256)
/* Error of an interpolated pixel as a share of the difference of the marched ones around it. */
#define INTERPOLATED_SHARE 0.25F

/* The largest range of a channel. */
static float range_of(const f32x4 rgba[], int n)
{
    f32x4 low = rgba[0], high = rgba[0];
    for (int i = 1; i < n; i++) {
        low = f32x4_min(rgba[i], low);
        high = f32x4_max(rgba[i], high);
    }
    const f32x4 range = high - low;
    return sheets_larger(sheets_larger(range[0], range[1]), sheets_larger(range[2], range[3]));
}

/* Pixel of a patch as the mean of n (1, 2 or 4) marched ones. Where these see nothing, or lie far apart in depth, the
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

/* interpolate() for the pixels whose first of two by two is pixel `at`, without depth: `row` is the number of pixels in
 * a row, `corner` points to the marched one, `across` is the number of points in a row. */
static void interpolate_four(SheetsPatch *to, size_t at, size_t row, const SheetsPatch *from, size_t corner,
                             size_t across)
{
    const f32x4 *const upper = (const f32x4 *)(from->rgba + 4 * corner), *const lower =
                                                                             (const f32x4 *)(from->rgba +
                                                                                             4 * (corner + across));
    const float *const above = from->indicator + corner, *const below = above + across;
    const f32x4 beside = upper[0] + upper[1], under = upper[0] + lower[0], all = beside + lower[0] + lower[1];
    const f32x4 low[2] = {f32x4_min(upper[0], upper[1]), f32x4_min(lower[0], lower[1])},
                high[2] = {f32x4_max(upper[0], upper[1]), f32x4_max(lower[0], lower[1])};
    const f32x4 range[3] = {high[0] - low[0], f32x4_max(upper[0], lower[0]) - f32x4_min(upper[0], lower[0]),
                            f32x4_max(high[0], high[1]) - f32x4_min(low[0], low[1])};
    const f32x4 most = sheets_largest_channels(range[0], range[1], range[2], range[2]);
    f32x4 *const rgba = (f32x4 *)(to->rgba + 4 * at), *const next = (f32x4 *)(to->rgba + 4 * (at + row));
    float *const indicator = to->indicator + at;
    rgba[0] = upper[0];
    rgba[1] = beside * 0.5F;
    next[0] = under * 0.5F;
    next[1] = all * 0.25F;
    indicator[0] = above[0];
    indicator[1] = above[0] * 0.5F + above[1] * 0.5F + INTERPOLATED_SHARE * most[0];
    indicator[row] = above[0] * 0.5F + below[0] * 0.5F + INTERPOLATED_SHARE * most[1];
    indicator[row + 1] =
        above[0] * 0.25F + above[1] * 0.25F + below[0] * 0.25F + below[1] * 0.25F + INTERPOLATED_SHARE * most[2];
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
            if (right && below && !to->depth_mm) {
                interpolate_four(to, at, width, from, first, across);
                continue;
            }
            interpolate(to, at, from, beside, 1);
            if (right)
                interpolate(to, at + 1, from, beside, 2);
            if (below)
                interpolate(to, at + width, from, above, 2);
            if (right && below)
                interpolate(to, at + width + 1, from, beside, 4);
        }
}

/* True if depth bends by more than half a slab between 3 x 3 points of the lattice, of those that have a depth. */
static bool bends(const SheetsPatch *from, size_t at, double slab_mm)
{
    const size_t across = (size_t)from->width;
    for (int i = 0; i < 3; i++)
        for (int down = 0; down < 2; down++) {
            const size_t step = down ? across : 1;
            const float *const d = from->depth_mm + at + (size_t)i * (down ? 1 : across);
            const double bend = (double)d[0] - 2 * (double)d[step] + (double)d[2 * step];
            if (fabs(bend) > slab_mm / 2 && fabs(bend) < (double)SHEETS_FAR / 8)
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

CtsStatus cts_sheets_lattice_init(SheetsPatch *l, const SheetsJob *job, const SheetsPatch *pixels, CtsError *err)
{
    CtsStatus st;
    *l = (SheetsPatch){.grid = &job->grid[1],
                       .x0 = pixels->x0,
                       .y0 = pixels->y0,
                       .width = lattice_points(pixels->width),
                       .height = lattice_points(pixels->height)};
    const size_t n = (size_t)l->width * (size_t)l->height;
    if ((st = cts_alloc_zeroed(&l->rgba, 4 * n, err)) || (st = cts_alloc_zeroed(&l->indicator, n, err)) ||
        (pixels->depth_mm && (st = cts_alloc_array(&l->depth_mm, n, err))))
        return st;
    for (size_t i = 0; l->depth_mm && i < n; i++)
        l->depth_mm[i] = SHEETS_FAR;
    return CTS_OK;
}

bool cts_sheets_interpolate(SheetsPatch *to, const SheetsPatch *from, int x0, int y0, float refined_from,
                            double slab_mm)
{
    f32x4 corner[9];
    bool any = false;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) {
            const int x = sheets_at_most(x0 / 2 + i, from->width - 1), y = sheets_at_most(y0 / 2 + j, from->height - 1);
            const size_t at = (size_t)y * (size_t)from->width + (size_t)x;
            corner[3 * j + i] = *(const f32x4 *)(from->rgba + 4 * at);
            any |= corner[3 * j + i][3] > SEEN_FROM;
        }
    const size_t at = (size_t)(y0 / 2) * (size_t)from->width + (size_t)(x0 / 2);
    const bool has_nine = x0 / 2 + 2 < from->width && y0 / 2 + 2 < from->height;
    if (!any || range_of(corner, 9) > refined_from || (from->depth_mm && has_nine && bends(from, at, slab_mm)))
        return false;
    interpolate_group(to, from, x0, y0);
    return true;
}
