#include "input/labels/contours.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Width in pixels up to which a contour within another one may protrude from it: shared edges with rounded decimals,
 * and far less than contours are drawn to. */
#define ROUNDING_PIXELS 0.05

void cts_outline_free(CtsOutline *o)
{
    free(o->contours);
    free(o->points);
    free(o->crossings);
}

/* A vertex within 1e-6 pixels of a voxel's centre is snapped to it: rounding of its decimals. */
static double snapped_vertex(double x)
{
    return fabs(x - rint(x)) < 1e-6 ? rint(x) : x;
}

CtsStatus cts_outline_add(CtsOutline *o, const double (*lps)[3], size_t n, bool is_xor, CtsError *err)
{
    const CtsLabelGrid *const g = o->grid;
    const double gap_mm = g->n_slices > 1 ? cts_label_slice_at_mm(g, 1) - cts_label_slice_at_mm(g, 0) : 1;
    double low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double at_mm = cts_dot3(lps[i], g->normal_lps);
        low = fmin(low, at_mm);
        high = fmax(high, at_mm);
    }
    /* Far less than the half of a gap that separates slices; 0.01 mm: rounding. */
    if (!(high - low <= 0.2 * gap_mm + 0.01)) {
        o->slant_mm = fmax(o->slant_mm, high - low);
        return CTS_OK;
    }
    CtsStatus st = cts_grow(&o->contours, o->n_contours, err);
    if (st)
        return st;
    o->contours[o->n_contours++] =
        (CtsContour){.at_mm = (low + high) / 2, .first = o->n_points, .n = n, .is_xor = is_xor};
    for (size_t i = 0; i < n && !(st = cts_grow(&o->points, o->n_points, err)); i++)
        memcpy(o->points[o->n_points++], lps[i], sizeof *o->points);
    return st;
}

double cts_outline_area(const CtsOutline *o)
{
    double all = 0;
    for (size_t k = 0; k < o->n_contours; k++) {
        const CtsContour *const c = &o->contours[k];
        double sum[3] = {0};
        for (size_t i = 0; i < c->n; i++) {
            double cross[3], a[3], b[3];
            cts_sub3(o->points[c->first + i], o->points[c->first], a);
            cts_sub3(o->points[c->first + (i + 1) % c->n], o->points[c->first], b);
            cts_cross3(a, b, cross);
            for (int axis = 0; axis < 3; axis++)
                sum[axis] += cross[axis] / 2;
        }
        all += cts_norm3(sum);
    }
    return all;
}

/* Adds the crossings of a contour's edges with a row: an edge includes its lower end and excludes its upper one, so
 * that a vertex on a row counts once. */
static CtsStatus add_crossings(CtsOutline *o, size_t contour, double row, CtsError *err)
{
    const CtsContour *const c = o->contours + contour;
    CtsStatus st = CTS_OK;
    for (size_t i = 0, before = c->n - 1; i < c->n && !st; before = i++) {
        const double *a = o->pixels[c->first + before], *b = o->pixels[c->first + i];
        if ((a[1] > row) == (b[1] > row) || (st = cts_grow(&o->crossings, o->n_crossings, err)))
            continue;
        o->crossings[o->n_crossings++] =
            (CtsCrossing){snapped_vertex((b[0] - a[0]) * (row - a[1]) / (b[1] - a[1]) + a[0]), contour};
    }
    return st;
}

/* Vertices in pixels of a slice, and each contour's box. */
static void to_pixels(CtsOutline *o, int slice, size_t first, size_t end)
{
    for (CtsContour *c = o->contours + first; c < o->contours + end; c++) {
        c->low[0] = c->low[1] = INFINITY;
        c->high[0] = c->high[1] = -INFINITY;
        for (size_t i = c->first; i < c->first + c->n; i++)
            for (int axis = 0; axis < 2; axis++) {
                double offset[3];
                cts_sub3(o->points[i], o->grid->position_lps[slice], offset);
                const double x = o->pixels[i][axis] = snapped_vertex(cts_dot3(o->inverse[axis], offset));
                c->low[axis] = fmin(c->low[axis], x);
                c->high[axis] = fmax(c->high[axis], x);
            }
    }
}

/* Notes which parts two contours have in a row: 1 of the first alone, 2 of the second alone, 3 in common. */
static CtsStatus find_parts(CtsOutline *o, size_t a, size_t b, double row, bool part[4], CtsError *err)
{
    o->n_crossings = 0;
    CtsStatus st;
    if ((st = add_crossings(o, a, row, err)) || (st = add_crossings(o, b, row, err)))
        return st;
    qsort(o->crossings, o->n_crossings, sizeof *o->crossings, cts_compare_double);
    for (size_t i = 0, inside = 0; i + 1 < o->n_crossings; i++) {
        inside ^= o->crossings[i].contour == a ? 1 : 2;
        if (o->crossings[i + 1].x - o->crossings[i].x > (inside == 3 ? 0 : ROUNDING_PIXELS))
            part[inside] = true;
    }
    return CTS_OK;
}

/* True if two contours overlap and neither encloses the other, or both do, as the same one stored twice. Sampled in
 * rows half a pixel apart, and eight or more. */
static CtsStatus is_united(CtsOutline *o, size_t a, size_t b, bool *united, CtsError *err)
{
    const CtsContour *const p = o->contours + a, *const q = o->contours + b;
    const double low = fmax(fmax(p->low[1], q->low[1]), -1);
    const double high = fmin(fmin(p->high[1], q->high[1]), o->grid->rows);
    bool part[4] = {false};
    CtsStatus st = CTS_OK;
    *united = false;
    if (!(low < high && p->low[0] <= q->high[0] && q->low[0] <= p->high[0]))
        return CTS_OK;
    for (int axis = 0; axis < 2; axis++) {
        part[1] |= fmax(q->low[axis] - p->low[axis], p->high[axis] - q->high[axis]) > ROUNDING_PIXELS;
        part[2] |= fmax(p->low[axis] - q->low[axis], q->high[axis] - p->high[axis]) > ROUNDING_PIXELS;
    }
    const int n = 8 + (int)(2 * (high - low));
    for (int i = 0; i < n && !st && !(part[1] && part[2] && part[3]); i++)
        st = find_parts(o, a, b, low + (i + 0.5) / n * (high - low), part, err);
    *united = part[3] && part[1] == part[2];
    return st;
}

static size_t group_of(const CtsOutline *o, size_t contour)
{
    while (o->contours[contour].group != contour)
        contour = o->contours[contour].group;
    return contour;
}

/* Groups the contours of a plane. */
static CtsStatus unite(CtsOutline *o, size_t first, size_t end, CtsError *err)
{
    CtsStatus st = CTS_OK;
    bool any_xor = false;
    for (size_t i = first; i < end; i++) {
        o->contours[i].group = i;
        any_xor |= o->contours[i].is_xor;
    }
    for (size_t b = first; b < end && !any_xor; b++)
        for (size_t a = first; a < b && !st; a++) {
            const size_t one = group_of(o, a), other = group_of(o, b);
            bool united = false;
            if (one != other)
                st = is_united(o, a, b, &united, err);
            if (united)
                o->contours[one > other ? one : other].group = one < other ? one : other;
        }
    for (size_t i = first; i < end; i++)
        o->contours[i].group = group_of(o, i);
    return st;
}

/* A centre lies inside when it lies in an odd number of groups: in one contour of each or more. */
static CtsStatus fill_row(const CtsOutline *o, CtsLabel *label, uint32_t row, CtsError *err)
{
    CtsStatus st = CTS_OK;
    bool inside = false;
    for (size_t i = 0; i + 1 < o->n_crossings; i++) {
        CtsContour *const c = o->contours + o->crossings[i].contour, *const leader = o->contours + c->group;
        const int before = leader->n_inside;
        c->inside = !c->inside;
        leader->n_inside += c->inside ? 1 : -1;
        inside ^= !before != !leader->n_inside;
        const double from = fmax(ceil(o->crossings[i].x), 0);
        const double to = fmin(ceil(o->crossings[i + 1].x), o->grid->columns);
        if (inside && from < to && !st)
            st = cts_label_add_run(label, row, (int)from, (int)to, err);
    }
    for (size_t i = 0; i < o->n_crossings; i++) {
        CtsContour *const c = o->contours + o->crossings[i].contour;
        c->inside = false;
        o->contours[c->group].n_inside = 0;
    }
    return st;
}

static CtsStatus fill_slice(CtsOutline *o, CtsLabel *label, int slice, const CtsContour *from, const CtsContour *to,
                            CtsError *err)
{
    const size_t first = (size_t)(from - o->contours), end = (size_t)(to - o->contours);
    double top = INFINITY, bottom = -INFINITY;
    to_pixels(o, slice, first, end);
    CtsStatus st = unite(o, first, end, err);
    for (const CtsContour *c = from; c < to; c++) {
        top = fmin(top, c->low[1]);
        bottom = fmax(bottom, c->high[1]);
    }
    const int last = (int)fmin(o->grid->rows - 1, fmax(floor(bottom), -1));
    for (int j = (int)fmax(0, fmin(ceil(top), o->grid->rows)); j <= last && !st; j++) {
        o->n_crossings = 0;
        for (size_t c = first; c < end && !st; c++)
            if (o->contours[c].low[1] <= j && o->contours[c].high[1] >= j)
                st = add_crossings(o, c, j, err);
        if (o->n_crossings)
            qsort(o->crossings, o->n_crossings, sizeof *o->crossings, cts_compare_double);
        if (!st)
            st = fill_row(o, label, (uint32_t)slice * (uint32_t)o->grid->rows + (uint32_t)j, err);
    }
    return st;
}

static int by_place(const void *a, const void *b)
{
    const CtsContour *x = a, *y = b;
    return x->at_mm != y->at_mm ? (x->at_mm < y->at_mm ? -1 : 1) : x->first < y->first ? -1 : x->first > y->first;
}

/* The slice of a contour plane: at most half the distance to the next slice away; 1e-6 mm is rounding. */
static int slice_at(const CtsLabelGrid *g, double at_mm)
{
    for (int k = 0; k < g->n_slices; k++) {
        const double here = cts_label_slice_at_mm(g, k), gap = cts_label_slice_thickness_mm(g, k);
        const double before = k > 0 ? here - cts_label_slice_at_mm(g, k - 1) : gap;
        const double behind = k + 1 < g->n_slices ? cts_label_slice_at_mm(g, k + 1) - here : gap;
        if (at_mm > here - before / 2 + 1e-6 && at_mm <= here + behind / 2 + 1e-6)
            return k;
    }
    return -1;
}

/* Each slice gets the nearest of its planes. */
static CtsStatus fill_slices(CtsOutline *o, CtsLabel *label, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsContour *nearest = NULL, *nearest_end = NULL;
    int slice = -1; /* of the nearest plane */
    qsort(o->contours, o->n_contours, sizeof *o->contours, by_place);
    for (size_t at = 0; !st && at < o->n_contours;) {
        const CtsContour *const first = o->contours + at;
        while (at < o->n_contours && o->contours[at].at_mm - first->at_mm < 0.01) /* of one plane */
            at++;
        const int here = slice_at(o->grid, first->at_mm);
        o->n_off += here < 0 || here == slice;
        if (here < 0)
            continue;
        if (here != slice && slice >= 0) {
            st = fill_slice(o, label, slice, nearest, nearest_end, err);
            o->n_unfilled += (size_t)(here - slice - 1);
        }
        const double slice_mm = cts_label_slice_at_mm(o->grid, here);
        if (here != slice || fabs(first->at_mm - slice_mm) < fabs(nearest->at_mm - slice_mm)) {
            nearest = first;
            nearest_end = o->contours + at;
        }
        slice = here;
    }
    if (!st && nearest)
        st = fill_slice(o, label, slice, nearest, nearest_end, err);
    cts_label_sort_runs(label);
    return st;
}

CtsStatus cts_outline_fill(CtsOutline *o, CtsLabel *label, CtsError *err)
{
    CtsStatus st = cts_alloc_array(&o->pixels, o->n_points, err);
    if (!st)
        st = fill_slices(o, label, err);
    cts_free(&o->pixels);
    o->n_contours = o->n_points = 0;
    return st;
}
