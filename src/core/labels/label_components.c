#include "base/mem.h"
#include "core/labels/label_set.h"
#include "core/volume/components.h"

uint64_t cts_label_components(const CtsLabel *l, const CtsLabelGrid *g, CtsStatus *status, CtsError *err)
{
    CtsComponents p = {.dims = {g->columns, g->rows, g->n_slices}, .n_runs = (uint32_t)l->n_runs};
    const size_t n_rows = (size_t)g->rows * (size_t)g->n_slices;
    if (l->n_runs > UINT32_MAX)
        *status = cts_fail(err, CTS_ERR_MEMORY, "a label of too many pieces");
    else if (!(*status = cts_alloc_array(&p.runs, l->n_runs, err)) &&
             !(*status = cts_alloc_array(&p.row_start, n_rows + 1, err))) {
        uint32_t n = 0;
        for (size_t row = 0; row <= n_rows; row++) {
            p.row_start[row] = n;
            for (; n < p.n_runs && l->runs[n].row == row; n++)
                p.runs[n] = (CtsRun){l->runs[n].first, l->runs[n].end, n};
        }
        *status = cts_components_join(&p, CTS_CONNECTED_BY_CORNERS, err);
    }
    const uint64_t n_parts = p.n_parts;
    cts_components_free(&p);
    return n_parts;
}
