#include "core/couch/table_removal.h"

#include "base/parallel.h"
#include "base/vec3.h"
#include "core/volume/box.h"
#include <math.h>
#include <string.h>

bool cts_section_plan(const CtsVolume *v, double thickness_mm, CtsSectionPlan *plan)
{
    double inverse[3][3], area[3];
    if (!cts_volume_inverse(v, inverse))
        return false;
    *plan = (CtsSectionPlan){0};
    cts_volume_section_axes(v, plan->axis);
    const int head = plan->axis[2];
    const double slice_mm = cts_volume_spacing_mm(v, head);
    plan->n_slices = (int)fmin(fmax(round(thickness_mm / slice_mm), 1), v->dims[head]);
    cts_cross3(v->step_lps[0], v->step_lps[1], area);
    plan->voxel_mm3 = fabs(cts_dot3(area, v->step_lps[2])) * plan->n_slices;
    for (int n = 0; n < 3; n++) {
        plan->dims[n] = v->dims[plan->axis[n]];
        plan->spacing_mm[n] = cts_volume_spacing_mm(v, plan->axis[n]);
    }
    plan->dims[2] = (plan->dims[2] + plan->n_slices - 1) / plan->n_slices;
    plan->spacing_mm[2] *= plan->n_slices;
    return true;
}

static void join_row(CtsTableSearch *r, int j, int k)
{
    const CtsSectionPlan *const plan = &r->plan;
    const uint64_t *from = cts_bits_row(&r->dense, j, k);
    if (plan->axis[2] == 0) {
        for (int i = 0; i < r->dense.dims[0]; i++)
            if (from[i >> 6] >> (i & 63) & 1)
                cts_bits_set(&r->sections, j, k, i / plan->n_slices);
        return;
    }
    uint64_t *to = plan->axis[2] == 2 ? cts_bits_row(&r->sections, j, k / plan->n_slices)
                                      : cts_bits_row(&r->sections, k, j / plan->n_slices);
    for (size_t w = 0; w < r->dense.row_words; w++)
        to[w] |= from[w];
}

static void join_slices(void *context, int worker, size_t first, size_t end)
{
    CtsTableSearch *const r = context;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++)
        for (int j = 0; j < r->dense.dims[1]; j++)
            join_row(r, j, k);
}

CtsStatus cts_sections_new(CtsTableSearch *r, CtsError *err)
{
    const CtsStatus st = cts_bits_new(&r->sections, r->plan.dims, err);
    /* Chunks of slices of different threads have no row in common. */
    if (!st)
        cts_parallel(r->n_threads, (size_t)r->dense.dims[2], r->plan.axis[2] == 2 ? (size_t)r->plan.n_slices : 1,
                     join_slices, r);
    return st;
}

const uint64_t *cts_gone_row(const CtsTableSearch *r, int j, int k, uint64_t *row)
{
    const int nx = r->dims[0], n_slices = r->plan.n_slices;
    if (r->plan.axis[2] != 0)
        return r->plan.axis[2] == 2 ? cts_bits_row(&r->gone, j, k / n_slices) : cts_bits_row(&r->gone, k, j / n_slices);
    memset(row, 0, ((size_t)nx / 64 + 1) * sizeof *row);
    for (int i = 0; i < nx; i++)
        row[i >> 6] |= (uint64_t)cts_bits_get(&r->gone, j, k, i / n_slices) << (i & 63);
    return row;
}
