/* The settings to be measured: each engine with each of its kernels and tuning parameters. */
#include "lab/bench/bench.h"

#include <assert.h>
#include <stdlib.h>

enum { MAX_TUNED = 12 }; /* settings of an engine beside its kernels */

typedef struct Plan {
    CtsBenchRow *rows;
    int n, capacity;
} Plan;

static void add_setting(Plan *p, CtsBenchRow setting)
{
    assert(p->n < p->capacity);
    p->rows[p->n++] = setting;
}

static void add_paper(Plan *p, CtsEngineId engine, bool reuses_layers, bool skips_void, bool full)
{
    if (!full) {
        add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .samples = 1});
        return;
    }
    for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++)
        add_setting(p, (CtsBenchRow){.engine = engine, .kernel = (CtsKernelId)kernel, .samples = 1});
    for (int samples = 2; samples <= 4; samples *= 2)
        add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .samples = samples});
    for (double tolerance_hu = 5; tolerance_hu <= 20 && reuses_layers; tolerance_hu *= 4)
        add_setting(
            p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .samples = 1, .tolerance_hu = tolerance_hu});
    if (skips_void)
        add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .samples = 1, .void_key = true});
}

static void add_by_error(Plan *p, CtsEngineId engine, bool full)
{
    add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT});
    static const struct {
        double max_error;
        bool in_short; /* measured without `full` too */
    } asked[] = {{16, false}, {12, false}, {8, true},   {5, false},    {3, false},
                 {2, true},   {1, true},   {0.5, true}, {0.25, false}, {0.1, true}};
    for (size_t i = 0; i < sizeof asked / sizeof *asked; i++) {
        if (!full && !asked[i].in_short)
            continue;
        add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .max_error = asked[i].max_error});
    }
}

/* An engine that is neither the paper's nor the reference has --max-error, and is measured with it. */
static void add_engine(Plan *p, CtsEngineId engine, bool full)
{
    const bool reuses_layers = engine == CTS_ENGINE_LAYERS || engine == CTS_ENGINE_COMBINED;
    const bool skips_void = engine == CTS_ENGINE_VOID || engine == CTS_ENGINE_COMBINED;
    if (engine == CTS_ENGINE_RAYCAST) {
        if (full)
            add_setting(p, (CtsBenchRow){.engine = engine, .kernel = CTS_KERNEL_TENT, .samples = 1});
    } else if (reuses_layers || skips_void || engine == CTS_ENGINE_CLASSIC)
        add_paper(p, engine, reuses_layers, skips_void, full);
    else
        add_by_error(p, engine, full);
}

CtsStatus cts_bench_plan(bool full, CtsBenchRow **rows, int *n, CtsError *err)
{
    Plan p = {.capacity = CTS_N_ENGINES * (CTS_N_KERNELS + MAX_TUNED)};
    if (!(p.rows = calloc((size_t)p.capacity, sizeof *p.rows)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int engine = 0; engine < CTS_N_ENGINES; engine++)
        add_engine(&p, (CtsEngineId)engine, full);
    *rows = p.rows;
    *n = p.n;
    return CTS_OK;
}
