/* Number of 26-connected parts of a label: runs are joined in a union-find forest (Hoshen, Kopelman 1976), without
 * visiting voxels. */
#include "base/mem.h"
#include "core/labels/label_set.h"

static uint32_t root_of(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

/* Joins run i with the adjacent runs of an earlier row; *at: position of the search, which only increases. */
static uint64_t join_run(const CtsLabel *l, uint32_t *parent, uint32_t i, uint32_t row, size_t *at)
{
    const CtsLabelRun *const r = &l->runs[i];
    uint64_t n_joined = 0;
    while (l->runs[*at].row < row || (l->runs[*at].row == row && l->runs[*at].end < r->first))
        ++*at;
    for (size_t q = *at; q < i && l->runs[q].row == row && l->runs[q].first <= r->end; q++) {
        const uint32_t a = root_of(parent, (uint32_t)q), b = root_of(parent, i);
        parent[a > b ? a : b] = a > b ? b : a;
        n_joined += a != b;
    }
    return n_joined;
}

uint64_t cts_label_components(const CtsLabel *l, int rows, CtsStatus *status, CtsError *err)
{
    uint32_t *parent = NULL;
    size_t at[4] = {0};
    uint64_t n = l->n_runs;
    *status = CTS_OK;
    if (n == 0)
        return 0;
    *status = n > UINT32_MAX ? cts_fail(err, CTS_ERR_MEMORY, "a label of too many pieces")
                             : cts_alloc_array(&parent, l->n_runs, err);
    for (uint32_t i = 0; !*status && i < l->n_runs; i++) {
        const uint32_t row = l->runs[i].row, in_slice = row % (uint32_t)rows, above = row - (uint32_t)rows;
        const bool has_above = row >= (uint32_t)rows;
        parent[i] = i;
        if (in_slice > 0)
            n -= join_run(l, parent, i, row - 1, &at[0]);
        if (has_above && in_slice > 0)
            n -= join_run(l, parent, i, above - 1, &at[1]);
        if (has_above)
            n -= join_run(l, parent, i, above, &at[2]);
        if (has_above && in_slice + 1 < (uint32_t)rows)
            n -= join_run(l, parent, i, above + 1, &at[3]);
    }
    cts_free(&parent);
    return n;
}
