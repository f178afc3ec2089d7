#include "engine/splat/composite.h"

#include "base/bits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include <math.h>
#include <string.h>

CtsStatus cts_entries_init(CtsEntries *entries, const CtsLut *lut, double length_mm, CtsError *err)
{
    float alpha = 0, extinction = 0;
    *entries = (CtsEntries){.low = UINT16_MAX, .high = UINT16_MAX, .top = (uint16_t)(lut->n - 1)};
    const CtsStatus st = cts_alloc_array(&entries->entry, (size_t)lut->n, err);
    for (int g = 0; g < lut->n && !st; g++) {
        /* Below the preset's points neighbours have the same. */
        if (lut->extinction_per_mm[g] != extinction) {
            extinction = lut->extinction_per_mm[g];
            alpha = (float)-expm1(-(double)extinction * (CTS_MUTATED(OPACITY_STEP) ? 1 : length_mm));
        }
        for (int c = 0; c < 3; c++)
            entries->entry[g][c] = lut->rgb[g][c] * alpha;
        entries->entry[g][3] = -alpha;
        if (alpha > 0) {
            entries->low = g < entries->low ? (uint16_t)g : entries->low;
            entries->high = (uint16_t)g;
        }
    }
    return st;
}

CtsStatus cts_compositor_init(CtsCompositor *c, const CtsSimd *simd, const CtsPatches *patches, const CtsRaster *raster,
                              const CtsScene *scene, CtsPicture *picture, CtsError *err)
{
    const CtsView *view = &scene->view;
    const size_t n_words = (size_t)raster->width / 64 + 1;
    CtsStatus st;
    *c = (CtsCompositor){.simd = simd, .patches = *patches, .picture = picture};
    if ((st = cts_raster_row_init(&c->row, raster, simd, err)) ||
        (st = cts_alloc_zeroed(&c->grey, (size_t)raster->width + 64, err)) ||
        (st = cts_alloc_array(&c->shown, 2 * n_words, err)))
        return st;
    c->marks.bits = c->shown + n_words;
    /* Rays start in the plane through the centre, half a diagonal behind the camera plane. */
    const double mm_per_layer = 1 / view->forward_vox[view->axis], mm = view->mm_per_pixel;
    double start[3];
    cts_view_ray(view, 0, 0, start);
    c->depth_mm[0] = cts_volume_diagonal_mm(scene->volume) / 2 - start[view->axis] * mm_per_layer;
    c->depth_mm[1] = -mm * view->right_vox[view->axis] * mm_per_layer;
    c->depth_mm[2] = mm * view->up_vox[view->axis] * mm_per_layer;
    c->depth_mm[3] = mm_per_layer;
    return CTS_OK;
}

void cts_compositor_free(CtsCompositor *c)
{
    cts_raster_row_free(&c->row);
    cts_free(&c->grey);
    cts_free(&c->shown);
}

/* Sets depth_mm: the first sample that absorbs, and from then on the first by which half of the light is absorbed. */
static void find_depth(const CtsCompositor *c, const CtsPlane *plane, int y)
{
    const size_t row = (size_t)y * (size_t)c->picture->width;
    const double row_mm = c->depth_mm[0] + c->depth_mm[2] * (c->picture->first_row + y) + c->depth_mm[3] * plane->layer;
    for (int w = c->marks.first; w < c->marks.past; w++)
        for (uint64_t left = c->marks.bits[w]; left; left &= left - 1) {
            const int x = 64 * w + __builtin_ctzll(left);
            float *const depth_mm = &c->picture->depth_mm[row + (size_t)x];
            const float before = c->picture->pixels[4 * (row + (size_t)x) + 3];
            const float after = before + before * plane->entries->entry[c->grey[x]][3];
            if (after < before && (isinf(*depth_mm) || (before > 0.5f && after <= 0.5f)))
                *depth_mm = (float)(row_mm + c->depth_mm[1] * x);
        }
}

/* Lattice points a cell, as a power of two; along v those of all rows that are shown alike. */
static int cell_shift(const CtsCompositor *c, int axis)
{
    return __builtin_ctz((unsigned)((axis == 1 ? c->patches.row_cells : 1) * c->patches.density[axis]));
}

static int n_cells(const CtsCompositor *c, int axis)
{
    return axis == 1 && c->patches.row_cells > 1 ? c->patches.n[1] : c->patches.n_cells[axis];
}

/* The cell that a pixel lies in. */
static int cell_of_pixel(const CtsCompositor *c, int axis, int x)
{
    const double at = c->row.base[axis] + c->row.raster->by_x[axis] * (double)x;
    const int cell = at > 0 ? (int)at >> cell_shift(c, axis) : 0;
    return cell < n_cells(c, axis) ? cell : n_cells(c, axis) - 1;
}

/* The index among pixels xa..xb-1, whose cells rise or fall as `rising` says, of the first one past the border below
 * cell t. */
static int find_border(const CtsCompositor *c, int axis, int t, int xa, int xb)
{
    const bool rising = c->row.raster->by_x[axis] > 0;
    if (t <= 0)
        return rising ? xa : xb;
    if (t >= n_cells(c, axis))
        return rising ? xb : xa;
    return cts_raster_passes(&c->row, axis, (double)(t << cell_shift(c, axis)), xa, xb);
}

/* Marks those of pixels xa..xb-1, all within one row of cells, that are potentially visible. */
static void mark_cell_row(const CtsCompositor *c, const CtsPlane *plane, int row, int xa, int xb)
{
    const uint64_t *shown = plane->shown + (size_t)(row * c->patches.row_cells) * (size_t)c->patches.n_cell_words;
    const bool moves = c->row.raster->moves[0], rising = c->row.raster->by_x[0] > 0;
    const int only = moves ? 0 : cell_of_pixel(c, 0, xa), n = moves ? c->patches.n_cells[0] : only + 1;
    for (int t = only, past; xa < xb && cts_next_run(shown, n, &t, &past); t = past) {
        const int from = moves ? find_border(c, 0, rising ? t : past, xa, xb) : xa;
        const int to = moves ? find_border(c, 0, rising ? past : t, from, xb) : xb;
        cts_bits_fill(c->shown, from, to);
        *(rising ? &xa : &xb) = rising ? to : from;
    }
}

/* Marks the potentially visible pixels of a row. */
static void mark_row(const CtsCompositor *c, const CtsPlane *plane)
{
    const bool moves = c->row.raster->moves[1], rising = c->row.raster->by_x[1] > 0;
    const int x1 = c->row.x1;
    if (!plane->shown)
        cts_bits_fill(c->shown, c->row.x0, x1);
    else if (!moves)
        mark_cell_row(c, plane, cell_of_pixel(c, 1, 0), c->row.x0, x1);
    for (int x = c->row.x0; plane->shown && moves && x < x1;) {
        const int cell_row = cell_of_pixel(c, 1, x);
        const int past = find_border(c, 1, rising ? cell_row + 1 : cell_row, x, x1);
        mark_cell_row(c, plane, cell_row, x, past);
        x = past;
    }
}

/* The same, unless the row before had the same. */
static void find_shown_pixels(CtsCompositor *c, const CtsPlane *plane)
{
    const bool alike = c->row.raster->column_tables && c->row.raster->moves[0];
    const int cell_row = !alike ? -1 : plane->shown ? cell_of_pixel(c, 1, 0) : 0;
    if (cell_row >= 0 && cell_row == c->shown_row)
        return;
    c->shown_row = cell_row;
    c->marks.first = c->row.x0 / 64;
    c->marks.past = (c->row.x1 + 63) / 64;
    memset(c->shown + c->marks.first, 0, (size_t)(c->marks.past - c->marks.first) * sizeof *c->shown);
    mark_row(c, plane);
    while (c->marks.first < c->marks.past && !c->shown[c->marks.first])
        c->marks.first++;
    while (c->marks.first < c->marks.past && !c->shown[c->marks.past - 1])
        c->marks.past--;
}

/* Fill in the places of marked pixels. */
static void find_places(CtsCompositor *c, CtsPlaces *places)
{
    for (int w = c->marks.first; w < c->marks.past && !c->row.raster->filled; w++) {
        const int xa = 64 * w, xb = xa + 64;
        if (c->marks.bits[w])
            cts_raster_fill(&c->row, xa > c->row.x0 ? xa : c->row.x0, xb < c->row.x1 ? xb : c->row.x1);
    }
    cts_raster_places(&c->row, places);
}

static void composite_row(CtsCompositor *c, const CtsPlane *plane, int y)
{
    uint64_t *const closed = c->culling ? cts_culling_row(c->culling, y) : NULL, any = 0;
    float *const pixels = c->picture->pixels + 4 * (size_t)y * (size_t)c->picture->width;
    CtsPlaces places;
    find_shown_pixels(c, plane);
    for (int w = c->marks.first; w < c->marks.past; w++)
        any |= c->marks.bits[w] = closed ? c->shown[w] & ~closed[w] : c->shown[w];
    if (!any)
        return;
    find_places(c, &places);
    c->samples += 8 * c->simd->sample(&plane->sheets, &places, plane->entries, &c->marks, c->grey);
    if (c->picture->depth_mm)
        find_depth(c, plane, y);
    c->simd->blend(pixels, c->grey, &c->marks, plane->entries, &places, plane->light, closed);
}

void cts_composite_rows(CtsCompositor *c, const CtsPlane *plane, int y0, int y1)
{
    cts_raster_begin_plane(&c->row, plane->layer);
    c->shown_row = -1;
    for (int y = y0; y < y1; y++)
        if (cts_raster_begin_row(&c->row, y))
            composite_row(c, plane, y);
}
