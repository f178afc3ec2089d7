#include "engine/splat/layers.h"

#include "base/mutation.h"
#include <stdlib.h>

enum { SAMPLE_EVERY = 16, SAMPLE_AT = 5 };

/* Changes in row v between two layers, where the volume has them. */
static uint64_t count_changes(const CtsPaperPlan *p, int k, int old_k, int v)
{
    const uint16_t *const here = cts_stack_row(&p->stack, k, v), *const old = cts_stack_row(&p->stack, old_k, v);
    uint64_t n = 0;
    for (int u = 0; u < p->stack.n[0]; u++)
        n += abs(here[u] - old[u]) > p->tolerance;
    return n;
}

CtsChangeSample cts_layers_sample(const CtsPaperPlan *p)
{
    const int first = SAMPLE_AT < p->stack.n_layers ? SAMPLE_AT : p->n_sheets;
    CtsChangeSample sample = {0};
    for (int s = first; s < p->stack.n_layers; s += SAMPLE_EVERY)
        for (int v = SAMPLE_AT; v < p->stack.n[1]; v += SAMPLE_EVERY) {
            sample.voxels += (uint64_t)p->stack.n[0];
            sample.changed += count_changes(p, cts_paper_layer(p, s), cts_paper_layer(p, s - p->n_sheets), v);
        }
    return sample;
}

bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void)
{
    /* Measured with all kernels at a quarter of a voxel to one per pixel, 8 to 16 bits: by itself reuse takes 0.3 to
     * 0.7 of the time where up to 0.3 of the voxels change, and breaks even at 0.7, or at 0.36 where a footprint is a
     * single row. With void skipping, which drops the unchanged voxels anyway, it takes 1 to 1.15 of the time. */
    const int vectors = (2 * footprint->reach[1] + 1) * ((2 * footprint->reach[0] + 8) / 8);
    return !skips_void && (double)sample.changed < (vectors > 1 ? 0.5 : 0.3) * (double)sample.voxels;
}

void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept)
{
    for (int i = 0; i < n; i++) {
        const int change = before ? fresh[i] - before[i] : 0;
        kept[i] =
            before && change <= tolerance - CTS_MUTATED(TOLERANCE_LESS) && change >= -tolerance ? before[i] : fresh[i];
    }
}
