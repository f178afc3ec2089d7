#include "table/couch_grid.h"

#include "base/mem.h"
#include <math.h>
#include <omp.h>
#include <string.h>

static const double CELL_MM = 2, MOUTH_MM = 10, FAR_EXTENT_MM = 40;
/* Air or padding, but not an emphysematous lung. */
static const double OUTER_AIR_HU = -930;
enum { MAX_BLOCK = 32 };

CouchGrid couch_grid(const CouchScene *scene, const int lo[3], const int hi[3])
{
    CouchGrid g = {.step_mm = INFINITY};
    for (int axis = 0; axis < 3; axis++) {
        const double voxels = round(CELL_MM / scene->spacing_mm[axis]);
        g.lo[axis] = lo[axis];
        g.hi[axis] = hi[axis];
        g.block[axis] = voxels < 1 ? 1 : voxels > MAX_BLOCK ? MAX_BLOCK : (int)voxels;
        g.dims[axis] = (hi[axis] - lo[axis]) / g.block[axis] + 1;
        g.cell_mm[axis] = g.block[axis] * scene->spacing_mm[axis];
        g.step_mm = fmin(g.step_mm, g.cell_mm[axis]);
    }
    for (int axis = 0; axis < 3; axis++)
        g.every[axis] = (int)fmin(round(g.cell_mm[axis] / g.step_mm), 1000);
    return g;
}

CouchGrid couch_grid_whole(const CouchScene *scene)
{
    const int *dims = scene->volume->dims, lo[3] = {0, 0, 0}, hi[3] = {dims[0] - 1, dims[1] - 1, dims[2] - 1};
    return couch_grid(scene, lo, hi);
}

/* The axes of the n-th layer of growth, n from 1. Cross and box by turns make the ball an octagon. */
static unsigned layer_axes(const CouchGrid *g, int layer)
{
    unsigned axes = 0;
    for (int axis = 0; axis < 3; axis++)
        axes |= (unsigned)(layer % g->every[axis] == 0) << axis;
    return axes;
}

static CtsNeighbours layer_shape(int layer)
{
    return layer % 2 ? CTS_CROSS : CTS_BOX;
}

static void swap(CtsBits *a, CtsBits *b)
{
    const CtsBits t = *a;
    *a = *b;
    *b = t;
}

/* Grow by the layers first to last. */
static void dilate_n(CtsBits *bits, CtsBits *scratch, const CouchGrid *g, int first, int last, int n_threads)
{
    for (int layer = first; layer <= last; layer++) {
        cts_bits_dilate(bits, scratch, layer_shape(layer), layer_axes(g, layer), n_threads);
        swap(bits, scratch);
    }
}

/* A part of thickness_mm or more survives this many layers of erosion. */
static int layers_of(const CouchGrid *g, double thickness_mm)
{
    return (int)ceil((thickness_mm / g->step_mm - 1) / 2);
}

static int cell_width(const CouchGrid *g, int axis, int cell)
{
    const int left = g->hi[axis] - g->lo[axis] + 1 - cell * g->block[axis];
    return left < g->block[axis] ? left : g->block[axis];
}

/* The counts of a row of cells while runs are added: whole cells as a number that begins at one cell and ends at
 * another, the cells at a run's ends for themselves. */
typedef struct RowCounts {
    uint16_t *ends, *starts; /* of the cells, and one more */
    const uint16_t *cell_of; /* of each voxel from lo on */
} RowCounts;

/* Add the voxels first <= i < end of one row, counted from the grid's first. */
static inline void count_run(const RowCounts *c, int block, int first, int end)
{
    const int from = c->cell_of[first], to = c->cell_of[end - 1];
    if (from == to) {
        c->ends[from] = (uint16_t)(c->ends[from] + end - first);
        return;
    }
    c->ends[from] = (uint16_t)(c->ends[from] + (from + 1) * block - first);
    c->ends[to] = (uint16_t)(c->ends[to] + end - to * block);
    c->starts[from + 1] = (uint16_t)(c->starts[from + 1] + block);
    c->starts[to] = (uint16_t)(c->starts[to] - block);
}

/* The counts of one row of cells, in c->ends; false when they are all 0. */
static bool count_row(const CouchGrid *g, const CtsParts *p, const uint8_t *flags, int cj, int ck, const RowCounts *c)
{
    const int j0 = g->lo[1] + cj * g->block[1], j1 = j0 + cell_width(g, 1, cj);
    const int k0 = g->lo[2] + ck * g->block[2], k1 = k0 + cell_width(g, 2, ck);
    const size_t n_bytes = ((size_t)g->dims[0] + 1) * sizeof *c->ends;
    const int n_columns = g->hi[0] - g->lo[0] + 1;
    bool any = false;
    memset(c->ends, 0, n_bytes);
    memset(c->starts, 0, n_bytes);
    for (int k = k0; k < k1; k++)
        for (int j = j0; j < j1; j++) {
            const size_t row = (size_t)k * (size_t)p->dims[1] + (size_t)j;
            for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++) {
                if (!flags[p->runs[r].part])
                    continue;
                const int first = (int)p->runs[r].first - g->lo[0], end = (int)p->runs[r].end - g->lo[0];
                if (first >= n_columns)
                    break;
                const int from = first > 0 ? first : 0, to = end < n_columns ? end : n_columns;
                if (from < to) {
                    count_run(c, g->block[0], from, to);
                    any = true;
                }
            }
        }
    uint16_t open = 0;
    for (int i = 0; any && i < g->dims[0]; i++) {
        open = (uint16_t)(open + c->starts[i]);
        c->ends[i] = (uint16_t)(c->ends[i] + open);
    }
    return any;
}

/* The cells of one row that hold a voxel, and those that are half full; the last one may be narrower than the others.
 */
static void threshold_cells(const CouchGrid *g, const uint16_t *counts, int j, int k, CtsBits *any, CtsBits *solid)
{
    const int rows = cell_width(g, 1, j) * cell_width(g, 2, k), last = g->dims[0] - 1;
    cts_bits_threshold_row(cts_bits_row(any, j, k), counts, g->dims[0], 1);
    if (!solid)
        return;
    uint64_t *row = cts_bits_row(solid, j, k);
    cts_bits_threshold_row(row, counts, g->dims[0], (uint16_t)((g->block[0] * rows + 1) / 2));
    if (2 * counts[last] >= cell_width(g, 0, last) * rows)
        cts_bits_set(solid, last, j, k);
}

/* One row of voxels of the grid: the cell of each. */
static CtsStatus number_cells(const CouchGrid *g, uint16_t **cell_of, CtsError *err)
{
    const size_t n = (size_t)(g->hi[0] - g->lo[0] + 1);
    const CtsStatus st = cts_alloc_array(cell_of, n, err);
    for (size_t i = 0; !st && i < n; i++)
        (*cell_of)[i] = (uint16_t)(i / (size_t)g->block[0]);
    return st;
}

/* Rows of cells, all or those that are flagged. */
static CtsStatus fill_cells(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, const uint8_t *flags,
                            const uint8_t *rows, CtsBits *any, CtsBits *solid, CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint16_t *counts = NULL, *cell_of = NULL;
    const size_t row = (size_t)g->dims[0] + 1;
    if ((st = cts_alloc_array(&counts, 2 * row * (size_t)scene->n_threads, err)) ||
        (st = number_cells(g, &cell_of, err)))
        goto end;
#pragma omp parallel for schedule(dynamic) num_threads(scene->n_threads)
    for (int k = 0; k < g->dims[2]; k++) {
        uint16_t *const mine = counts + 2 * row * (size_t)omp_get_thread_num();
        const RowCounts c = {mine, mine + row, cell_of};
        for (int j = 0; j < g->dims[1]; j++)
            if ((!rows || rows[(size_t)k * (size_t)g->dims[1] + (size_t)j]) && count_row(g, p, flags, j, k, &c))
                threshold_cells(g, c.ends, j, k, any, solid);
    }
end:
    cts_free(&counts);
    cts_free(&cell_of);
    return st;
}

CtsStatus couch_cells(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, const uint8_t *flags,
                      CtsBits *any, CtsBits *solid, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_bits_new(any, g->dims, err)) || (solid && (st = cts_bits_new(solid, g->dims, err))))
        return st;
    return fill_cells(scene, g, p, flags, NULL, any, solid, err);
}

CtsStatus couch_more_cells(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, const uint8_t *flags,
                           const uint8_t *flags_before, CtsBits *any, CtsBits *solid, CtsError *err)
{
    uint8_t *rows = NULL;
    CtsStatus st = cts_alloc_zeroed(&rows, (size_t)g->dims[1] * (size_t)g->dims[2], err);
    for (uint32_t n = 0; !st && n < p->n_parts; n++) {
        const CtsPart *it = &p->parts[n];
        if (!flags[n] || flags_before[n])
            continue;
        for (int k = couch_cell(g, 2, it->lo[2]); k <= couch_cell(g, 2, it->hi[2]); k++)
            for (int j = couch_cell(g, 1, it->lo[1]); j <= couch_cell(g, 1, it->hi[1]); j++)
                rows[(size_t)k * (size_t)g->dims[1] + (size_t)j] = 1;
    }
    if (!st)
        st = fill_cells(scene, g, p, flags, rows, any, solid, err);
    cts_free(&rows);
    return st;
}

static bool is_full(const CtsBits *bits)
{
    const size_t n = cts_bits_n_words(bits), last = bits->row_words - 1;
    for (size_t w = 0, in_row = 0; w < n; w++, in_row = in_row < last ? in_row + 1 : 0)
        if (bits->words[w] != cts_bits_mask(bits, in_row))
            return false;
    return true;
}

/* Set the cells of the six faces. */
static void set_faces(CtsBits *bits)
{
    const int *n = bits->dims;
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++) {
            const bool face = j == 0 || j == n[1] - 1 || k == 0 || k == n[2] - 1;
            cts_bits_fill(cts_bits_row(bits, j, k), 0, face ? n[0] : 1);
            cts_bits_set(bits, n[0] - 1, j, k);
        }
}

/* The thickness of the flagged part as far as it lies in the grid. What leaves the grid is thin there if edge_is_air,
 * else it goes on for ever. */
static CtsStatus thickness_in(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, const uint8_t *flags,
                              bool edge_is_air, double limit_mm, double *thickness_mm, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsBits any = {0}, solid = {0}, scratch = {0};
    if ((st = couch_cells(scene, g, p, flags, &any, &solid, err)) || (st = cts_bits_new(&scratch, g->dims, err)))
        goto end;
    /* The complement grows until nothing is left. */
    int n = 0;
    cts_bits_combine(&any, CTS_BITS_NOT, &solid);
    if (edge_is_air)
        set_faces(&any);
    for (; !is_full(&any) && (2 * n + 1) * g->step_mm < limit_mm; n++) {
        cts_bits_dilate(&any, &scratch, layer_shape(n + 1), layer_axes(g, n + 1), scene->n_threads);
        swap(&any, &scratch);
    }
    *thickness_mm = fmin(is_full(&any) ? (2 * n - 0.5) * g->step_mm : limit_mm, limit_mm);
end:
    cts_bits_free(&any);
    cts_bits_free(&solid);
    cts_bits_free(&scratch);
    return st;
}

/* The cells of g in the middle of it, as many as something limit_mm thick needs and half as many again. */
static CouchGrid middle_of(const CouchScene *scene, const CouchGrid *g, double limit_mm)
{
    int lo[3], hi[3];
    for (int axis = 0; axis < 3; axis++) {
        const int wanted = (int)ceil(1.5 * limit_mm / g->cell_mm[axis]) + 2;
        const int n = wanted < g->dims[axis] ? wanted : g->dims[axis];
        lo[axis] = g->lo[axis] + (g->dims[axis] - n) / 2 * g->block[axis];
        const int last = lo[axis] + n * g->block[axis] - 1;
        hi[axis] = last < g->hi[axis] ? last : g->hi[axis];
    }
    return couch_grid(scene, lo, hi);
}

CtsStatus couch_thickness(const CouchScene *scene, const CtsParts *p, uint32_t part, double limit_mm,
                          double *thickness_mm, CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint8_t *flags = NULL;
    int lo[3], hi[3];
    /* One cell of air around it, but none where the volume ends. */
    for (int axis = 0; axis < 3; axis++) {
        const int pad = couch_grid_whole(scene).block[axis], last = p->dims[axis] - 1;
        lo[axis] = p->parts[part].lo[axis] > pad ? p->parts[part].lo[axis] - pad : 0;
        hi[axis] = p->parts[part].hi[axis] < last - pad ? p->parts[part].hi[axis] + pad : last;
    }
    const CouchGrid g = couch_grid(scene, lo, hi), middle = middle_of(scene, &g, limit_mm);
    *thickness_mm = 0;
    if ((st = cts_alloc_zeroed(&flags, p->n_parts, err)))
        goto end;
    flags[part] = 1;
    /* The body is as thick as it gets in its middle already, and to know that is enough. */
    st = thickness_in(scene, &middle, p, flags, true, limit_mm, thickness_mm, err);
    if (!st && *thickness_mm < limit_mm)
        st = thickness_in(scene, &g, p, flags, false, limit_mm, thickness_mm, err);
end:
    cts_free(&flags);
    return st;
}

/* Flag the parts that hold a set bit of marker. */
static void flag_marked(const CtsParts *p, const CtsBits *marker, uint8_t *flags)
{
    const size_t n_rows = (size_t)p->dims[1] * (size_t)p->dims[2];
    for (size_t row = 0; row < n_rows; row++) {
        const uint64_t *words = marker->words + row * marker->row_words;
        for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++)
            if (!flags[p->runs[r].part])
                flags[p->runs[r].part] = cts_bits_count_run(words, (int)p->runs[r].first, (int)p->runs[r].end) > 0;
    }
}

CtsStatus couch_thick(const CouchScene *scene, const CouchGrid *g, const CtsBits *any, const CtsBits *solid,
                      double opening_mm, double bulky_mm, CtsBits *core, CtsBits *thick, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsBits shallow = {0}, deep = {0}, scratch = {0};
    CtsParts parts = {0};
    uint8_t *flags = NULL;
    const int n_core = layers_of(g, opening_mm), n_deep = layers_of(g, bulky_mm);
    if ((st = cts_bits_new(&shallow, g->dims, err)) || (st = cts_bits_new(&deep, g->dims, err)) ||
        (st = cts_bits_new(&scratch, g->dims, err)) || (st = cts_bits_new(core, g->dims, err)) ||
        (st = cts_bits_new(thick, g->dims, err)))
        goto end;
    /* Both erosions, as growth of the complement. */
    cts_bits_combine(&deep, CTS_BITS_NOT, solid);
    dilate_n(&deep, &scratch, g, 1, n_core, scene->n_threads);
    cts_bits_combine(&shallow, CTS_BITS_NOT, &deep);
    dilate_n(&deep, &scratch, g, n_core + 1, n_deep, scene->n_threads);
    cts_bits_combine(&scratch, CTS_BITS_NOT, &deep);
    swap(&deep, &scratch);
    if ((st = cts_parts_find(&parts, &shallow, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&flags, parts.n_parts, err)))
        goto end;
    flag_marked(&parts, &deep, flags);
    cts_parts_paint(&parts, flags, core, scene->n_threads);
    cts_bits_combine(thick, CTS_BITS_COPY, core);
    dilate_n(thick, &scratch, g, 1, n_core + 1, scene->n_threads);
    cts_bits_combine(thick, CTS_BITS_AND, any);
end:
    cts_free(&flags);
    cts_parts_free(&parts);
    cts_bits_free(&shallow);
    cts_bits_free(&deep);
    cts_bits_free(&scratch);
    return st;
}

static bool is_outer_air(const CouchScene *scene, const CouchGrid *g, int ci, int cj, int ck)
{
    const CtsVolume *v = scene->volume;
    const int at[3] = {ci, cj, ck};
    int lo[3], n[3];
    for (int axis = 0; axis < 3; axis++) {
        lo[axis] = g->lo[axis] + at[axis] * g->block[axis];
        n[axis] = cell_width(g, axis, at[axis]);
    }
    uint64_t sum = 0;
    for (int k = lo[2]; k < lo[2] + n[2]; k++)
        for (int j = lo[1]; j < lo[1] + n[1]; j++)
            for (int i = lo[0]; i < lo[0] + n[0]; i++)
                sum += v->grey[((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0] + (size_t)i];
    return v->hu_offset + v->hu_step * (double)sum / ((double)n[0] * n[1] * n[2]) < OUTER_AIR_HU;
}

/* Flag the parts of the air that are outer air at a side of the slices. The sides toward head and feet do not count:
 * there the windpipe and the lungs may leave the picture. */
static void flag_outer(const CouchScene *scene, const CouchGrid *g, const CtsParts *air, uint8_t *flags)
{
    for (int ck = 0; ck < g->dims[2]; ck++)
        for (int cj = 0; cj < g->dims[1]; cj++) {
            const bool edge_row = scene->head_axis != 1 && (cj == 0 || cj == g->dims[1] - 1);
            const size_t row = (size_t)ck * (size_t)g->dims[1] + (size_t)cj;
            for (uint32_t r = air->row_start[row]; r < air->row_start[row + 1]; r++) {
                const CtsRun *run = &air->runs[r];
                for (uint32_t i = run->first; i < run->end && edge_row && !flags[run->part]; i++)
                    flags[run->part] = is_outer_air(scene, g, (int)i, cj, ck);
                if (scene->head_axis == 0 || flags[run->part])
                    continue;
                flags[run->part] = (run->first == 0 && is_outer_air(scene, g, 0, cj, ck)) ||
                                   ((int)run->end == g->dims[0] && is_outer_air(scene, g, g->dims[0] - 1, cj, ck));
            }
        }
}

CtsStatus couch_inside(const CouchScene *scene, const CouchGrid *g, const CtsBits *set, CtsBits *inside,
                       bool *has_outside, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsBits grown = {0}, scratch = {0};
    CtsParts air = {0};
    uint8_t *flags = NULL;
    const int n_mouth = (int)round(MOUTH_MM / 2 / g->step_mm);
    if ((st = cts_bits_new(&grown, g->dims, err)) || (st = cts_bits_new(&scratch, g->dims, err)) ||
        (st = cts_bits_new(inside, g->dims, err)))
        goto end;
    cts_bits_combine(&grown, CTS_BITS_COPY, set);
    dilate_n(&grown, &scratch, g, 1, n_mouth, scene->n_threads);
    cts_bits_combine(&scratch, CTS_BITS_NOT, &grown);
    if ((st = cts_parts_find(&air, &scratch, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&flags, air.n_parts, err)))
        goto end;
    flag_outer(scene, g, &air, flags);
    *has_outside = false;
    for (uint32_t n = 0; n < air.n_parts; n++)
        *has_outside |= flags[n];
    cts_parts_paint(&air, flags, inside, scene->n_threads);
    dilate_n(inside, &scratch, g, 1, n_mouth, scene->n_threads);
    cts_bits_combine(&grown, CTS_BITS_COPY, inside);
    cts_bits_combine(inside, CTS_BITS_NOT, &grown);
    cts_bits_combine(inside, CTS_BITS_OR, set);
end:
    cts_free(&flags);
    cts_parts_free(&air);
    cts_bits_free(&grown);
    cts_bits_free(&scratch);
    return st;
}

CtsStatus couch_near(const CouchScene *scene, const CouchGrid *g, const CtsBits *set, double near_mm, CtsBits *near,
                     CtsError *err)
{
    CtsStatus st;
    CtsBits scratch = {0};
    if ((st = cts_bits_new(near, g->dims, err)) || (st = cts_bits_new(&scratch, g->dims, err)))
        goto end;
    cts_bits_combine(near, CTS_BITS_COPY, set);
    dilate_n(near, &scratch, g, 1, (int)ceil(near_mm / g->step_mm), scene->n_threads);
end:
    cts_bits_free(&scratch);
    return st;
}

/* All cells with a set one before or at them and one behind or at them along an axis. */
static void span(const CtsBits *in, int axis, CtsBits *out)
{
    const size_t ny = (size_t)in->dims[1], n_rows = ny * (size_t)in->dims[2], n = in->row_words;
    const size_t stride = (axis == 1 ? 1 : ny) * n;
    cts_bits_combine(out, CTS_BITS_COPY, in);
    if (axis == 0) {
        for (size_t row = 0; row < n_rows; row++) {
            uint64_t *words = out->words + row * n;
            int first = -1, last = -1;
            for (int i = 0; i < in->dims[0]; i++)
                if (words[i >> 6] >> (i & 63) & 1) {
                    first = first < 0 ? i : first;
                    last = i;
                }
            if (first >= 0)
                cts_bits_fill(words, first, last + 1);
        }
        return;
    }
    /* Forward in place, then backward with what has been seen so far. */
    for (size_t row = 0; row < n_rows; row++)
        for (size_t w = 0; w < n && (axis == 1 ? row % ny : row / ny); w++)
            out->words[row * n + w] |= out->words[row * n + w - stride];
    const size_t n_lines = n_rows / (size_t)in->dims[axis];
    for (size_t line = 0; line < n_lines; line++) {
        const size_t first = axis == 1 ? line * ny * n : line * n;
        for (size_t w = 0; w < n; w++) {
            uint64_t seen = 0;
            for (size_t t = (size_t)in->dims[axis]; t-- > 0;) {
                seen |= in->words[first + t * stride + w];
                out->words[first + t * stride + w] &= seen;
            }
        }
    }
}

CtsStatus couch_surrounds(const CouchScene *scene, const CtsBits *ring, const CtsBits *held, bool *yes, CtsError *err)
{
    CtsStatus st;
    CtsBits in_all = {0}, in_one = {0};
    if ((st = cts_bits_new(&in_all, ring->dims, err)) || (st = cts_bits_new(&in_one, ring->dims, err)))
        goto end;
    cts_bits_combine(&in_all, CTS_BITS_COPY, held);
    for (int axis = 0; axis < 3; axis++)
        if (axis != scene->head_axis) {
            span(ring, axis, &in_one);
            cts_bits_combine(&in_all, CTS_BITS_AND, &in_one);
        }
    *yes = 2 * cts_bits_count(&in_all) > cts_bits_count(held);
end:
    cts_bits_free(&in_all);
    cts_bits_free(&in_one);
    return st;
}

/* Take out the parts that extend over less than FAR_EXTENT_MM in every direction. */
static CtsStatus drop_small(const CouchScene *scene, const CouchGrid *g, CtsBits *far, CtsError *err)
{
    CtsParts parts = {0};
    uint8_t *flags = NULL;
    CtsStatus st = CTS_OK;
    if ((st = cts_parts_find(&parts, far, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&flags, parts.n_parts, err)))
        goto end;
    for (uint32_t n = 0; n < parts.n_parts; n++)
        for (int axis = 0; axis < 3; axis++)
            flags[n] |= (parts.parts[n].hi[axis] - parts.parts[n].lo[axis] + 1) * g->cell_mm[axis] >= FAR_EXTENT_MM;
    cts_bits_combine(far, CTS_BITS_AND_NOT, far);
    cts_parts_paint(&parts, flags, far, scene->n_threads);
end:
    cts_free(&flags);
    cts_parts_free(&parts);
    return st;
}

/* The parts of any that hold a cell of thick. */
static CtsStatus joined(const CouchScene *scene, const CtsBits *any, const CtsBits *thick, CtsBits *found,
                        CtsError *err)
{
    CtsParts parts = {0};
    uint8_t *flags = NULL;
    CtsStatus st;
    if ((st = cts_bits_new(found, any->dims, err)) || (st = cts_parts_find(&parts, any, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&flags, parts.n_parts, err)))
        goto end;
    flag_marked(&parts, thick, flags);
    cts_parts_paint(&parts, flags, found, scene->n_threads);
end:
    cts_free(&flags);
    cts_parts_free(&parts);
    return st;
}

CtsStatus couch_far(const CouchScene *scene, const CouchGrid *g, const CtsBits *any, const CtsBits *thick,
                    const CtsBits *inside, double reach_mm, CtsBits *far, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsBits near = {0}, scratch = {0};
    if ((st = cts_bits_new(&near, g->dims, err)) || (st = cts_bits_new(&scratch, g->dims, err)) ||
        (st = joined(scene, any, thick, far, err)))
        goto end;
    cts_bits_combine(&near, CTS_BITS_COPY, thick);
    cts_bits_combine(far, CTS_BITS_AND_NOT, inside);
    const int n_layers = (int)ceil(reach_mm / g->step_mm);
    for (int layer = 1; layer <= n_layers && !cts_bits_is_empty(far); layer++) {
        cts_bits_dilate(&near, &scratch, layer_shape(layer), layer_axes(g, layer), scene->n_threads);
        cts_bits_combine(&scratch, CTS_BITS_AND, any);
        swap(&near, &scratch);
        cts_bits_combine(far, CTS_BITS_AND_NOT, &near);
    }
    cts_bits_combine(far, CTS_BITS_AND_NOT, &near);
    if (!cts_bits_is_empty(far))
        st = drop_small(scene, g, far, err);
end:
    cts_bits_free(&near);
    cts_bits_free(&scratch);
    return st;
}
