#include "engine/splat/composite.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/mutation.h"
#include <math.h>

CtsStatus cts_entries_init(CtsEntries *entries, const CtsLut *lut, double length_mm, CtsError *err)
{
    float alpha = 0, extinction = 0;
    *entries = (CtsEntries){.low = UINT16_MAX, .top = (uint16_t)(lut->n - 1)};
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

void cts_entries_free(CtsEntries *entries)
{
    cts_free(&entries->entry);
}

CtsStatus cts_compositor_init(CtsCompositor *c, const CtsSimd *simd, const CtsPatches *patches, const CtsRaster *raster,
                              const CtsScene *scene, CtsPicture *picture, CtsError *err)
{
    const CtsView *view = &scene->view;
    CtsStatus st;
    *c = (CtsCompositor){.simd = simd, .patches = *patches, .picture = picture};
    if ((st = cts_raster_row_init(&c->row, raster, simd, err)) ||
        (st = cts_alloc_array(&c->grey, (size_t)raster->width + 16, err)) ||
        (st = cts_alloc_array(&c->border, (size_t)patches->n[0] + 1, err)))
        return st;
    c->border_base = NAN;
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
    cts_free(&c->border);
}

/* Set depth_mm: the first sample that takes light, and from then on the first by which half of the light is taken. */
static void note_depth(const CtsCompositor *c, const CtsPlane *plane, int y, int xa, int n)
{
    const float *pixels = c->picture->pixels + 4 * ((size_t)y * (size_t)c->picture->width + (size_t)xa);
    float *depth_mm = c->picture->depth_mm + (size_t)y * (size_t)c->picture->width + (size_t)xa;
    const double row_mm = c->depth_mm[0] + c->depth_mm[2] * (c->picture->first_row + y) + c->depth_mm[3] * plane->layer;
    for (int i = 0; i < n; i++) {
        const float before = pixels[4 * i + 3], taken = plane->entries->entry[c->grey[i]][3];
        const float after = before + before * taken;
        if (after < before && (isinf(depth_mm[i]) || (before > 0.5f && after <= 0.5f)))
            depth_mm[i] = (float)(row_mm + c->depth_mm[1] * (xa + i));
    }
}

/* Lighting is timed on every sixteenth row, as a clock on each would cost more than it tells. */
static bool is_timed(const CtsPlane *plane, int y)
{
    return plane->light && (y & 15) == 0;
}

static void composite_open(CtsCompositor *c, const CtsPlane *plane, int y, int xa, int xb)
{
    const int n = xb - xa;
    CtsPlaces places;
    if (!c->row.raster->filled)
        cts_raster_fill(&c->row, xa, xb);
    cts_raster_places(&c->row, xa, &places);
    c->simd->sample(&plane->sheets, &places, n, c->grey);
    c->samples += (uint64_t)n;
    if (c->picture->depth_mm)
        note_depth(c, plane, y, xa, n);
    float *pixels = c->picture->pixels + 4 * ((size_t)y * (size_t)c->picture->width + (size_t)xa);
    const bool timed = is_timed(plane, y);
    const double start_ms = timed ? cts_wall_ms() : 0;
    const bool closed = plane->light ? c->simd->light(pixels, c->grey, n, plane->entries, &places, plane->light)
                                     : c->simd->blend(pixels, c->grey, n, plane->entries);
    if (closed && c->occlusion)
        cts_occlusion_update(c->occlusion, c->picture->pixels, y, xa, xb);
    if (timed)
        c->timed_blend_ms += cts_wall_ms() - start_ms;
}

static void composite_span(CtsCompositor *c, const CtsPlane *plane, int y, int xa, int xb)
{
    if (!c->occlusion) {
        if (xa < xb)
            composite_open(c, plane, y, xa, xb);
        return;
    }
    for (int past; (xa = cts_occlusion_next(c->occlusion, y, xa, xb, false)) < xb; xa = past) {
        past = cts_occlusion_next(c->occlusion, y, xa, xb, true);
        composite_open(c, plane, y, xa, past);
    }
}

/* Lattice points a patch, as a power of two. */
static int patch_shift(const CtsCompositor *c, int axis)
{
    return __builtin_ctz((unsigned)(CTS_PATCH * c->patches.density[axis]));
}

/* The patch that a pixel's cell lies in. */
static int patch_at(const CtsCompositor *c, int axis, int x)
{
    const double at = c->row.base[axis] + c->row.raster->by_x[axis] * (double)x;
    const int patch = at > 0 ? (int)at >> patch_shift(c, axis) : 0;
    return patch < c->patches.n[axis] ? patch : c->patches.n[axis] - 1;
}

/* Where pixels xa..xb-1, which run through patches from the side `rising` says, pass the border below patch t. */
static int find_border(const CtsCompositor *c, int axis, int t, int xa, int xb)
{
    const bool rising = c->row.raster->by_x[axis] > 0;
    if (t <= 0)
        return rising ? xa : xb;
    if (t >= c->patches.n[axis])
        return rising ? xb : xa;
    return cts_raster_passes(&c->row, axis, (double)(t << patch_shift(c, axis)), xa, xb);
}

static bool has_borders(const CtsCompositor *c)
{
    return c->row.raster->column_tables && c->row.raster->moves[0];
}

/* All rows of a plane pass patches at the same pixels when the picture's rows run along the lattice's. */
static void set_borders(CtsCompositor *c)
{
    if (!has_borders(c) || c->border_base == c->row.layer_base[0])
        return;
    c->border_base = c->row.base[0] = c->row.layer_base[0];
    for (int t = 0; t <= c->patches.n[0]; t++)
        c->border[t] = find_border(c, 0, t, c->row.columns[0].first, c->row.columns[0].past);
}

static int border(const CtsCompositor *c, int axis, int t, int xa, int xb)
{
    if (axis == 1 || !has_borders(c))
        return find_border(c, axis, t, xa, xb);
    return c->border[t] < xa ? xa : c->border[t] > xb ? xb : c->border[t];
}

/* Pixels xa..xb-1, all within one row of patches. */
static void composite_patch_row(CtsCompositor *c, const CtsPlane *plane, int y, int patch_row, int xa, int xb)
{
    const uint64_t *shown = plane->shown + (size_t)patch_row * (size_t)c->patches.n_words;
    const bool moves = c->row.raster->moves[0], rising = c->row.raster->by_x[0] > 0;
    const int only = moves ? 0 : patch_at(c, 0, xa), n = moves ? c->patches.n[0] : only + 1;
    for (int t = only, past; xa < xb && cts_next_run(shown, n, &t, &past); t = past) {
        const int from = moves ? border(c, 0, rising ? t : past, xa, xb) : xa;
        const int to = moves ? border(c, 0, rising ? past : t, from, xb) : xb;
        composite_span(c, plane, y, from, to);
        *(rising ? &xa : &xb) = rising ? to : from;
    }
}

static void composite_row(CtsCompositor *c, const CtsPlane *plane, int y)
{
    const bool moves = c->row.raster->moves[1], rising = c->row.raster->by_x[1] > 0;
    if (!plane->shown) {
        composite_span(c, plane, y, c->row.x0, c->row.x1);
        return;
    }
    if (!moves) {
        composite_patch_row(c, plane, y, patch_at(c, 1, 0), c->row.x0, c->row.x1);
        return;
    }
    for (int x = c->row.x0; x < c->row.x1;) {
        const int patch_row = patch_at(c, 1, x);
        const int past = border(c, 1, rising ? patch_row + 1 : patch_row, x, c->row.x1);
        composite_patch_row(c, plane, y, patch_row, x, past);
        x = past;
    }
}

void cts_composite_rows(CtsCompositor *c, const CtsPlane *plane, int y0, int y1)
{
    cts_raster_begin_plane(&c->row, plane->layer);
    if (plane->shown)
        set_borders(c);
    for (int y = y0; y < y1; y++) {
        const bool timed = is_timed(plane, y);
        const double start_ms = timed ? cts_wall_ms() : 0;
        if (cts_raster_begin_row(&c->row, y))
            composite_row(c, plane, y);
        if (timed)
            c->timed_ms += cts_wall_ms() - start_ms;
    }
}
