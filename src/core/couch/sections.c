#include "core/couch/table_removal.h"

#include "base/parallel.h"
#include "base/vec3.h"
#include <math.h>
#include <string.h>

bool cts_section_plan(const CtsVolume *v, double thickness_mm, CtsSectionPlan *plan)
{
    double inverse[3][3], area[3], best = -1;
    int head = 2;
    if (!cts_volume_inverse(v, inverse))
        return false;
    for (int axis = 0; axis < 3; axis++) {
        const double along_z = fabs(v->step_lps[axis][2]) / cts_volume_spacing_mm(v, axis);
        if (along_z > best) {
            best = along_z;
            head = axis;
        }
    }
    *plan = (CtsSectionPlan){.axis = {head == 0, head == 2 ? 1 : 2, head}};
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

static void join_row(const CtsSectionPlan *plan, const CtsBits *dense, int j, int k, CtsBits *sections)
{
    const uint64_t *from = cts_bits_row(dense, j, k);
    if (plan->axis[2] == 0) {
        for (int i = 0; i < dense->dims[0]; i++)
            if (from[i >> 6] >> (i & 63) & 1)
                cts_bits_set(sections, j, k, i / plan->n_slices);
        return;
    }
    uint64_t *to = plan->axis[2] == 2 ? cts_bits_row(sections, j, k / plan->n_slices)
                                      : cts_bits_row(sections, k, j / plan->n_slices);
    for (size_t w = 0; w < dense->row_words; w++)
        to[w] |= from[w];
}

typedef struct Joining {
    const CtsSectionPlan *plan;
    const CtsBits *dense;
    CtsBits *sections;
} Joining;

static void join_slices(void *context, int worker, size_t first, size_t end)
{
    const Joining *const joining = context;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++)
        for (int j = 0; j < joining->dense->dims[1]; j++)
            join_row(joining->plan, joining->dense, j, k, joining->sections);
}

CtsStatus cts_sections_new(const CtsSectionPlan *plan, const CtsBits *dense, int n_threads, CtsBits *sections,
                           CtsError *err)
{
    const CtsStatus st = cts_bits_new(sections, plan->dims, err);
    Joining joining = {plan, dense, sections};
    /* Chunks of slices of different threads have no row in common. */
    if (!st)
        cts_parallel(n_threads, (size_t)dense->dims[2], plan->axis[2] == 2 ? (size_t)plan->n_slices : 1, join_slices,
                     &joining);
    return st;
}

void cts_sections_row(const CtsSectionPlan *plan, const CtsBits *sections, int nx, int j, int k, uint64_t *row)
{
    const size_t n_words = (size_t)nx / 64 + 1;
    if (plan->axis[2] == 2)
        memcpy(row, cts_bits_row(sections, j, k / plan->n_slices), n_words * sizeof *row);
    else if (plan->axis[2] == 1)
        memcpy(row, cts_bits_row(sections, k, j / plan->n_slices), n_words * sizeof *row);
    else {
        memset(row, 0, n_words * sizeof *row);
        for (int i = 0; i < nx; i++)
            row[i >> 6] |= (uint64_t)cts_bits_get(sections, j, k, i / plan->n_slices) << (i & 63);
    }
}
