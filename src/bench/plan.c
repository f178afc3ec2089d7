/* Which settings are measured: each engine with each of its kernels, and what each can be tuned by. */
#include "bench/bench_parts.h"

#include <stdlib.h>

typedef struct Plan {
    CtsBenchRow *rows;
    int n, capacity;
} Plan;

static void add(Plan *p, CtsEngineId engine, CtsKernelId kernel, int samples, double tolerance_hu, bool void_key)
{
    if (p->n < p->capacity)
        p->rows[p->n++] = (CtsBenchRow){
            .engine = engine, .kernel = kernel, .samples = samples, .tolerance_hu = tolerance_hu, .void_key = void_key};
}

static void add_paper(Plan *p, CtsEngineId engine, bool reuses_layers, bool skips_void)
{
    for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++)
        add(p, engine, (CtsKernelId)kernel, 1, 0, false);
    for (int samples = 2; samples <= 4; samples *= 2)
        add(p, engine, CTS_KERNEL_TENT, samples, 0, false);
    for (double tolerance_hu = 5; tolerance_hu <= 20 && reuses_layers; tolerance_hu *= 4)
        add(p, engine, CTS_KERNEL_TENT, 1, tolerance_hu, false);
    if (skips_void)
        add(p, engine, CTS_KERNEL_TENT, 1, 0, true);
}

CtsStatus cts_bench_plan(CtsBenchRow **rows, int *n, CtsError *err)
{
    Plan p = {.capacity = 64};
    if (!(p.rows = calloc((size_t)p.capacity, sizeof *p.rows)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    add(&p, CTS_ENGINE_TILED, CTS_KERNEL_TENT, 0, 0, false);
    for (int samples = 1; samples <= 8; samples *= 2)
        add(&p, CTS_ENGINE_TILED, CTS_KERNEL_TENT, samples, 0, false);
    add_paper(&p, CTS_ENGINE_COMBINED, true, true);
    add_paper(&p, CTS_ENGINE_VOID, false, true);
    add_paper(&p, CTS_ENGINE_LAYERS, true, false);
    add_paper(&p, CTS_ENGINE_CLASSIC, false, false);
    add(&p, CTS_ENGINE_RAYCAST, CTS_KERNEL_TENT, 1, 0, false);
    *rows = p.rows;
    *n = p.n;
    return CTS_OK;
}
