#include "core/volume/macrocells.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/volume/threshold.h"
#include "core/volume/fold.h"
#include <stdatomic.h>
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

/* Rows first <= bj < end of a slice's fine macro-cells, widened in range[bj * n_fine[0] + bi]. */
static void fold_slice(const CtsMacrocells *b, const uint16_t *slice, int first, int end, CtsRange *range)
{
    const cts_fold_fn fold = cts_fold(cts_cpu_flags());
    const int nx = b->dims[0], ny = b->dims[1];
    for (int bj = first; bj < end; bj++) {
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

static void forget_marks(CtsMacrocells *b)
{
    if (b->dense)
        cts_bits_free(b->dense);
    cts_free(&b->dense);
    cts_free(&b->dense_runs);
}

CtsStatus cts_macrocells_begin(CtsMacrocells **macrocells, const int dims[3], CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsMacrocells *b = *macrocells = calloc(1, sizeof *b);
    if (!b)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int axis = 0; axis < 3; axis++)
        count_macrocells(b, axis, dims[axis]);
    const size_t layer = (size_t)b->n_fine[0] * (size_t)b->n_fine[1];
    if ((st = cts_alloc_array(&b->range, product(b->n), err)) ||
        (st = cts_alloc_array(&b->fine, product(b->n_fine), err)) ||
        (st = cts_alloc_array(&b->shared, layer * ((size_t)b->n_fine[2] + 1), err)) ||
        (st = cts_alloc_zeroed(&b->begun, (size_t)b->n_fine[2], err)))
        cts_macrocells_free(macrocells);
    return st;
}

CtsStatus cts_macrocells_mark(CtsMacrocells *b, uint16_t dense_min, CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(&b->dense, 1, err);
    if (st || (st = cts_bits_new(b->dense, b->dims, err)) ||
        (st = cts_alloc_zeroed(&b->dense_runs, (size_t)b->dims[2], err)))
        forget_marks(b);
    b->dense_min = dense_min;
    return st;
}

bool cts_macrocells_take_marks(CtsMacrocells *b, uint16_t dense_min, CtsBits *dense, uint64_t *n_runs)
{
    const bool has = b->dense && b->dense_min == dense_min;
    *n_runs = 0;
    for (int k = 0; has && k < b->dims[2]; k++)
        *n_runs += b->dense_runs[k];
    if (has) {
        *dense = *b->dense;
        b->dense->words = NULL;
    }
    forget_marks(b);
    return has;
}

static void mark_rows(CtsMacrocells *b, int k, const uint16_t *slice, int first, int end)
{
    const int nx = b->dims[0];
    for (int j = first; j < end; j++) {
        uint64_t *row = cts_bits_row(b->dense, j, k);
        cts_bits_threshold_row(row, slice + (size_t)j * (size_t)nx, nx, b->dense_min);
        b->dense_runs[k] += cts_bits_count_runs(row, b->dense->row_words);
    }
}

/* How many rows of fine macro-cells the first n_rows rows of a slice complete. */
static int complete_rows(const CtsMacrocells *b, int n_rows)
{
    return n_rows == b->dims[1] ? b->n_fine[1] : n_rows > 0 ? (n_rows - 1) / CTS_FINE_MACROCELL : 0;
}

/* By who adds its first slice, which takes the system's time to find memory off who began. */
static CtsRange *begin_layer(CtsMacrocells *b, int bk)
{
    const size_t layer = (size_t)b->n_fine[0] * (size_t)b->n_fine[1];
    CtsRange *const own = b->fine + (size_t)bk * layer;
    if (!b->begun[bk])
        clear(own, layer);
    b->begun[bk] = true;
    return own;
}

void cts_macrocells_add(CtsMacrocells *b, int k, const uint16_t *slice, int first, int end)
{
    const size_t layer = (size_t)b->n_fine[0] * (size_t)b->n_fine[1];
    const int bk = k / CTS_FINE_MACROCELL, bj0 = complete_rows(b, first), bj1 = complete_rows(b, end);
    if (b->dense)
        mark_rows(b, k, slice, first, end);
    CtsRange *const own = bk < b->n_fine[2] ? begin_layer(b, bk) : NULL;
    if (k % CTS_FINE_MACROCELL > 0) {
        fold_slice(b, slice, bj0, bj1, own);
        return;
    }
    /* The slice on which two macro-cells meet: kept apart, since the macro-cell before may be another thread's. */
    CtsRange *shared = b->shared + (size_t)bk * layer;
    const size_t at = (size_t)bj0 * (size_t)b->n_fine[0], n = (size_t)(bj1 - bj0) * (size_t)b->n_fine[0];
    clear(shared + at, n);
    fold_slice(b, slice, bj0, bj1, shared);
    if (own)
        widen_row(own + at, shared + at, (int)n);
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

typedef struct Summing {
    CtsMacrocells *macrocells;
    _Atomic CtsRange all;
} Summing;

static void sum_layers(void *context, int worker, size_t first, size_t end)
{
    Summing *const s = context;
    CtsMacrocells *const b = s->macrocells;
    const size_t layer = (size_t)b->n[0] * (size_t)b->n[1];
    CtsRange sum = {65535, 0};
    (void)worker;
    for (size_t bk = first; bk < end; bk++) {
        for (int bj = 0; bj < b->n[1]; bj++)
            sum_row(b, bj, (int)bk);
        for (size_t i = bk * layer; i < (bk + 1) * layer; i++)
            widen(&sum, b->range[i]);
    }
    CtsRange before = atomic_load(&s->all), after;
    do {
        after = before;
        widen(&after, sum);
    } while (!atomic_compare_exchange_weak(&s->all, &before, after));
}

void cts_macrocells_sum(CtsMacrocells *b, int n_threads)
{
    Summing summing = {.macrocells = b};
    atomic_init(&summing.all, ((CtsRange){65535, 0}));
    cts_parallel(n_threads, (size_t)b->n[2], 0, sum_layers, &summing);
    b->all = atomic_load(&summing.all);
}

static void add_shared(void *context, int worker, size_t first, size_t end)
{
    CtsMacrocells *const b = context;
    const size_t layer = (size_t)b->n_fine[0] * (size_t)b->n_fine[1];
    (void)worker;
    for (size_t bk = first; bk < end; bk++) {
        CtsRange *const own = begin_layer(b, (int)bk);
        if (((int)bk + 1) * CTS_FINE_MACROCELL < b->dims[2])
            widen_row(own, b->shared + (bk + 1) * layer, (int)layer);
    }
}

void cts_macrocells_end(CtsMacrocells *b, int n_threads)
{
    cts_parallel(n_threads, (size_t)b->n_fine[2], 0, add_shared, b);
    cts_macrocells_sum(b, n_threads);
    cts_free(&b->shared);
    cts_free(&b->begun);
}

typedef struct Adding {
    CtsMacrocells *macrocells;
    const CtsVolume *volume;
} Adding;

/* The slices of one layer of macro-cells are one worker's. */
static void add_slices(void *context, int worker, size_t first, size_t end)
{
    const Adding *const a = context;
    const CtsVolume *v = a->volume;
    (void)worker;
    for (size_t k = first; k < end; k++)
        cts_macrocells_add(a->macrocells, (int)k, v->grey + k * (size_t)v->dims[0] * (size_t)v->dims[1], 0, v->dims[1]);
}

CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err)
{
    const CtsStatus st = cts_macrocells_begin(macrocells, volume->dims, err);
    if (st)
        return st;
    Adding adding = {*macrocells, volume};
    cts_parallel(n_threads, (size_t)volume->dims[2], CTS_FINE_MACROCELL, add_slices, &adding);
    cts_macrocells_end(*macrocells, n_threads);
    return CTS_OK;
}

static void map_ranges(CtsRange *to, const CtsRange *from, size_t n, const uint16_t *level)
{
    for (size_t i = 0; i < n; i++)
        to[i] = (CtsRange){level[from[i].low], level[from[i].high]};
}

CtsStatus cts_macrocells_map(CtsMacrocells **mapped, const CtsMacrocells *macrocells, const uint16_t *level,
                             CtsError *err)
{
    const CtsStatus st = cts_macrocells_begin(mapped, macrocells->dims, err);
    if (st)
        return st;
    CtsMacrocells *m = *mapped;
    map_ranges(m->range, macrocells->range, product(m->n), level);
    map_ranges(m->fine, macrocells->fine, product(m->n_fine), level);
    map_ranges(&m->all, &macrocells->all, 1, level);
    cts_free(&m->shared);
    cts_free(&m->begun);
    return CTS_OK;
}

void cts_macrocells_free(CtsMacrocells **macrocells)
{
    if (!*macrocells)
        return;
    cts_free(&(*macrocells)->range);
    cts_free(&(*macrocells)->fine);
    cts_free(&(*macrocells)->shared);
    cts_free(&(*macrocells)->begun);
    forget_marks(*macrocells);
    free(*macrocells);
    *macrocells = NULL;
}
