/* The settings to be measured: each engine with each of its kernels and tuning parameters. */
#include "lab/bench/bench.h"

#include <stdlib.h>

/* Sets of engines, bits 1 << CtsEngineId. An engine that is neither the paper's nor the reference has --max-error, and
 * is measured with it. */
enum {
    CLASSIC = 1u << CTS_ENGINE_CLASSIC,
    LAYERS = 1u << CTS_ENGINE_LAYERS,
    VOID = 1u << CTS_ENGINE_VOID,
    COMBINED = 1u << CTS_ENGINE_COMBINED,
    RAYCAST = 1u << CTS_ENGINE_RAYCAST,
    PAPER = CLASSIC | LAYERS | VOID | COMBINED,
    BY_ERROR = ((1u << CTS_N_ENGINES) - 1) & ~(PAPER | RAYCAST)
};

static const struct {
    unsigned engines, in_short; /* in_short: those of them that are measured without `full` too */
    CtsBenchRow row;            /* of an engine */
} settings[] = {
    {PAPER | RAYCAST, PAPER, {.samples = 1}},
    {PAPER, 0, {.kernel = CTS_KERNEL_GAUSSIAN, .samples = 1}},
    {PAPER, 0, {.kernel = CTS_KERNEL_CONE, .samples = 1}},
    {PAPER, 0, {.kernel = CTS_KERNEL_BSPLINE, .samples = 1}},
    {PAPER, 0, {.kernel = CTS_KERNEL_CONE_PAPER, .samples = 1}},
    {PAPER, 0, {.samples = 2}},
    {PAPER, 0, {.samples = 4}},
    {LAYERS | COMBINED, 0, {.samples = 1, .tolerance_hu = 5}},
    {LAYERS | COMBINED, 0, {.samples = 1, .tolerance_hu = 20}},
    {VOID | COMBINED, 0, {.samples = 1, .void_key = true}},
    {BY_ERROR, BY_ERROR, {.max_error = 0}},
    {BY_ERROR, 0, {.max_error = 16}},
    {BY_ERROR, 0, {.max_error = 12}},
    {BY_ERROR, BY_ERROR, {.max_error = 8}},
    {BY_ERROR, 0, {.max_error = 5}},
    {BY_ERROR, 0, {.max_error = 3}},
    {BY_ERROR, BY_ERROR, {.max_error = 2}},
    {BY_ERROR, BY_ERROR, {.max_error = 1}},
    {BY_ERROR, BY_ERROR, {.max_error = 0.5}},
    {BY_ERROR, 0, {.max_error = 0.25}},
    {BY_ERROR, BY_ERROR, {.max_error = 0.1}},
};
enum { N_SETTINGS = sizeof settings / sizeof *settings };

CtsStatus cts_bench_plan(bool full, CtsBenchRow **rows, int *n, CtsError *err)
{
    *n = 0;
    if (!(*rows = calloc((size_t)CTS_N_ENGINES * N_SETTINGS, sizeof **rows)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int engine = 0; engine < CTS_N_ENGINES; engine++)
        for (int i = 0; i < N_SETTINGS; i++)
            if ((full ? settings[i].engines : settings[i].in_short) >> engine & 1) {
                (*rows)[*n] = settings[i].row;
                (*rows)[(*n)++].engine = (CtsEngineId)engine;
            }
    return CTS_OK;
}
