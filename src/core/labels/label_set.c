#include "core/labels/label_set.h"

#include "base/mem.h"
#include "base/text.h"
#include <stdlib.h>
#include <string.h>

CtsStatus cts_labels_new(CtsLabels **labels, CtsLabelGrid *grid, CtsError *err)
{
    CtsStatus st = CTS_OK;
    *labels = NULL;
    if (grid->columns > UINT16_MAX || (uint64_t)grid->rows * (uint64_t)grid->n_slices > UINT32_MAX)
        st = cts_fail(err, CTS_ERR_MEMORY, "%d x %d voxels in %d slices are too many for labels", grid->columns,
                      grid->rows, grid->n_slices);
    if (!st)
        st = cts_alloc_zeroed(labels, 1, err);
    if (st)
        cts_free(&grid->position_lps);
    else
        (*labels)->grid = *grid;
    *grid = (CtsLabelGrid){0};
    return st;
}

void cts_label_regions_free(CtsLabelRegion *regions, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        free(regions[i].name);
        cts_free(&regions[i].numbers);
    }
    free(regions);
}

void cts_labels_free(CtsLabels **labels)
{
    if (!*labels)
        return;
    for (size_t i = 0; i < (*labels)->n; i++) {
        CtsLabel *const l = &(*labels)->items[i];
        cts_label_sums_free(l);
        free(l->fact.name);
        free(l->runs);
        free(l->shares);
    }
    free((*labels)->items);
    free((*labels)->objects);
    cts_label_regions_free((*labels)->regions, (*labels)->n_regions);
    for (size_t i = 0; i < (*labels)->n_left_out; i++) {
        free((*labels)->left_out[i].fact.name);
        free((*labels)->left_out[i].reason);
    }
    free((*labels)->left_out);
    cts_free(&(*labels)->grid.position_lps);
    cts_free(labels);
}

CtsStatus cts_labels_add(CtsLabels *labels, int file, int number, const char *name, CtsLabelSource source,
                         CtsError *err)
{
    if (labels->n >= CTS_MAX_LABELS)
        return cts_fail(err, CTS_ERR_READ, "more than %d labels", CTS_MAX_LABELS);
    CtsStatus st = cts_grow(&labels->items, labels->n, err);
    char *copy = st ? NULL : strdup(name);
    if (st || !copy)
        return st ? st : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    cts_text_clean(copy);
    labels->items[labels->n++] = (CtsLabel){.fact = {.file = file, .number = number, .name = copy, .source = source}};
    return CTS_OK;
}

CtsStatus cts_labels_add_region(CtsLabels *labels, int file, const char *name, const int *numbers, size_t n,
                                CtsError *err)
{
    const CtsStatus st = cts_grow(&labels->regions, labels->n_regions, err);
    if (st)
        return st;
    CtsLabelRegion region = {.file = file, .name = strdup(name), .n = n};
    if (!region.name || cts_alloc_array(&region.numbers, n ? n : 1, NULL)) {
        free(region.name);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    if (n)
        memcpy(region.numbers, numbers, n * sizeof *numbers);
    cts_text_clean(region.name);
    labels->regions[labels->n_regions++] = region;
    return CTS_OK;
}

CtsStatus cts_labels_leave_out(CtsLabels *labels, int file, int number, const char *name, const char *reason,
                               CtsError *err)
{
    const CtsStatus st = cts_grow(&labels->left_out, labels->n_left_out, err);
    if (st)
        return st;
    CtsLabelLeftOut one = {.fact = {.file = file, .number = number, .name = strdup(name)}, .reason = strdup(reason)};
    if (!one.fact.name || !one.reason) {
        free(one.fact.name);
        free(one.reason);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    cts_text_clean(one.fact.name);
    labels->left_out[labels->n_left_out++] = one;
    return CTS_OK;
}

CtsStatus cts_label_add_run(CtsLabel *l, uint32_t row, int first, int end, CtsError *err)
{
    CtsLabelRun *const last = l->n_runs ? &l->runs[l->n_runs - 1] : NULL;
    if (last && last->row == row && last->end == first) {
        last->end = (uint16_t)end;
        return CTS_OK;
    }
    const CtsStatus st = cts_grow(&l->runs, l->n_runs, err);
    if (!st)
        l->runs[l->n_runs++] = (CtsLabelRun){row, (uint16_t)first, (uint16_t)end};
    return st;
}

CtsStatus cts_label_add_share(CtsLabel *l, uint32_t row, int column, int share, CtsError *err)
{
    const CtsStatus st = cts_grow(&l->shares, l->n_shares, err);
    if (!st)
        l->shares[l->n_shares++] = (CtsLabelShare){row, (uint16_t)column, (uint16_t)share};
    return st;
}

static int by_column(const void *a, const void *b)
{
    const CtsLabelShare *x = a, *y = b;
    return x->row != y->row ? (x->row < y->row ? -1 : 1) : x->column < y->column ? -1 : x->column > y->column;
}

static int by_place(const void *a, const void *b)
{
    const CtsLabelRun *x = a, *y = b;
    return x->row != y->row ? (x->row < y->row ? -1 : 1) : x->first < y->first ? -1 : x->first > y->first;
}

/* The first of n items, sorted by row, at or behind this row. */
static size_t find_row(const void *items, size_t size, size_t n, uint32_t row)
{
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (*(const uint32_t *)((const char *)items + middle * size) < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

size_t cts_label_find_row(const CtsLabel *l, uint32_t row)
{
    return find_row(l->runs, sizeof *l->runs, l->n_runs, row);
}

size_t cts_label_find_share(const CtsLabel *l, uint32_t row)
{
    return find_row(l->shares, sizeof *l->shares, l->n_shares, row);
}

/* Already sorted ones cost one pass. */
static void sort_items(void *items, size_t size, size_t n, int (*order)(const void *, const void *))
{
    for (size_t i = 1; i < n; i++)
        if (order((char *)items + (i - 1) * size, (char *)items + i * size) > 0) {
            qsort(items, n, size, order);
            return;
        }
}

void cts_label_sort_runs(CtsLabel *l)
{
    size_t n = 0;
    sort_items(l->runs, sizeof *l->runs, l->n_runs, by_place);
    sort_items(l->shares, sizeof *l->shares, l->n_shares, by_column);
    for (size_t i = 0; i < l->n_runs; i++) {
        const CtsLabelRun r = l->runs[i];
        if (n && l->runs[n - 1].row == r.row && r.first <= l->runs[n - 1].end)
            l->runs[n - 1].end = r.end > l->runs[n - 1].end ? r.end : l->runs[n - 1].end;
        else
            l->runs[n++] = r;
    }
    l->n_runs = n;
}
