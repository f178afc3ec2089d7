#include "core/model/macrocells.h"

#include "base/compare.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <stdlib.h>
#include <string.h>

/* REACH: voxels that a fine macro-cell spans; COLUMNS: columns processed together, while they are in the cache. */
enum { REACH = CTS_FINE_MACROCELL + 1, COLUMNS = 256 * CTS_FINE_MACROCELL };

/* Extends each column's range by five rows. */
static inline __attribute__((always_inline)) void widen_columns(uint16_t *restrict low, uint16_t *restrict high,
                                                                const uint16_t *const row[REACH], int n)
{
    const uint16_t *const a = row[0], *const b = row[1], *const c = row[2], *const d = row[3], *const e = row[4];
    for (int i = 0; i < n; i++) {
        low[i] = cts_smaller_16(
            low[i], cts_smaller_16(cts_smaller_16(cts_smaller_16(a[i], b[i]), cts_smaller_16(c[i], d[i])), e[i]));
        high[i] = cts_larger_16(
            high[i], cts_larger_16(cts_larger_16(cts_larger_16(a[i], b[i]), cts_larger_16(c[i], d[i])), e[i]));
    }
}

/* Each element's extreme value and those of the four behind it, for n elements. */
static inline __attribute__((always_inline)) void least_of_five(uint16_t *restrict a, int n)
{
    uint16_t two[COLUMNS + 2];
    for (int i = 0; i < n + 2; i++)
        two[i] = cts_smaller_16(a[i], a[i + 1]);
    for (int i = 0; i < n; i++)
        a[i] = cts_smaller_16(a[i + REACH - 1], cts_smaller_16(two[i], two[i + 2]));
}

static inline __attribute__((always_inline)) void most_of_five(uint16_t *restrict a, int n)
{
    uint16_t two[COLUMNS + 2];
    for (int i = 0; i < n + 2; i++)
        two[i] = cts_larger_16(a[i], a[i + 1]);
    for (int i = 0; i < n; i++)
        a[i] = cts_larger_16(a[i + REACH - 1], cts_larger_16(two[i], two[i + 2]));
}

/* The fine macro-cells along a row of them, by columns of voxels first: these are most of the work, and vectors'. */
static inline __attribute__((always_inline)) void fold_any_row(const CtsMacrocells *m, const uint16_t *grey, int bj,
                                                               int bk)
{
    const int nx = m->dims[0], ny = m->dims[1];
    CtsRange *to = m->fine + ((size_t)bk * (size_t)m->n_fine[1] + (size_t)bj) * (size_t)m->n_fine[0];
    for (int first = 0; first == 0 || first < nx - 1; first += COLUMNS) {
        uint16_t low[COLUMNS + 2 * REACH], high[COLUMNS + 2 * REACH]; /* beyond the last column nothing */
        const int n = nx - first < COLUMNS + 1 ? nx - first : COLUMNS + 1;
        memset(low, 0xff, (size_t)(n + REACH) * sizeof *low);
        memset(high, 0, (size_t)(n + REACH) * sizeof *high);
        for (int k = bk * CTS_FINE_MACROCELL; k < bk * CTS_FINE_MACROCELL + REACH && k < m->dims[2]; k++) {
            const uint16_t *row[REACH];
            for (int r = 0; r < REACH; r++) {
                const int j = bj * CTS_FINE_MACROCELL + r;
                row[r] = grey + ((size_t)k * (size_t)ny + (size_t)(j < ny ? j : ny - 1)) * (size_t)nx + first;
            }
            widen_columns(low, high, row, n);
        }
        const int n_cells = n > 1 ? n - 1 : 1;
        least_of_five(low, n_cells);
        most_of_five(high, n_cells);
        for (int i = 0; i < n_cells; i += CTS_FINE_MACROCELL)
            *to++ = (CtsRange){low[i], high[i]};
    }
}

CTS_CPU_VARIANTS(void, fold_row, (const CtsMacrocells *m, const uint16_t *grey, int bj, int bk),
                 fold_any_row(m, grey, bj, bk))

static size_t product(const int n[3])
{
    return (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
}

CtsStatus cts_macrocells_new_unset(CtsMacrocells **macrocells, const int dims[3], CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsMacrocells *m = *macrocells = calloc(1, sizeof *m);
    if (!m)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    pthread_mutex_init(&m->lock, NULL); /* never fails without attributes */
    for (int axis = 0; axis < 3; axis++) {
        const int n_cells = dims[axis] > 1 ? dims[axis] - 1 : 1;
        m->dims[axis] = dims[axis];
        m->n_fine[axis] = (n_cells - 1) / CTS_FINE_MACROCELL + 1;
    }
    if ((st = cts_alloc_array(&m->fine, product(m->n_fine), err)))
        cts_macrocells_free(macrocells);
    return st;
}

void cts_macrocells_sum(CtsMacrocells *m)
{
    m->all = (CtsRange){65535, 0};
    for (size_t i = 0; i < product(m->n_fine); i++)
        m->all = cts_range_union(m->all, m->fine[i]);
}

typedef struct Folding {
    CtsMacrocells *macrocells;
    const CtsVolume *volume;
} Folding;

/* Layers of fine macro-cells. */
static void fold_layers(void *context, int worker, size_t first, size_t end)
{
    const Folding *const f = context;
    (void)worker;
    for (int bk = (int)first; bk < (int)end; bk++)
        for (int bj = 0; bj < f->macrocells->n_fine[1]; bj++)
            CTS_CPU_CHOICE(cts_cpu_flags(), fold_row)(f->macrocells, f->volume->grey, bj, bk);
}

CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err)
{
    const CtsStatus st = cts_macrocells_new_unset(macrocells, volume->dims, err);
    if (st)
        return st;
    Folding folding = {*macrocells, volume};
    cts_parallel(n_threads, (size_t)(*macrocells)->n_fine[2], 0, fold_layers, &folding);
    cts_macrocells_sum(*macrocells);
    return CTS_OK;
}

void cts_macrocells_free(CtsMacrocells **macrocells)
{
    if (!*macrocells)
        return;
    cts_free(&(*macrocells)->fine);
    cts_free(&(*macrocells)->transposed);
    pthread_mutex_destroy(&(*macrocells)->lock);
    free(*macrocells);
    *macrocells = NULL;
}
