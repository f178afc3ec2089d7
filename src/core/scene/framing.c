#include "core/scene/framing.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "core/scene/view.h"
#include "core/volume/macrocells.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The share of the picture's tighter side that what is visible fills. */
#define FILLED 0.9
/* Per mm: what takes away 1/255 of the light within 1 cm. */
#define FAINT_PER_MM 0.0004

struct CtsVisible {
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    CtsMacrocells *own; /* where the volume has none */
    uint32_t *below;    /* prefix sums: levels below g that show, g up to n_levels */
    size_t n_levels;
    int (*cell)[3]; /* macro-cells that show something: those on the rim of it first */
    size_t n_rim, n_cells;
};

static bool level_shows(const CtsPreset *p, const CtsVolume *volume, uint16_t grey)
{
    const double hu = cts_volume_hu(volume, grey);
    if (p->mode == CTS_MODE_COMPOSITE)
        return cts_preset_extinction_per_mm(p, hu) >= FAINT_PER_MM;
    return grey > 0 && hu > p->window_low_hu + (p->window_high_hu - p->window_low_hu) / 255;
}

static bool range_shows(const CtsVisible *v, CtsRange range)
{
    return v->below[(size_t)range.high + 1] > v->below[range.low];
}

static bool cell_shows(const CtsVisible *v, int i, int j, int k)
{
    const int *n = v->macrocells->n;
    return range_shows(v, v->macrocells->range[((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0] + (size_t)i]);
}

/* False for a macro-cell that is never where what is visible ends, because others three further are visible on all
 * sides: along the axis that a direction follows most, anything there gains two macro-cells at least, and can lose no
 * more than one along each of the other axes. */
static bool is_rim(const CtsVisible *v, const int cell[3])
{
    for (int axis = 0; axis < 3; axis++)
        for (int side = -3; side <= 3; side += 6) {
            int other[3] = {cell[0], cell[1], cell[2]};
            other[axis] += side;
            if (other[axis] < 0 || other[axis] >= v->macrocells->n[axis] ||
                !cell_shows(v, other[0], other[1], other[2]))
                return true;
        }
    return false;
}

/* What each macro-cell is. */
typedef enum Kind { SHOWS_NOTHING, INNER, RIM } Kind;

typedef struct Looking {
    const CtsVisible *visible;
    uint8_t *kind;
} Looking;

static void look_at_layers(void *context, int worker, size_t first, size_t end)
{
    const Looking *const l = context;
    const CtsVisible *v = l->visible;
    const int *n = v->macrocells->n;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++) {
        uint8_t *kind = l->kind + (size_t)k * (size_t)n[1] * (size_t)n[0];
        for (int j = 0; j < n[1]; j++)
            for (int i = 0; i < n[0]; i++)
                *kind++ = !cell_shows(v, i, j, k) ? SHOWS_NOTHING : is_rim(v, (const int[]){i, j, k}) ? RIM : INNER;
    }
}

static void collect(CtsVisible *v, const uint8_t *kinds, Kind wanted)
{
    const int *n = v->macrocells->n;
    const size_t n_all = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    const uint8_t *const end = kinds + n_all;
    for (const uint8_t *at = kinds; (at = memchr(at, (int)wanted, (size_t)(end - at))); at++) {
        const int number = (int)(at - kinds), row = number / n[0];
        int *cell = v->cell[v->n_cells++];
        cell[0] = number % n[0];
        cell[1] = row % n[1];
        cell[2] = row / n[1];
    }
}

static CtsStatus list_cells(CtsVisible *v, int n_threads, CtsError *err)
{
    const int *n = v->macrocells->n;
    const size_t n_all = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    uint8_t *kinds = NULL;
    CtsStatus st;
    if (!(st = cts_alloc_array(&v->cell, n_all, err)) && !(st = cts_alloc_array(&kinds, n_all, err))) {
        Looking looking = {v, kinds};
        cts_parallel(cts_threads(n_threads), (size_t)n[2], 1, look_at_layers, &looking);
        collect(v, kinds, RIM);
        v->n_rim = v->n_cells;
        collect(v, kinds, INNER);
    }
    cts_free(&kinds);
    return st;
}

CtsStatus cts_visible_new(CtsVisible **visible, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                          CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsVisible *v = *visible = calloc(1, sizeof *v);
    if (!v)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    v->volume = volume;
    if (!volume->macrocells)
        st = cts_macrocells_new(&v->own, volume, n_threads, err);
    if (st)
        goto end;
    v->macrocells = volume->macrocells ? volume->macrocells : v->own;
    v->n_levels = (size_t)v->macrocells->all.high + 1;
    if ((st = cts_alloc_array(&v->below, v->n_levels + 1, err)))
        goto end;
    v->below[0] = 0;
    for (size_t g = 0; g < v->n_levels; g++)
        v->below[g + 1] = v->below[g] + level_shows(preset, volume, (uint16_t)g);
    st = list_cells(v, n_threads, err);
end:
    if (st)
        cts_visible_free(visible);
    return st;
}

void cts_visible_free(CtsVisible **visible)
{
    CtsVisible *v = *visible;
    if (!v)
        return;
    cts_free(&v->below);
    cts_free(&v->cell);
    cts_macrocells_free(&v->own);
    free(v);
    *visible = NULL;
}

bool cts_visible_any(const CtsVisible *visible)
{
    return visible->n_cells > 0;
}

/* A direction as a linear form of voxel coordinates. */
typedef struct Form {
    double per_voxel[3];
} Form;

/* The form's largest value over a box of voxels. */
static double form_top(const Form *f, const int low[3], const int high[3])
{
    double top = 0;
    for (int axis = 0; axis < 3; axis++)
        top += f->per_voxel[axis] * (f->per_voxel[axis] > 0 ? high[axis] : low[axis]);
    return top;
}

static double form_bottom(const Form *f, const int low[3], const int high[3])
{
    return form_top(f, high, low);
}

/* A slab across a view: what lies outside is not seen. */
typedef struct Cut {
    Form depth;
    double near_mm, far_mm; /* of the form's values */
} Cut;

static bool is_cut_off(const Cut *cut, const int low[3], const int high[3])
{
    return cut &&
           (form_top(&cut->depth, low, high) < cut->near_mm || form_bottom(&cut->depth, low, high) > cut->far_mm);
}

/* Of a box of size cells between voxels: from low to high, no further than the volume. */
static void box_of(const CtsVisible *v, const int cell[3], int size, int low[3], int high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const int last = v->volume->dims[axis] - 1;
        low[axis] = cell[axis] * size;
        high[axis] = low[axis] + size < last ? low[axis] + size : last;
    }
}

/* The range of the 2 x 2 x 2 voxels about one cell, fewer where the volume is one voxel thick. */
static CtsRange range_between(const CtsVisible *v, const int low[3], const int high[3])
{
    const int *n = v->volume->dims;
    CtsRange range = {UINT16_MAX, 0};
    for (int k = low[2]; k <= high[2]; k++)
        for (int j = low[1]; j <= high[1]; j++)
            for (int i = low[0]; i <= high[0]; i++) {
                const uint16_t g = v->volume->grey[((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0] + (size_t)i];
                range.low = g < range.low ? g : range.low;
                range.high = g > range.high ? g : range.high;
            }
    return range;
}

/* Raises *best to the top of every visible cell between voxels of a box that is above it. */
static void search_box(const CtsVisible *v, const Form *f, const Cut *cut, const int low[3], const int high[3],
                       double *best)
{
    int a[3], b[3];
    for (a[2] = low[2]; a[2] == low[2] || a[2] < high[2]; a[2]++)
        for (a[1] = low[1]; a[1] == low[1] || a[1] < high[1]; a[1]++)
            for (a[0] = low[0]; a[0] == low[0] || a[0] < high[0]; a[0]++) {
                box_of(v, a, 1, a, b);
                const double top = form_top(f, a, b);
                if (top > *best && !is_cut_off(cut, a, b) && range_shows(v, range_between(v, a, b)))
                    *best = top;
            }
}

/* The same for a macro-cell, by its fine cells. */
static void search_cell(const CtsVisible *v, const Form *f, const Cut *cut, const int cell[3], double *best)
{
    enum { PARTS = CTS_MACROCELL / CTS_FINE_MACROCELL };
    const int *n = v->macrocells->n_fine;
    for (int part = 0; part < PARTS * PARTS * PARTS; part++) {
        const int fine[3] = {cell[0] * PARTS + part % PARTS, cell[1] * PARTS + part / PARTS % PARTS,
                             cell[2] * PARTS + part / (PARTS * PARTS)};
        int low[3], high[3];
        if (fine[0] >= n[0] || fine[1] >= n[1] || fine[2] >= n[2] ||
            !range_shows(v, v->macrocells->fine[((size_t)fine[2] * (size_t)n[1] + (size_t)fine[1]) * (size_t)n[0] +
                                                (size_t)fine[0]]))
            continue;
        box_of(v, fine, CTS_FINE_MACROCELL, low, high);
        if (form_top(f, low, high) > *best && !is_cut_off(cut, low, high))
            search_box(v, f, cut, low, high, best);
    }
}

static Form form_of(const CtsVolume *volume, const double direction_lps[3])
{
    Form f;
    for (int axis = 0; axis < 3; axis++)
        f.per_voxel[axis] = cts_dot3(volume->step_lps[axis], direction_lps);
    return f;
}

/* Where a slab cuts, what was deep inside becomes the rim. */
static double reach(const CtsVisible *v, const double direction_lps[3], const Cut *cut)
{
    const Form f = form_of(v->volume, direction_lps);
    const size_t n_cells = cut ? v->n_cells : v->n_rim;
    double best = -INFINITY, first_top = -INFINITY;
    size_t first = 0;
    /* The most promising macro-cell first, so that few others need a closer look. */
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < n_cells; i++) {
            int low[3], high[3];
            box_of(v, v->cell[i], CTS_MACROCELL, low, high);
            if (is_cut_off(cut, low, high))
                continue;
            const double top = form_top(&f, low, high);
            if (pass == 0 && top > first_top) {
                first_top = top;
                first = i;
            } else if (pass == 1 && top > best) {
                search_cell(v, &f, cut, v->cell[i], &best);
            }
        }
        if (pass == 0 && first_top > -INFINITY)
            search_cell(v, &f, cut, v->cell[first], &best);
    }
    return best + cts_dot3(v->volume->origin_lps, direction_lps);
}

double cts_visible_reach(const CtsVisible *visible, const double direction_lps[3])
{
    return reach(visible, direction_lps, NULL);
}

/* The settings' slab across a view; NULL where there is none. */
static const Cut *cut_of(const CtsVisible *v, const CtsRenderSettings *s, const double forward_lps[3], Cut *cut)
{
    double from_origin[3];
    if (!(s->slab_mm > 0))
        return NULL;
    cts_volume_centre_lps(v->volume, from_origin);
    for (int c = 0; c < 3; c++)
        from_origin[c] -= v->volume->origin_lps[c];
    const double middle_mm = cts_dot3(from_origin, forward_lps) - s->slab_at_mm;
    *cut = (Cut){form_of(v->volume, forward_lps), middle_mm - s->slab_mm / 2, middle_mm + s->slab_mm / 2};
    return cut;
}

/* What is visible between its ends along a direction. */
typedef struct Span {
    double low_mm, high_mm;
} Span;

/* The ends along two directions, each end by itself. */
typedef struct Ends {
    const CtsVisible *visible;
    const Cut *cut;
    const double *direction[2];
    double reach_mm[4]; /* back and forth along the one, then along the other */
} Ends;

static void find_ends(void *context, int worker, size_t first, size_t end)
{
    Ends *const e = context;
    (void)worker;
    for (size_t i = first; i < end; i++) {
        const double *d = e->direction[i / 2], sign = i % 2 ? 1 : -1;
        e->reach_mm[i] = sign * reach(e->visible, (const double[]){sign * d[0], sign * d[1], sign * d[2]}, e->cut);
    }
}

static void spans_along(const CtsVisible *v, const double one[3], const double other[3], const Cut *cut, int n_threads,
                        Span span[2])
{
    Ends ends = {.visible = v, .cut = cut, .direction = {one, other}};
    cts_parallel(cts_threads(n_threads), 4, 1, find_ends, &ends);
    for (int i = 0; i < 2; i++)
        span[i] = (Span){ends.reach_mm[2 * i], ends.reach_mm[2 * i + 1]};
}

/* The farther end, from a point. */
static double half_width(Span span, double from_mm)
{
    return fmax(span.high_mm - from_mm, from_mm - span.low_mm);
}

static double middle(Span span)
{
    return 0.5 * (span.low_mm + span.high_mm);
}

/* The centre of a rotation lies on the head-foot axis through the middle of what is visible; half[0] and half[1] become
 * the farthest that any frame needs, to the right and up. */
static void frame_rotation(const CtsVisible *v, CtsRenderSettings *s, double half[2])
{
    static const double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    Span span[3];
    spans_along(v, axes[0], axes[1], NULL, s->n_threads, span);
    spans_along(v, axes[1], axes[2], NULL, s->n_threads, span + 1);
    for (int axis = 0; axis < 3; axis++)
        s->centre_lps[axis] = middle(span[axis]);
    for (int i = 0; i < s->rotation_frames; i++) {
        CtsViewAxes view;
        cts_view_axes(&view, s->azimuth_deg + 360.0 * i / s->rotation_frames, s->elevation_deg);
        Cut store;
        const Cut *cut = cut_of(v, s, view.forward_lps, &store);
        spans_along(v, view.right_lps, view.up_lps, cut, s->n_threads, span);
        half[0] = fmax(half[0], half_width(span[0], cts_dot3(s->centre_lps, view.right_lps)));
        half[1] = fmax(half[1], half_width(span[1], cts_dot3(s->centre_lps, view.up_lps)));
    }
}

static void frame_view(const CtsVisible *v, CtsRenderSettings *s, double half[2])
{
    CtsViewAxes axes;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    Cut store;
    const Cut *cut = cut_of(v, s, axes.forward_lps, &store);
    Span span[2];
    spans_along(v, axes.right_lps, axes.up_lps, cut, s->n_threads, span);
    for (int c = 0; c < 3; c++)
        s->centre_lps[c] = middle(span[0]) * axes.right_lps[c] + middle(span[1]) * axes.up_lps[c];
    for (int i = 0; i < 2; i++)
        half[i] = half_width(span[i], middle(span[i]));
}

void cts_framing_find(const CtsVisible *v, CtsRenderSettings *settings)
{
    double half[2] = {0, 0};
    CtsRenderSettings s = *settings;
    if (!cts_visible_any(v))
        return;
    if (s.rotation_frames > 1)
        frame_rotation(v, &s, half);
    else
        frame_view(v, &s, half);
    s.mm_per_pixel = fmax(2 * half[0] / (FILLED * s.width), 2 * half[1] / (FILLED * s.height));
    s.centre_given = true;
    if (s.mm_per_pixel > 0 && isfinite(s.mm_per_pixel))
        *settings = s;
}

CtsStatus cts_framing_settle(const CtsVolume *volume, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err)
{
    CtsVisible *visible = NULL;
    CtsPreset p = *preset;
    if (settings->fit != CTS_FIT_VISIBLE || settings->mm_per_pixel != 0)
        return CTS_OK;
    if (settings->mode >= 0)
        p.mode = (CtsMode)settings->mode;
    const CtsStatus st = cts_visible_new(&visible, volume, &p, settings->n_threads, err);
    if (!st)
        cts_framing_find(visible, settings);
    cts_visible_free(&visible);
    return st;
}
