#include "input/series/series_check.h"

#include "base/compare.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

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
    for (int c = 0; c < 3; c++)
        apart[c] = last[c] - first[c];
    return cts_norm3(apart) > fmax(MIN_DRIFT_PIXELS, DRIFT_DEVIATIONS * sqrt(variance));
}

bool cts_slice_set_settle(const CtsSliceSet *set, const bool *keep)
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
