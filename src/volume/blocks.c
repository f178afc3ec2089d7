#include "volume/blocks.h"

#include "base/mem.h"
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#define VECTOR_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define VECTOR_CLONES
#endif

static inline uint16_t min16(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

static inline uint16_t max16(uint16_t a, uint16_t b)
{
    return a > b ? a : b;
}

/* low[i], high[i] over n_rows rows that lie row_stride apart. */
VECTOR_CLONES static void fold_rows(const uint16_t *row, size_t row_stride, int n_rows, int n, uint16_t *restrict low,
                                    uint16_t *restrict high)
{
    for (int r = 0; r < n_rows; r++, row += row_stride)
        for (int i = 0; i < n; i++) {
            low[i] = min16(low[i], row[i]);
            high[i] = max16(high[i], row[i]);
        }
}

/* The blocks of one slice of a slab, folded into range. */
static void fold_slice(const CtsVolume *v, const uint16_t *slice, const int n[3], CtsRange *range, uint16_t *low,
                       uint16_t *high)
{
    const int nx = v->dims[0], ny = v->dims[1];
    for (int bj = 0; bj < n[1]; bj++) {
        const int j0 = bj * CTS_BLOCK, j1 = j0 + CTS_BLOCK < ny - 1 ? j0 + CTS_BLOCK : ny - 1;
        memset(low, 0xff, (size_t)nx * sizeof *low);
        memset(high, 0, (size_t)nx * sizeof *high);
        fold_rows(slice + (size_t)j0 * (size_t)nx, (size_t)nx, j1 - j0 + 1, nx, low, high);
        for (int bi = 0; bi < n[0]; bi++) {
            const int i0 = bi * CTS_BLOCK, i1 = i0 + CTS_BLOCK < nx - 1 ? i0 + CTS_BLOCK : nx - 1;
            CtsRange *r = &range[bj * n[0] + bi];
            for (int i = i0; i <= i1; i++) {
                r->low = min16(r->low, low[i]);
                r->high = max16(r->high, high[i]);
            }
        }
    }
}

CtsStatus cts_blocks_new(CtsBlocks **blocks, const CtsVolume *volume, int n_threads, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsBlocks *b = *blocks = calloc(1, sizeof *b);
    uint16_t *rows = NULL;
    const size_t nx = (size_t)volume->dims[0], slice = nx * (size_t)volume->dims[1];
    if (!b)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    size_t n = 1;
    for (int axis = 0; axis < 3; axis++) {
        b->n[axis] = volume->dims[axis] > 1 ? (volume->dims[axis] - 2) / CTS_BLOCK + 1 : 1;
        n *= (size_t)b->n[axis];
    }
    const size_t per_slab = (size_t)b->n[0] * (size_t)b->n[1];
    if ((st = cts_alloc_array(&b->range, n, err)) || (st = cts_alloc_array(&rows, 2 * nx * (size_t)n_threads, err)))
        goto end;
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int t = 0; t < n_threads; t++) {
        uint16_t *low = rows + 2 * nx * (size_t)t, *high = low + nx;
        const int from = (int)((int64_t)b->n[2] * t / n_threads), to = (int)((int64_t)b->n[2] * (t + 1) / n_threads);
        for (int bk = from; bk < to; bk++) {
            CtsRange *range = b->range + (size_t)bk * per_slab;
            for (size_t i = 0; i < per_slab; i++)
                range[i] = (CtsRange){65535, 0};
            for (int k = bk * CTS_BLOCK; k <= (bk + 1) * CTS_BLOCK && k < volume->dims[2]; k++)
                fold_slice(volume, volume->grey + (size_t)k * slice, b->n, range, low, high);
        }
    }
    b->all = b->range[0];
    for (size_t i = 1; i < n; i++) {
        b->all.low = min16(b->all.low, b->range[i].low);
        b->all.high = max16(b->all.high, b->range[i].high);
    }
end:
    cts_free(&rows);
    if (st)
        cts_blocks_free(blocks);
    return st;
}

void cts_blocks_free(CtsBlocks **blocks)
{
    if (!*blocks)
        return;
    cts_free(&(*blocks)->range);
    free(*blocks);
    *blocks = NULL;
}
