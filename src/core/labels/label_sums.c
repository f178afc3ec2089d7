/* Sums over the HU of labels while slices are read: of stored numbers, as integers, so that neither threads nor the
 * order of slices change them. */
#include "core/labels/label_set.h"
#include "core/volume/stored.h"
#include <math.h>
#include <stdlib.h>

typedef struct SliceSums {
    int64_t n, n_air, sum, squares; /* of voxels that are no padding; a slice has fewer than 2^31 of them */
    double slope, intercept;
} SliceSums;

/* Of the slices that the label has runs in. */
typedef struct CtsLabelSums {
    int first, end;
    SliceSums slice[];
} CtsLabelSums;

void cts_label_sums_free(CtsLabel *l)
{
    free(l->sums);
    l->sums = NULL;
}

CtsStatus cts_labels_begin(CtsLabels *labels, CtsError *err)
{
    for (size_t i = 0; i < labels->n; i++) {
        CtsLabel *const l = &labels->items[i];
        cts_label_sums_free(l);
        if (!l->n_runs)
            continue;
        const uint32_t rows = (uint32_t)labels->grid.rows;
        const int first = (int)(l->runs[0].row / rows), end = (int)(l->runs[l->n_runs - 1].row / rows) + 1;
        l->sums = calloc(1, sizeof *l->sums + (size_t)(end - first) * sizeof *l->sums->slice);
        if (!l->sums)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        l->sums->first = first;
        l->sums->end = end;
    }
    return CTS_OK;
}

static void add_words(SliceSums *sums, const uint16_t *words, int n, const CtsStored *stored)
{
    const CtsStored s = *stored;
    for (int i = 0; i < n; i++) {
        const int32_t value = cts_stored_value(words[i], &s);
        if (cts_stored_is_padding(words[i], value, &s))
            continue;
        sums->n++;
        sums->n_air += sums->slope * value + sums->intercept < CTS_LABEL_AIR_HU;
        sums->sum += value;
        sums->squares += (int64_t)value * value;
    }
}

static void count_words(CtsLabel *l, int slice, int columns, int rows, const uint16_t *words, size_t first, size_t end,
                        const CtsStored *stored, double slope, double intercept)
{
    CtsLabelSums *const all = l->sums;
    if (!all || slice < all->first || slice >= all->end)
        return;
    SliceSums *const sums = &all->slice[slice - all->first];
    if (first == 0)
        *sums = (SliceSums){.slope = slope, .intercept = intercept};
    const uint32_t row_0 = (uint32_t)slice * (uint32_t)rows;
    for (size_t r = cts_label_find_row(l, row_0 + (uint32_t)(first / (size_t)columns)); r < l->n_runs; r++) {
        if (l->runs[r].row >= row_0 + (uint32_t)rows)
            return;
        const size_t row_at = (size_t)(l->runs[r].row - row_0) * (size_t)columns;
        const size_t from = row_at + l->runs[r].first, to = row_at + l->runs[r].end;
        if (from >= end)
            return;
        const size_t a = from < first ? first : from, b = to < end ? to : end;
        if (a < b)
            add_words(sums, words + (a - first), (int)(b - a), stored);
    }
}

void cts_labels_take_words(void *labels, int slice, const uint16_t *words, size_t first, size_t end,
                           const CtsStored *stored, double slope, double intercept)
{
    CtsLabels *const l = labels;
    for (size_t i = 0; i < l->n; i++)
        count_words(&l->items[i], slice, l->grid.columns, l->grid.rows, words, first, end, stored, slope, intercept);
}

/* Means and sums of squared deviations are combined slice by slice (Chan, Golub, LeVeque 1979), without cancellation of
 * large sums. */
void cts_label_take_sums(CtsLabel *l, const int *slice_number, int n_kept)
{
    long double n = 0, mean = 0, squares = 0;
    uint64_t n_air = 0;
    for (int k = 0; l->sums && k < n_kept; k++) {
        const int slice = slice_number[k];
        if (slice < l->sums->first || slice >= l->sums->end)
            continue;
        const SliceSums s = l->sums->slice[slice - l->sums->first];
        if (!s.n)
            continue;
        const long double value = (long double)s.sum / (long double)s.n, step = s.slope;
        const long double about = ((long double)s.squares - value * (long double)s.sum) * step * step;
        const long double here = step * value + s.intercept, apart = here - mean, whole = n + (long double)s.n;
        squares += about + apart * apart * n * (long double)s.n / whole;
        mean += apart * (long double)s.n / whole;
        n = whole;
        n_air += (uint64_t)s.n_air;
    }
    CtsLabelFact *const c = &l->fact;
    c->n_hu = (uint64_t)n;
    c->hu_mean = n > 0 ? (double)mean : NAN;
    c->hu_sd = n > 0 ? (double)sqrtl(squares > 0 ? squares / n : 0) : NAN;
    c->air_share = n > 0 ? (double)((long double)n_air / n) : 0;
    cts_label_sums_free(l);
}
