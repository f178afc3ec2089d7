#include "input/labels/label_reading.h"

#include "base/mem.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Distance up to which a pixel at a voxel's centre is that voxel; offsets of resampled masks are far smaller. */
#define NEAR_PIXELS 0.02
/* Distance to a pixel's centre up to which a point counts as it: rounding of positions in mm with three decimals. */
#define SNAP_PIXELS 1e-3

/* Scanned column i, row j of a slice lies at pixel (at[0] + i * by[0][0] + j * by[1][0], at[1] + ...) of a plane. */
typedef struct Affine {
    double at[2], by[2][2];
} Affine;

typedef struct PlanePlace {
    double at_mm;
    int plane;
} PlanePlace;

typedef struct MaskPlacing {
    const CtsMask *mask;
    const CtsLabelReading *reading;
    const CtsLabelGrid *grid;
    double normal_lps[3], inverse[2][3]; /* of the mask; pixel = inverse * (point - position) */
    PlanePlace *sorted;                  /* the planes by rising place */
    double same_mm;                      /* planes no further apart lie in one place */
    double reach_mm;                     /* distance up to which a plane covers the space before and behind it */
    uint64_t *n_mask;                    /* by value: pixels in the mask */
} MaskPlacing;

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

/* Position of a plane or a slice along the mask's normal. */
static double along_mm(const MaskPlacing *p, const double position_lps[3])
{
    return cts_dot3(position_lps, p->normal_lps);
}

static double gap_of(const MaskPlacing *p)
{
    return 2 * p->reach_mm / 1.001;
}

static Affine affine_of(const MaskPlacing *p, int slice, int plane)
{
    Affine a;
    double offset[3];
    cts_sub3(p->grid->position_lps[slice], p->mask->position_lps[plane], offset);
    for (int r = 0; r < 2; r++) {
        a.at[r] = cts_dot3(p->inverse[r], offset);
        for (int axis = 0; axis < 2; axis++)
            a.by[axis][r] = cts_dot3(p->inverse[r], p->grid->step_lps[axis]);
    }
    return a;
}

/* Rounds *a to whole numbers of pixels, in the same or in the opposite order; false where that displaces a corner by
 * NEAR_PIXELS or more. */
static bool make_whole(const MaskPlacing *p, Affine *a)
{
    const Affine r = {{rint(a->at[0]), rint(a->at[1])}, {{rint(a->by[0][0]), 0}, {0, rint(a->by[1][1])}}};
    bool whole = fabs(r.by[0][0]) == 1 && fabs(r.by[1][1]) == 1;
    for (int corner = 0; corner < 4; corner++) {
        const double i = corner & 1 ? p->grid->columns - 1 : 0, j = corner & 2 ? p->grid->rows - 1 : 0;
        for (int c = 0; c < 2; c++)
            whole &= fabs(a->at[c] - r.at[c] + i * (a->by[0][c] - r.by[0][c]) + j * (a->by[1][c] - r.by[1][c])) <
                     NEAR_PIXELS;
    }
    *a = r;
    return whole;
}

static CtsStatus add_mask_run(const MaskPlacing *p, int slice, int row, int value, int first, int end, CtsError *err)
{
    const int32_t label = p->mask->label_of[value];
    first = first < 0 ? 0 : first;
    end = end > p->grid->columns ? p->grid->columns : end;
    if (label < 0 || first >= end)
        return CTS_OK;
    return cts_label_add_run(&p->reading->labels->items[label],
                             (uint32_t)slice * (uint32_t)p->grid->rows + (uint32_t)row, first, end, err);
}

/* A share that is neither nothing nor all. */
static CtsStatus add_mask_share(const MaskPlacing *p, int slice, int row, int column, int value, double share,
                                CtsError *err)
{
    const int32_t label = p->mask->label_of[value];
    const int of_whole = (int)lround(share * CTS_WHOLE_SHARE);
    if (label < 0 || of_whole <= 0 || of_whole >= CTS_WHOLE_SHARE)
        return CTS_OK;
    return cts_label_add_share(&p->reading->labels->items[label],
                               (uint32_t)slice * (uint32_t)p->grid->rows + (uint32_t)row, column, of_whole, err);
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

static CtsStatus place_shares(const MaskPlacing *p, int slice, const Affine *a, const CtsMaskPlane *plane,
                              CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int j = 0; j < p->grid->rows && !st; j++)
        for (int i = 0; i < p->grid->columns && !st; i++) {
            const double x = a->at[0] + i * a->by[0][0], y = a->at[1] + j * a->by[1][1];
            if (x >= 0 && y >= 0 && x < p->mask->columns && y < p->mask->rows)
                st = add_mask_share(
                    p, slice, j, i, plane->shared_value,
                    (double)plane->shares[(size_t)y * (size_t)p->mask->columns + (size_t)x] / CTS_WHOLE_SHARE, err);
        }
    return st;
}

/* A plane whose pixels are the slice's own, in the same or in the opposite order. */
static CtsStatus place_whole(const MaskPlacing *p, int slice, const Affine *a, const CtsMaskPlane *plane, CtsError *err)
{
    CtsStatus st = plane->shares ? place_shares(p, slice, a, plane, err) : CTS_OK;
    const int right = (int)a->by[0][0], down = (int)a->by[1][1], n = p->mask->columns;
    for (int j = 0; j < p->grid->rows && !st; j++) {
        const double from = a->at[1] + j * down;
        if (from < 0 || from >= p->mask->rows)
            continue;
        const uint16_t *row = plane->values + (size_t)from * (size_t)n;
        for (int i = 0, end; !st && next_run(row, n, &i, &end); i = end) {
            const double low = right > 0 ? i - a->at[0] : a->at[0] - end + 1, high = low + (end - i);
            if (high > 0 && low < p->grid->columns)
                st = add_mask_run(p, slice, j, row[i], (int)low, (int)high, err);
        }
    }
    return st;
}

/* The first of the sorted planes at or behind a place along the normal. */
static int plane_behind(const MaskPlacing *p, double at_mm)
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

/* The planes before and behind a position along the normal, -1 for none, and their weights: linear from plane to plane,
 * and falling to 0 where the next plane is missing: planes more than 1.5 gaps apart, nearer to two than to one. Returns
 * the nearest; -1: no plane covers the position. */
static int planes_about(const MaskPlacing *p, double at_mm, int plane[2], double weight[2])
{
    const int behind = plane_behind(p, at_mm);
    const double gap = gap_of(p);
    double away[2] = {INFINITY, INFINITY};
    for (int s = 0; s < 2; s++) {
        const int n = behind - 1 + s;
        plane[s] = n >= 0 && n < p->mask->n_planes ? p->sorted[n].plane : -1;
        if (plane[s] >= 0)
            away[s] = fabs(p->sorted[n].at_mm - at_mm);
    }
    for (int s = 0; s < 2; s++)
        weight[s] = away[s] <= p->same_mm            ? 1
                    : away[!s] <= p->same_mm         ? 0
                    : away[0] + away[1] <= 1.5 * gap ? away[!s] / (away[0] + away[1])
                                                     : fmax(0, 1 - away[s] / gap);
    const int nearest = away[1] <= away[0];
    return away[nearest] <= p->reach_mm ? plane[nearest] : -1;
}

static CtsStatus read_mask_plane(const MaskPlacing *p, int number, CtsMaskPlane *plane, CtsError *err)
{
    const CtsMask *const m = p->mask;
    *plane = (CtsMaskPlane){.values = NULL};
    const CtsStatus st = m->plane(m->context, number, plane, err);
    for (int j = 0; !st && j < m->rows; j++) {
        const uint16_t *row = plane->values + (size_t)j * (size_t)m->columns;
        for (int i = 0, end; next_run(row, m->columns, &i, &end); i = end)
            p->n_mask[row[i]] += (uint64_t)(end - i);
    }
    return st;
}

static CtsStatus place_on_grid(const MaskPlacing *p, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int q = 0; !st && q < p->mask->n_planes; q++) {
        CtsMaskPlane plane;
        const double at_mm = along_mm(p, p->mask->position_lps[q]);
        st = read_mask_plane(p, q, &plane, err);
        for (int k = 0; !st && k < p->grid->n_slices; k++) {
            Affine a;
            if (fabs(along_mm(p, p->grid->position_lps[k]) - at_mm) > p->same_mm)
                continue;
            a = affine_of(p, k, q);
            make_whole(p, &a);
            st = place_whole(p, k, &a, &plane, err);
        }
    }
    return st;
}

/* All planes, for a mask that is not on the grid: the field of each label is trilinear between its pixels. */
typedef struct LabelField {
    const MaskPlacing *placing;
    uint16_t *values, *shares; /* shares NULL: a value means a whole pixel */
    uint16_t shared_value;
    double (*origin)[2]; /* of each plane: inverse * position */
} LabelField;

/* Weights of values at a point. */
typedef struct Mix {
    int n, value[8];
    double share[8];
} Mix;

static void mix_pixel(const LabelField *f, size_t at, double weight, Mix *mix)
{
    const int value = f->shares ? f->shared_value : f->values[at];
    const double share = f->shares ? weight * f->shares[at] / CTS_WHOLE_SHARE : weight;
    int i = 0;
    if (!value || !(share > 0))
        return;
    while (i < mix->n && mix->value[i] != value)
        i++;
    if (i == mix->n) {
        mix->value[mix->n++] = value;
        mix->share[i] = 0;
    }
    mix->share[i] += share;
}

static double snapped(double x)
{
    return fabs(x - rint(x)) < SNAP_PIXELS ? rint(x) : x;
}

/* Adds a plane's contribution at its pixel (x, y). */
static void mix_plane(const LabelField *f, int plane, double weight, double x, double y, Mix *mix)
{
    const CtsMask *const m = f->placing->mask;
    const double left = floor(x), top = floor(y), right_of = x - left, below = y - top;
    for (int c = 0; c < 4; c++) {
        const double i = left + (c & 1), j = top + (c >> 1);
        const double part = (c & 1 ? right_of : 1 - right_of) * (c >> 1 ? below : 1 - below);
        if (part > 0 && i >= 0 && j >= 0 && i < m->columns && j < m->rows)
            mix_pixel(f, ((size_t)plane * (size_t)m->rows + (size_t)j) * (size_t)m->columns + (size_t)i, weight * part,
                      mix);
    }
}

/* The value of the pixel nearest to a point. 1e-9: ties are resolved in one direction, whatever the rounding. */
static int nearest_value(const LabelField *f, int plane, double u, double v)
{
    const CtsMask *const m = f->placing->mask;
    if (plane < 0)
        return 0;
    const double x = floor(u - f->origin[plane][0] + 0.5 + 1e-9), y = floor(v - f->origin[plane][1] + 0.5 + 1e-9);
    if (!(x >= 0 && y >= 0 && x < m->columns && y < m->rows))
        return 0;
    return f->values[((size_t)plane * (size_t)m->rows + (size_t)y) * (size_t)m->columns + (size_t)x];
}

static CtsStatus resample_row(const LabelField *f, int slice, int row, CtsError *err)
{
    const MaskPlacing *const p = f->placing;
    const CtsLabelGrid *const g = p->grid;
    double first_lps[3];
    CtsStatus st = CTS_OK;
    for (int c = 0; c < 3; c++)
        first_lps[c] = g->position_lps[slice][c] + row * g->step_lps[1][c];
    int value = 0, first = 0;
    for (int i = 0; i <= g->columns && !st; i++) {
        double at[3], weight[2];
        int plane[2], here = 0;
        Mix mix = {0};
        for (int c = 0; c < 3; c++)
            at[c] = first_lps[c] + i * g->step_lps[0][c];
        if (i < g->columns) {
            const double at_mm = cts_dot3(at, p->normal_lps);
            const double u = cts_dot3(p->inverse[0], at), v = cts_dot3(p->inverse[1], at);
            const int nearest = planes_about(p, at_mm, plane, weight);
            for (int s = 0; s < 2; s++)
                if (plane[s] >= 0 && weight[s] > 0)
                    mix_plane(f, plane[s], weight[s], snapped(u - f->origin[plane[s]][0]),
                              snapped(v - f->origin[plane[s]][1]), &mix);
            here = nearest_value(f, nearest, u, v);
        }
        for (int n = 0; n < mix.n && !st; n++)
            st = add_mask_share(p, slice, row, i, mix.value[n], mix.share[n], err);
        if (here == value || st)
            continue;
        if (value)
            st = add_mask_run(p, slice, row, value, first, i, err);
        value = here;
        first = i;
    }
    return st;
}

static CtsStatus load_planes(const MaskPlacing *p, LabelField *f, CtsError *err)
{
    const CtsMask *const m = p->mask;
    const size_t n_pixels = (size_t)m->columns * (size_t)m->rows;
    size_t n;
    CtsStatus st;
    if (cts_mul_overflows(n_pixels, (size_t)m->n_planes, &n) ||
        !cts_memory_allows((double)n * 2 * sizeof *f->values, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "its %d planes, which are not the scan's, need more memory than is free",
                        m->n_planes);
    if ((st = cts_alloc_array(&f->values, n, err)) || (st = cts_alloc_array(&f->origin, (size_t)m->n_planes, err)))
        return st;
    for (int q = 0; !st && q < m->n_planes; q++) {
        CtsMaskPlane plane;
        if ((st = read_mask_plane(p, q, &plane, err)) ||
            (plane.shares && !f->shares && (st = cts_alloc_array(&f->shares, n, err))))
            break;
        memcpy(f->values + (size_t)q * n_pixels, plane.values, n_pixels * sizeof *f->values);
        if (plane.shares)
            memcpy(f->shares + (size_t)q * n_pixels, plane.shares, n_pixels * sizeof *f->shares);
        f->shared_value = plane.shared_value;
        for (int r = 0; r < 2; r++)
            f->origin[q][r] = cts_dot3(p->inverse[r], m->position_lps[q]);
    }
    return st;
}

static CtsStatus resample_mask(const MaskPlacing *p, CtsError *err)
{
    LabelField f = {.placing = p};
    CtsStatus st = load_planes(p, &f, err);
    for (int k = 0; !st && k < p->grid->n_slices; k++)
        for (int j = 0; !st && j < p->grid->rows; j++)
            st = resample_row(&f, k, j, err);
    cts_free(&f.values);
    cts_free(&f.shares);
    cts_free(&f.origin);
    return st;
}

static int by_place(const void *a, const void *b)
{
    const PlanePlace *x = a, *y = b;
    return x->at_mm != y->at_mm ? (x->at_mm < y->at_mm ? -1 : 1) : x->plane - y->plane;
}

/* Half the gap between planes, and a thousandth more, so that a point halfway between planes is covered in spite of
 * rounding. Planes within 1 % of the slices' gap are one; where all are within 5 % of slices, every plane is a slice.
 * Where the file does not give the gap and every plane is a slice, slices without a plane get nothing from their
 * neighbours: empty planes are omitted from such files. */
static void find_plane_reach(MaskPlacing *p)
{
    double gap = INFINITY, scanned_gap = INFINITY, farthest = 0;
    const int n = p->mask->n_planes;
    for (int k = 1; k < p->grid->n_slices; k++)
        scanned_gap = fmin(scanned_gap, cts_label_slice_at_mm(p->grid, k) - cts_label_slice_at_mm(p->grid, k - 1));
    p->same_mm = 0.01 * scanned_gap;
    qsort(p->sorted, (size_t)n, sizeof *p->sorted, by_place);
    for (int q = 0; q < n; q++) {
        double nearest = INFINITY;
        const double away = q > 0 ? p->sorted[q].at_mm - p->sorted[q - 1].at_mm : INFINITY;
        if (away < p->same_mm)
            continue;
        gap = fmin(gap, away);
        for (int k = 0; k < p->grid->n_slices; k++)
            nearest = fmin(nearest, fabs(along_mm(p, p->grid->position_lps[k]) - p->sorted[q].at_mm));
        farthest = fmax(farthest, nearest);
    }
    if (p->mask->gap_mm > 0)
        gap = fmin(gap, p->mask->gap_mm);
    else if (farthest < 0.05 * scanned_gap)
        gap = fmin(gap, scanned_gap);
    p->reach_mm = 0.5 * (gap < INFINITY ? gap : scanned_gap) * 1.001;
}

/* Compares each label's volume in the mask with its volume in the scan. */
static CtsStatus check_volumes(const MaskPlacing *p, double *held_mm3, CtsError *err)
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
            whole[m->label_of[value]] += (double)p->n_mask[value] * cts_norm3(area) * gap_of(p);
    /* A file that does not meet the volume at all is refused in one line. */
    bool met = false;
    for (size_t i = 0; i < labels->n; i++)
        met |= whole[i] > 0 && labels->items[i].n_runs > 0;
    for (size_t i = 0; i < labels->n; i++) {
        const CtsLabel *const l = &labels->items[i];
        const double inside = whole[i] > 0 ? 1000 * cts_label_ml(l, p->grid) : 0;
        /* More than half of it lies outside. */
        if (met && whole[i] > 0 && inside < 0.5 * whole[i])
            cts_report_diagnostic(p->reading->report, CTS_DIAGNOSTIC_LABEL_OUTSIDE,
                                  "label file %d: %.0f %% of label %d lie inside the volume", p->reading->file,
                                  100 * inside / whole[i], l->fact.number);
        *held_mm3 += whole[i];
    }
    cts_free(&whole);
    return CTS_OK;
}

static CtsStatus begin_placing(MaskPlacing *p, CtsError *err)
{
    const CtsMask *const m = p->mask;
    CtsStatus st;
    if (!cts_mask_axes(m->step_lps, p->inverse))
        return cts_fail(err, CTS_ERR_GEOMETRY, "its rows and columns do not span a plane");
    cts_cross3(m->step_lps[0], m->step_lps[1], p->normal_lps);
    cts_unit3(p->normal_lps);
    if ((st = cts_alloc_array(&p->sorted, (size_t)m->n_planes, err)) ||
        (st = cts_alloc_zeroed(&p->n_mask, CTS_MASK_VALUES, err)))
        return st;
    for (int q = 0; q < m->n_planes; q++)
        p->sorted[q] = (PlanePlace){along_mm(p, m->position_lps[q]), q};
    find_plane_reach(p);
    return CTS_OK;
}

/* True if all planes lie in slices, pixel on voxel, or away from all. A mask leans where its ends lie a tenth of a gap
 * apart along the normal; a plane with a weight of 1 % or less is away. */
static bool is_on_grid(const MaskPlacing *p)
{
    const CtsLabelGrid *const g = p->grid;
    const double leaning_mm = fabs(cts_dot3(p->normal_lps, g->step_lps[0])) * g->columns +
                              fabs(cts_dot3(p->normal_lps, g->step_lps[1])) * g->rows;
    if (leaning_mm > 10 * p->same_mm)
        return false;
    for (int k = 0; k < g->n_slices; k++) {
        const double at_mm = along_mm(p, g->position_lps[k]);
        int plane[2], q = plane_behind(p, at_mm - p->same_mm);
        double weight[2];
        bool met = false;
        for (; q < p->mask->n_planes && p->sorted[q].at_mm <= at_mm + p->same_mm; q++) {
            Affine a = affine_of(p, k, p->sorted[q].plane);
            if (!make_whole(p, &a))
                return false;
            met = true;
        }
        planes_about(p, at_mm, plane, weight);
        if (!met && fmax(weight[0], weight[1]) > 0.01)
            return false;
    }
    return true;
}

CtsStatus cts_mask_place(const CtsMask *mask, const CtsLabelReading *reading, bool *only_on_grid, double *held_mm3,
                         CtsError *err)
{
    MaskPlacing p = {.mask = mask, .reading = reading, .grid = &reading->labels->grid};
    CtsStatus st = begin_placing(&p, err);
    const bool on_grid = !st && is_on_grid(&p);
    if (only_on_grid)
        *only_on_grid = on_grid;
    if (!st && (on_grid || !only_on_grid) && !(st = on_grid ? place_on_grid(&p, err) : resample_mask(&p, err))) {
        for (size_t i = 0; i < reading->labels->n; i++)
            cts_label_sort_runs(&reading->labels->items[i]);
        st = check_volumes(&p, held_mm3, err);
    }
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
