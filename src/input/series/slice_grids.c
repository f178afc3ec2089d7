/* Slices of one size, orientation and pixel spacing. */
#include "input/series/series_check.h"

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

void cts_slice_set_take_jittering(const CtsSliceSet *set, const CtsSlice *one, CtsSeries *series, bool *keep,
                                  int *n_kept)
{
    int n = 0;
    for (int i = 0; i < set->n; i++) {
        keep[i] = same_pixels(set->items[i], one) && cts_dot3(set->items[i]->normal_lps, one->normal_lps) > 0.99;
        n += keep[i];
    }
    if (n == *n_kept || !cts_slice_set_settle(set, keep))
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
