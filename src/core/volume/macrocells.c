#include "core/volume/macrocells.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/volume/fold.h"
#include <stdlib.h>
#include <string.h>

/* A fine macro-cell reaches over so many voxels. */
enum { REACH = CTS_FINE_MACROCELL + 1 };

static inline uint16_t min16(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

static inline uint16_t max16(uint16_t a, uint16_t b)
{
    return a > b ? a : b;
}

static inline void widen(CtsRange *r, CtsRange other)
{
    r->low = min16(r->low, other.low);
    r->high = max16(r->high, other.high);
}

/* The range of a layer's fine macro-cells, range[bj * n_fine[0] + bi], widened by a slice. */
static void fold_slice(const CtsMacrocells *b, const uint16_t *slice, CtsRange *range)
{
    const cts_fold_fn fold = cts_fold(cts_cpu_flags());
    const int nx = b->dims[0], ny = b->dims[1];
    for (int bj = 0; bj < b->n_fine[1]; bj++) {
        const int j0 = bj * CTS_FINE_MACROCELL, n_rows = ny - j0 < REACH ? ny - j0 : REACH;
        fold(slice + (size_t)j0 * (size_t)nx, (size_t)nx, n_rows, nx, range + (size_t)bj * (size_t)b->n_fine[0],
             b->n_fine[0]);
    }
}

static void widen_row(CtsRange *restrict to, const CtsRange *restrict from, int n)
{
    for (int i = 0; i < n; i++)
        widen(&to[i], from[i]);
}

static size_t product(const int n[3])
{
    return (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
}

static void clear(CtsRange *range, size_t n)
{
    for (size_t i = 0; i < n; i++)
        range[i] = (CtsRange){65535, 0};
}

static void count_macrocells(CtsMacrocells *b, int axis, int n)
{
    const int cells = n > 1 ? n - 1 : 1;
    b->dims[axis] = n;
    b->n[axis] = (cells - 1) / CTS_MACROCELL + 1;
    b->n_fine[axis] = (cells - 1) / CTS_FINE_MACROCELL + 1;
}

CtsStatus cts_macrocells_new_unset(CtsMacrocells **macrocells, const int dims[3], CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsMacrocells *b = *macrocells = calloc(1, sizeof *b);
    if (!b)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int axis = 0; axis < 3; axis++)
        count_macrocells(b, axis, dims[axis]);
    if ((st = cts_alloc_array(&b->range, product(b->n), err)) ||
        (st = cts_alloc_array(&b->fine, product(b->n_fine), err)))
        cts_macrocells_free(macrocells);
    return st;
}

/* One row of coarse macro-cells from the up to four rows of fine ones that it covers. */
static void sum_row(CtsMacrocells *b, int bj, int bk)
{
    enum { PART = 256 };
    const int *n = b->n, *nf = b->n_fine;
    CtsRange *row = b->range + ((size_t)bk * (size_t)n[1] + (size_t)bj) * (size_t)n[0];
    for (int first = 0; first < nf[0]; first += PART) {
        CtsRange sum[PART + 1];
        const int n_part = nf[0] - first < PART ? nf[0] - first : PART;
        clear(sum, (size_t)n_part + 1);
        for (int fk = 2 * bk; fk < 2 * bk + 2 && fk < nf[2]; fk++)
            for (int fj = 2 * bj; fj < 2 * bj + 2 && fj < nf[1]; fj++)
                widen_row(sum, b->fine + ((size_t)fk * (size_t)nf[1] + (size_t)fj) * (size_t)nf[0] + first, n_part);
        for (int i = 0; i < n_part; i += 2) {
            row[(first + i) / 2] = sum[i];
            widen(&row[(first + i) / 2], sum[i + 1]);
        }
    }
}

static void sum_layers(void *context, int worker, size_t first, size_t end)
{
    CtsMacrocells *const b = context;
    (void)worker;
    for (size_t bk = first; bk < end; bk++)
        for (int bj = 0; bj < b->n[1]; bj++)
            sum_row(b, bj, (int)bk);
}

void cts_macrocells_sum(CtsMacrocells *b, int n_threads)
{
    cts_parallel(n_threads, (size_t)b->n[2], 0, sum_layers, b);
    clear(&b->all, 1);
    for (size_t i = 0; i < product(b->n); i++)
        widen(&b->all, b->range[i]);
}

typedef struct Folding {
    CtsMacrocells *macrocells;
    const CtsVolume *volume;
} Folding;

/* Layers of fine macro-cells; the slice on which two of them meet is folded into both. */
static void fold_layers(void *context, int worker, size_t first, size_t end)
{
    const Folding *const f = context;
    const CtsMacrocells *const b = f->macrocells;
    const size_t layer = (size_t)b->n_fine[0] * (size_t)b->n_fine[1], slice = (size_t)b->dims[0] * (size_t)b->dims[1];
    (void)worker;
    for (size_t bk = first; bk < end; bk++) {
        clear(b->fine + bk * layer, layer);
        for (size_t k = bk * CTS_FINE_MACROCELL; k < bk * CTS_FINE_MACROCELL + REACH && k < (size_t)b->dims[2]; k++)
            fold_slice(b, f->volume->grey + k * slice, b->fine + bk * layer);
    }
}

CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err)
{
    const CtsStatus st = cts_macrocells_new_unset(macrocells, volume->dims, err);
    if (st)
        return st;
    Folding folding = {*macrocells, volume};
    cts_parallel(n_threads, (size_t)(*macrocells)->n_fine[2], 0, fold_layers, &folding);
    cts_macrocells_sum(*macrocells, n_threads);
    return CTS_OK;
}

void cts_macrocells_free(CtsMacrocells **macrocells)
{
    if (!*macrocells)
        return;
    cts_free(&(*macrocells)->range);
    cts_free(&(*macrocells)->fine);
    free(*macrocells);
    *macrocells = NULL;
}
