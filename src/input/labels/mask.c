#include "input/labels/mask.h"

#include "base/mem.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Scanned column i, row j of a slice lies at pixel (at[0] + i * by[0][0] + j * by[1][0], at[1] + ...) of a plane. */
typedef struct Affine {
    double at[2], by[2][2];
    bool whole; /* rounded: whole numbers of pixels along the axes */
} Affine;

typedef struct Place {
    double at_mm;
    int plane;
} Place;

typedef struct Placing {
    const CtsMask *mask;
    const CtsLabelReading *reading;
    const CtsLabelGrid *grid;
    double normal_lps[3], inverse[2][3]; /* of the mask; pixel = inverse * (point - position) */
    double *at_mm;                       /* of planes along the normal */
    Place *sorted;                       /* the same by rising place */
    double same_mm;                      /* planes no further apart lie in one place */
    double reach_mm;                     /* how far a plane stands for what lies before and behind it */
    uint64_t *n_mask;                    /* by value: pixels in the mask */
} Placing;

bool cts_mask_axes(const double step_lps[2][3], double inverse[2][3])
{
    const double *u = step_lps[0], *v = step_lps[1];
    const double uu = cts_dot3(u, u), vv = cts_dot3(v, v), uv = cts_dot3(u, v), det = uu * vv - uv * uv;
    for (int c = 0; c < 3; c++) {
        inverse[0][c] = (vv * u[c] - uv * v[c]) / det;
        inverse[1][c] = (uu * v[c] - uv * u[c]) / det;
    }
    return det > 1e-6 * uu * vv;
}

static CtsStatus find_axes(Placing *p, CtsError *err)
{
    if (!cts_mask_axes(p->mask->step_lps, p->inverse))
        return cts_fail(err, CTS_ERR_GEOMETRY, "its rows and columns do not span a plane");
    cts_cross3(p->mask->step_lps[0], p->mask->step_lps[1], p->normal_lps);
    const double length = cts_norm3(p->normal_lps);
    for (int c = 0; c < 3; c++)
        p->normal_lps[c] /= length;
    return CTS_OK;
}

static Affine affine_of(const Placing *p, int slice, int plane)
{
    Affine a = {.whole = true};
    double offset[3];
    for (int c = 0; c < 3; c++)
        offset[c] = p->grid->position_lps[slice][c] - p->mask->position_lps[plane][c];
    for (int r = 0; r < 2; r++) {
        a.at[r] = cts_dot3(p->inverse[r], offset);
        for (int axis = 0; axis < 2; axis++)
            a.by[axis][r] = cts_dot3(p->inverse[r], p->grid->step_lps[axis]);
    }
    /* Nearest pixels are those of the rounded numbers where these are less than half a pixel off in all corners. */
    const Affine r = {{rint(a.at[0]), rint(a.at[1])}, {{rint(a.by[0][0]), 0}, {0, rint(a.by[1][1])}}, true};
    a.whole = fabs(r.by[0][0]) == 1 && fabs(r.by[1][1]) == 1;
    for (int corner = 0; corner < 4; corner++) {
        const double i = corner & 1 ? p->grid->columns - 1 : 0, j = corner & 2 ? p->grid->rows - 1 : 0;
        for (int c = 0; c < 2; c++)
            a.whole &= fabs(a.at[c] - r.at[c] + i * (a.by[0][c] - r.by[0][c]) + j * (a.by[1][c] - r.by[1][c])) < 0.499;
    }
    return a.whole ? r : a;
}

static CtsStatus add(const Placing *p, int slice, int row, int value, int first, int end, CtsError *err)
{
    const int32_t label = p->mask->label_of[value];
    first = first < 0 ? 0 : first;
    end = end > p->grid->columns ? p->grid->columns : end;
    if (label < 0 || first >= end)
        return CTS_OK;
    return cts_label_add_run(&p->reading->labels->items[label],
                             (uint32_t)slice * (uint32_t)p->grid->rows + (uint32_t)row, first, end, err);
}

/* The next run of one value from i on, zeros passed over; false at the end of the row. */
static bool next_run(const uint16_t *row, int n, int *i, int *end)
{
    while (*i < n && row[*i] == 0) {
        uint64_t four = 1;
        while (*i + 4 <= n && (memcpy(&four, row + *i, sizeof four), four == 0))
            *i += 4;
        *i += *i < n && row[*i] == 0;
    }
    for (*end = *i; *end < n && row[*end] == row[*i]; ++*end)
        ;
    return *i < n;
}

/* A plane whose pixels are the slice's own, in the same or in the opposite order. */
static CtsStatus place_whole(const Placing *p, int slice, const Affine *a, const uint16_t *values, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const int right = (int)a->by[0][0], down = (int)a->by[1][1], n = p->mask->columns;
    for (int j = 0; j < p->grid->rows && !st; j++) {
        const double from = a->at[1] + j * down;
        if (from < 0 || from >= p->mask->rows)
            continue;
        const uint16_t *row = values + (size_t)from * (size_t)n;
        for (int i = 0, end; !st && next_run(row, n, &i, &end); i = end) {
            const double low = right > 0 ? i - a->at[0] : a->at[0] - end + 1, high = low + (end - i);
            if (high > 0 && low < p->grid->columns)
                st = add(p, slice, j, row[i], (int)low, (int)high, err);
        }
    }
    return st;
}

/* Any other plane: voxel by voxel. */
static CtsStatus place_nearest(const Placing *p, int slice, const Affine *a, const uint16_t *values, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int j = 0; j < p->grid->rows && !st; j++) {
        int value = 0, first = 0;
        for (int i = 0; i <= p->grid->columns && !st; i++) {
            const double x = floor(a->at[0] + i * a->by[0][0] + j * a->by[1][0] + 0.5);
            const double y = floor(a->at[1] + i * a->by[0][1] + j * a->by[1][1] + 0.5);
            const bool inside = i < p->grid->columns && x >= 0 && y >= 0 && x < p->mask->columns && y < p->mask->rows;
            const int here = inside ? values[(size_t)y * (size_t)p->mask->columns + (size_t)x] : 0;
            if (here == value)
                continue;
            if (value)
                st = add(p, slice, j, value, first, i, err);
            value = here;
            first = i;
        }
    }
    return st;
}

/* The first of the sorted planes at or behind a place along the normal. */
static int plane_behind(const Placing *p, double at_mm)
{
    int low = 0, high = p->mask->n_planes;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (p->sorted[middle].at_mm < at_mm)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The plane nearest to a place along the normal; NULL: none stands for it. */
static const Place *plane_at(const Placing *p, double at_mm)
{
    const int behind = plane_behind(p, at_mm);
    const Place *const b = behind < p->mask->n_planes ? &p->sorted[behind] : NULL;
    const Place *const a = behind > 0 ? &p->sorted[behind - 1] : NULL;
    const Place *const nearest = !a || (b && b->at_mm - at_mm <= at_mm - a->at_mm) ? b : a;
    return fabs(nearest->at_mm - at_mm) <= p->reach_mm ? nearest : NULL;
}

/* nearest_mm: where the plane lies that stands for each slice, NAN without one. */
static CtsStatus place_plane(const Placing *p, int plane, const double *nearest_mm, CtsError *err)
{
    const uint16_t *values;
    const CtsMask *const m = p->mask;
    CtsStatus st = m->plane(m->context, plane, &values, err);
    for (int j = 0; !st && j < m->rows; j++) {
        const uint16_t *row = values + (size_t)j * (size_t)m->columns;
        for (int i = 0, end; next_run(row, m->columns, &i, &end); i = end)
            p->n_mask[row[i]] += (uint64_t)(end - i);
    }
    for (int k = 0; !st && k < p->grid->n_slices; k++) {
        /* Several planes may lie in one place. */
        if (!(fabs(nearest_mm[k] - p->at_mm[plane]) < p->same_mm))
            continue;
        const Affine a = affine_of(p, k, plane);
        st = a.whole ? place_whole(p, k, &a, values, err) : place_nearest(p, k, &a, values, err);
    }
    return st;
}

static CtsStatus place_parallel(const Placing *p, CtsError *err)
{
    double *nearest_mm = NULL;
    CtsStatus st = cts_alloc_array(&nearest_mm, (size_t)p->grid->n_slices, err);
    for (int k = 0; !st && k < p->grid->n_slices; k++) {
        const Place *const nearest = plane_at(p, cts_dot3(p->grid->position_lps[k], p->normal_lps));
        nearest_mm[k] = nearest ? nearest->at_mm : NAN;
    }
    for (int q = 0; !st && q < p->mask->n_planes; q++)
        st = place_plane(p, q, nearest_mm, err);
    cts_free(&nearest_mm);
    return st;
}

/* A row of a slice that cuts through planes. */
static CtsStatus place_row(const Placing *p, int slice, int row, const uint16_t *all, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsMask *const m = p->mask;
    const size_t n_pixels = (size_t)m->columns * (size_t)m->rows;
    int value = 0, first = 0;
    for (int i = 0; i <= p->grid->columns && !st; i++) {
        double at[3], offset[3];
        for (int c = 0; c < 3; c++)
            at[c] = p->grid->position_lps[slice][c] + i * p->grid->step_lps[0][c] + row * p->grid->step_lps[1][c];
        const Place *const nearest = i < p->grid->columns ? plane_at(p, cts_dot3(at, p->normal_lps)) : NULL;
        int here = 0;
        if (nearest) {
            const int plane = nearest->plane;
            for (int c = 0; c < 3; c++)
                offset[c] = at[c] - m->position_lps[plane][c];
            const double x = floor(cts_dot3(p->inverse[0], offset) + 0.5);
            const double y = floor(cts_dot3(p->inverse[1], offset) + 0.5);
            if (x >= 0 && y >= 0 && x < m->columns && y < m->rows)
                here = all[(size_t)plane * n_pixels + (size_t)y * (size_t)m->columns + (size_t)x];
        }
        if (here == value)
            continue;
        if (value)
            st = add(p, slice, row, value, first, i, err);
        value = here;
        first = i;
    }
    return st;
}

static CtsStatus place_oblique(const Placing *p, CtsError *err)
{
    const CtsMask *const m = p->mask;
    const size_t n_pixels = (size_t)m->columns * (size_t)m->rows;
    uint16_t *all = NULL;
    size_t n;
    if (cts_mul_overflows(n_pixels, (size_t)m->n_planes, &n) ||
        !cts_memory_allows((double)n * sizeof *all, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "its %d planes, which are not the scan's, need more memory than is free",
                        m->n_planes);
    CtsStatus st = cts_alloc_array(&all, n, err);
    for (int q = 0; !st && q < m->n_planes; q++) {
        const uint16_t *values;
        if ((st = m->plane(m->context, q, &values, err)))
            break;
        memcpy(all + (size_t)q * n_pixels, values, n_pixels * sizeof *all);
        for (size_t i = 0; i < n_pixels; i++)
            p->n_mask[values[i]]++;
    }
    for (int k = 0; !st && k < p->grid->n_slices; k++)
        for (int j = 0; !st && j < p->grid->rows; j++)
            st = place_row(p, k, j, all, err);
    cts_free(&all);
    return st;
}

static int by_place(const void *a, const void *b)
{
    const Place *x = a, *y = b;
    return x->at_mm != y->at_mm ? (x->at_mm < y->at_mm ? -1 : 1) : x->plane - y->plane;
}

/* Half the gap between planes. Where the file does not tell it and every plane is a slice, no slice without a plane
 * takes its neighbour's: empty planes are left out. */
static void find_reach(Placing *p)
{
    double gap = INFINITY, scanned_gap = INFINITY, farthest = 0;
    const int n = p->mask->n_planes;
    for (int k = 1; k < p->grid->n_slices; k++)
        scanned_gap = fmin(scanned_gap, p->grid->at_mm[k] - p->grid->at_mm[k - 1]);
    p->same_mm = 0.01 * scanned_gap;
    qsort(p->sorted, (size_t)n, sizeof *p->sorted, by_place);
    for (int q = 1; q < n; q++)
        if (p->sorted[q].at_mm - p->sorted[q - 1].at_mm > p->same_mm)
            gap = fmin(gap, p->sorted[q].at_mm - p->sorted[q - 1].at_mm);
    for (int q = 0; q < n; q++) {
        double nearest = INFINITY;
        if (q > 0 && p->sorted[q].at_mm - p->sorted[q - 1].at_mm < p->same_mm)
            continue;
        for (int k = 0; k < p->grid->n_slices; k++)
            nearest = fmin(nearest, fabs(cts_dot3(p->grid->position_lps[k], p->normal_lps) - p->sorted[q].at_mm));
        farthest = fmax(farthest, nearest);
    }
    if (p->mask->gap_mm > 0)
        gap = fmin(gap, p->mask->gap_mm);
    else if (farthest < 0.05 * scanned_gap)
        gap = fmin(gap, scanned_gap);
    p->reach_mm = 0.5 * (gap < INFINITY ? gap : scanned_gap) * 1.001;
}

void cts_label_tell_share(const CtsLabelReading *reading, const CtsLabel *label, double inside, double whole)
{
    if (whole > 0 && inside < 0.5 * whole)
        cts_report_finding(reading->report, "label_outside", CTS_WARNING,
                           "label file %d: %.0f %% of label %d lie inside the volume", reading->file,
                           100 * inside / whole, label->fact.number);
}

/* The volume that each label has in the mask, and what of it has come into the scan. */
static CtsStatus judge(const Placing *p, double *held_mm3, CtsError *err)
{
    const CtsMask *const m = p->mask;
    CtsLabels *const labels = p->reading->labels;
    double area[3], *whole = NULL;
    const CtsStatus st = cts_alloc_zeroed(&whole, labels->n, err);
    if (st)
        return st;
    cts_cross3(m->step_lps[0], m->step_lps[1], area);
    for (int value = 1; value < CTS_MASK_VALUES; value++)
        if (m->label_of[value] >= 0)
            whole[m->label_of[value]] += (double)p->n_mask[value] * cts_norm3(area) * 2 * p->reach_mm / 1.001;
    cts_cross3(p->grid->step_lps[0], p->grid->step_lps[1], area);
    /* A file that does not meet the volume at all is refused in one line. */
    bool met = false;
    for (size_t i = 0; i < labels->n; i++)
        met |= whole[i] > 0 && labels->items[i].n_runs > 0;
    for (size_t i = 0; i < labels->n; i++) {
        CtsLabel *const l = &labels->items[i];
        double inside = 0;
        for (size_t r = 0; whole[i] > 0 && r < l->n_runs; r++)
            inside += (l->runs[r].end - l->runs[r].first) * cts_norm3(area) *
                      p->grid->thickness_mm[l->runs[r].row / (uint32_t)p->grid->rows];
        if (met)
            cts_label_tell_share(p->reading, l, inside, whole[i]);
        *held_mm3 += whole[i];
    }
    cts_free(&whole);
    return CTS_OK;
}

bool cts_mask_is_parallel(const double step_lps[2][3], const CtsLabelGrid *grid)
{
    double normal[3];
    cts_cross3(step_lps[0], step_lps[1], normal);
    return fabs(cts_dot3(normal, grid->normal_lps)) > 0.99999 * cts_norm3(normal);
}

CtsStatus cts_mask_place(const CtsMask *mask, const CtsLabelReading *reading, double *held_mm3, CtsError *err)
{
    Placing p = {.mask = mask, .reading = reading, .grid = &reading->labels->grid};
    CtsStatus st = find_axes(&p, err);
    if (!st)
        st = cts_alloc_array(&p.at_mm, (size_t)mask->n_planes, err);
    if (!st)
        st = cts_alloc_array(&p.sorted, (size_t)mask->n_planes, err);
    if (!st)
        st = cts_alloc_zeroed(&p.n_mask, CTS_MASK_VALUES, err);
    if (!st) {
        for (int q = 0; q < mask->n_planes; q++)
            p.sorted[q] = (Place){p.at_mm[q] = cts_dot3(mask->position_lps[q], p.normal_lps), q};
        find_reach(&p);
        st = cts_mask_is_parallel(mask->step_lps, p.grid) ? place_parallel(&p, err) : place_oblique(&p, err);
    }
    for (size_t i = 0; !st && i < reading->labels->n; i++)
        cts_label_sort_runs(&reading->labels->items[i]);
    if (!st)
        st = judge(&p, held_mm3, err);
    cts_free(&p.at_mm);
    cts_free(&p.sorted);
    cts_free(&p.n_mask);
    return st;
}

CtsStatus cts_label_check_meets(const CtsLabelReading *reading, double held, CtsError *err)
{
    bool meets = !(held > 0);
    for (size_t i = 0; i < reading->labels->n; i++)
        meets |= reading->labels->items[i].fact.file == reading->file && reading->labels->items[i].n_runs > 0;
    return meets ? CTS_OK
                 : cts_fail(err, CTS_ERR_GEOMETRY, "does not meet the volume: nothing that it labels lies inside");
}
