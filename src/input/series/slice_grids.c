/* Slices of one size, orientation and pixel spacing. */
#include "input/series/series_check.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/vec3.h"
#include <stdlib.h>
#include <string.h>

/* 1e-4: the last of 512 pixels moves by a twentieth of a pixel. The same holds for pixel spacings. */
static bool same_direction(const double a[3], const double b[3])
{
    for (int c = 0; c < 3; c++)
        if (fabs(a[c] - b[c]) > 1e-4)
            return false;
    return true;
}

static bool same_pixels(const CtsSlice *a, const CtsSlice *b)
{
    return a->rows == b->rows && a->columns == b->columns &&
           fabs(a->row_spacing_mm - b->row_spacing_mm) <= 1e-4 * b->row_spacing_mm &&
           fabs(a->column_spacing_mm - b->column_spacing_mm) <= 1e-4 * b->column_spacing_mm;
}

bool cts_slice_same_grid(const CtsSlice *a, const CtsSlice *b)
{
    return same_pixels(a, b) && same_direction(a->row_lps, b->row_lps) && same_direction(a->column_lps, b->column_lps);
}

/* MAX_MOVED_PIXELS: a tenth of a pixel is less than the displacement of an edge by interpolation. A drift is detected
 * where two halves of the stack differ by more than MIN_DRIFT_PIXELS, a fifth of that and five times what directions
 * rounded to five decimals displace a corner of 512 x 512 pixels, and by more than DRIFT_DEVIATIONS standard deviations
 * of their means. */
#define MAX_MOVED_PIXELS 0.1
#define MIN_DRIFT_PIXELS 0.02
#define DRIFT_DEVIATIONS 3

typedef struct Axes {
    double row[3], column[3], normal[3];
} Axes;

/* Mean directions, at right angles. */
static Axes mean_axes(const CtsSliceSet *set, const bool *keep)
{
    Axes mean = {{0}, {0}, {0}};
    for (int i = 0; i < set->n; i++)
        for (int c = 0; keep[i] && c < 3; c++) {
            mean.row[c] += set->items[i]->row_lps[c];
            mean.column[c] += set->items[i]->column_lps[c];
        }
    cts_unit3(mean.row);
    const double along = cts_dot3(mean.row, mean.column);
    for (int c = 0; c < 3; c++)
        mean.column[c] -= along * mean.row[c];
    cts_unit3(mean.column);
    cts_cross3(mean.row, mean.column, mean.normal);
    return mean;
}

/* Displacement of a corner of the slice in pixels; 1: along the row, 2: along the column, 3: across. */
static void corner_off(const CtsSlice *s, const Axes *mean, int corner, double off[3])
{
    const double pixel_mm = fmin(s->row_spacing_mm, s->column_spacing_mm);
    for (int c = 0; c < 3; c++)
        off[c] = ((corner & 1 ? (s->columns - 1) * s->column_spacing_mm * (s->row_lps[c] - mean->row[c]) : 0) +
                  (corner & 2 ? (s->rows - 1) * s->row_spacing_mm * (s->column_lps[c] - mean->column[c]) : 0)) /
                 pixel_mm;
}

typedef struct Deviation {
    double at_mm, pixels[3]; /* along the normal, which they are sorted by; displacement of one corner */
} Deviation;

/* The mean of n deviations, and the variance of that mean by their scatter. */
static double mean_off(const Deviation *off, int n, double mean[3])
{
    double variance = 0;
    memset(mean, 0, 3 * sizeof *mean);
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            mean[c] += off[i].pixels[c] / n;
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            variance += (off[i].pixels[c] - mean[c]) * (off[i].pixels[c] - mean[c]);
    return variance / n / n;
}

static bool drifts(const Deviation *off, int n)
{
    double first[3], last[3], apart[3];
    const int half = n / 2;
    const double variance = mean_off(off, half, first) + mean_off(off + n - half, half, last);
    cts_sub3(last, first, apart);
    return cts_norm3(apart) > fmax(MIN_DRIFT_PIXELS, DRIFT_DEVIATIONS * sqrt(variance));
}

/* For slices whose orientations jitter about one direction, so that with their mean no voxel moves by more than a tenth
 * of a pixel, and whose direction does not drift along the stack: sets the mean and returns true. keep: the slices of
 * the set concerned. */
static bool settle_orientation(const CtsSliceSet *set, const bool *keep)
{
    const Axes mean = mean_axes(set, keep);
    Deviation *off = malloc(((size_t)set->n + 1) * sizeof *off);
    bool settled = off != NULL;
    for (int corner = 1; settled && corner <= 3; corner++) {
        int n = 0;
        for (int i = 0; settled && i < set->n; i++) {
            if (!keep[i])
                continue;
            const CtsSlice *s = set->items[i];
            off[n].at_mm = cts_dot3(mean.normal, s->position_lps);
            corner_off(s, &mean, corner, off[n].pixels);
            settled = cts_norm3(off[n++].pixels) <= MAX_MOVED_PIXELS;
        }
        if (!settled)
            break;
        qsort(off, (size_t)n, sizeof *off, cts_compare_double);
        settled = n >= 4 && !drifts(off, n);
    }
    free(off);
    for (int i = 0; settled && i < set->n; i++)
        if (keep[i]) {
            memcpy(set->items[i]->row_lps, mean.row, sizeof mean.row);
            memcpy(set->items[i]->column_lps, mean.column, sizeof mean.column);
            memcpy(set->items[i]->normal_lps, mean.normal, sizeof mean.normal);
        }
    return settled;
}

void cts_slice_set_take_jittering(const CtsSliceSet *set, const CtsSlice *one, CtsSeries *series, bool *keep,
                                  int *n_kept)
{
    int n = 0;
    for (int i = 0; i < set->n; i++) {
        keep[i] = same_pixels(set->items[i], one) && cts_dot3(set->items[i]->normal_lps, one->normal_lps) > 0.99;
        n += keep[i];
    }
    if (n == *n_kept || !settle_orientation(set, keep))
        return;
    *n_kept = n;
    cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_ORIENTATION_JITTER,
                        "ImageOrientationPatient (0020,0037) jitters from slice to slice; their mean moves no voxel by "
                        "more than a tenth of a pixel, and is used");
}

/* Moves the slices on the grid of the first one of a set, or jittering about it, to another. */
static CtsStatus move_grid(CtsSliceSet *set, CtsSeries *series, bool *keep, CtsSliceSet *grid, CtsError *err)
{
    const CtsSlice *const one = set->items[0];
    int n_same = 0, n_left = 0;
    for (int i = 0; i < set->n; i++)
        n_same += cts_slice_same_grid(set->items[i], one);
    cts_slice_set_take_jittering(set, one, series, keep, &n_same);
    if (!(grid->items = malloc((size_t)n_same * sizeof *grid->items)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < set->n; i++)
        if (cts_slice_same_grid(set->items[i], one))
            grid->items[grid->n++] = set->items[i];
        else
            set->items[n_left++] = set->items[i];
    set->n = n_left;
    return CTS_OK;
}

/* Gives the slices that are alone on their grids back to the set. */
static void give_back(CtsSliceSet *set, CtsSliceSet *grids, int *n_grids)
{
    int n_kept = 0;
    for (int g = 0; g < *n_grids; g++)
        if (grids[g].n > 1) {
            grids[n_kept++] = grids[g];
        } else {
            set->items[set->n++] = grids[g].items[0];
            free(grids[g].items);
        }
    *n_grids = n_kept;
}

CtsStatus cts_slice_set_grids(CtsSliceSet *set, CtsSeries *series, CtsSliceSet **grids, int *n_grids, CtsError *err)
{
    bool *keep = NULL;
    *grids = NULL;
    *n_grids = 0;
    CtsStatus st = cts_alloc_array(&keep, (size_t)set->n, err);
    while (!st && set->n && !(st = cts_grow(grids, (size_t)*n_grids, err))) {
        (*grids)[*n_grids] = (CtsSliceSet){0};
        st = move_grid(set, series, keep, &(*grids)[*n_grids], err);
        *n_grids += !st;
    }
    cts_free(&keep);
    if (st)
        return st;
    give_back(set, *grids, n_grids);
    if (*n_grids == 1 && !set->n) {
        free(set->items);
        *set = (*grids)[--*n_grids];
    } else if (*n_grids && set->n) {
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_OTHER_SLICES_DROPPED,
                            "%d image%s of another size, orientation or pixel spacing left out", set->n,
                            set->n == 1 ? "" : "s");
    }
    return st;
}
