#include "core/table/cell_change.h"

#include "base/cpu.h"
#include "base/parallel.h"
#include "core/volume/fold.h"
#include <stdbool.h>
#include <string.h>

enum { PER_WORD = 64 / CTS_FINE_MACROCELL, REACH = CTS_FINE_MACROCELL + 1 };

CtsStatus cts_cell_change_new(CtsCellChange *change, CtsMacrocells *macrocells, CtsError *err)
{
    CtsStatus st;
    *change = (CtsCellChange){.macrocells = macrocells};
    if (!macrocells)
        return CTS_OK;
    const int dims[3] = {macrocells->n_fine[0], macrocells->n_fine[1], macrocells->dims[2]};
    if ((st = cts_bits_new_unset(&change->lost, dims, err)) || (st = cts_bits_new_unset(&change->kept, dims, err)))
        return st;
    return CTS_OK;
}

void cts_cell_change_free(CtsCellChange *change)
{
    cts_bits_free(&change->lost);
    cts_bits_free(&change->kept);
}

/* Bit b: whether one of the voxels 4 b to 4 b + 4 is set; next is the word that follows. */
static uint64_t by_macrocell(uint64_t word, uint64_t next)
{
    if (word == ~UINT64_C(0))
        return 0xFFFF;
    uint64_t x = word | word >> 1 | word >> 2 | word >> 3 | word >> 4 | next << 60;
    x &= UINT64_C(0x1111111111111111);
    x = (x | x >> 3) & UINT64_C(0x0303030303030303);
    x = (x | x >> 6) & UINT64_C(0x000F000F000F000F);
    x = (x | x >> 12) & UINT64_C(0x000000FF000000FF);
    return (x | x >> 24) & 0xFFFF;
}

/* Add macro-cells of word w of a row of voxels; those behind the last macro-cell are its last voxel alone, which it
 * has. */
static void add_macrocells(const CtsBits *bits, int bj, int k, size_t w, uint64_t macrocells)
{
    const size_t at = w / CTS_FINE_MACROCELL;
    if (at < bits->row_words)
        cts_bits_row(bits, bj, k)[at] |= (macrocells << (w % CTS_FINE_MACROCELL * PER_WORD)) & cts_bits_mask(bits, at);
}

/* The macro-cells (., bj) over slice k, from the voxels of their rows that are gone in some row and in all of them. */
static void add_row(CtsCellChange *c, int bj, int k, const uint64_t *some, const uint64_t *all)
{
    const int nx = c->macrocells->dims[0];
    const size_t n_words = ((size_t)nx + 63) / 64;
    if (bj >= c->macrocells->n_fine[1])
        return;
    for (size_t w = 0; w < n_words; w++) {
        const bool last = w + 1 == n_words;
        const uint64_t in_row = last && nx % 64 ? ~(~UINT64_C(0) << nx % 64) : ~UINT64_C(0);
        if (some[w] || (!last && some[w + 1]))
            add_macrocells(&c->lost, bj, k, w, by_macrocell(some[w], last ? 0 : some[w + 1]));
        if (all[w] != in_row || (!last && ~all[w + 1]))
            add_macrocells(&c->kept, bj, k, w, by_macrocell(~all[w] & in_row, last ? 0 : ~all[w + 1]));
    }
}

static void join_row(CtsCellRows *rows, const uint64_t *restrict gone, size_t n_words)
{
    for (size_t w = 0; w < n_words; w++) {
        rows->some[w] |= gone[w];
        rows->all[w] &= gone[w];
    }
}

static size_t slice_bytes(const CtsCellChange *c)
{
    return c->lost.row_words * (size_t)c->lost.dims[1] * sizeof *c->lost.words;
}

void cts_cell_change_row(CtsCellChange *c, CtsCellRows *rows, const uint64_t *gone, int j, int k)
{
    if (!c->macrocells)
        return;
    const size_t n_words = (size_t)c->macrocells->dims[0] / 64 + 1;
    if (j == 0) {
        memset(cts_bits_row(&c->lost, 0, k), 0, slice_bytes(c));
        memset(cts_bits_row(&c->kept, 0, k), 0, slice_bytes(c));
    }
    /* The first row of a macro-cell is the last of the one before. */
    const bool first = j % CTS_FINE_MACROCELL == 0, last = j == c->macrocells->dims[1] - 1;
    if (j)
        join_row(rows, gone, n_words);
    if (j && (first || last))
        add_row(c, (j - 1) / CTS_FINE_MACROCELL, k, rows->some, rows->all);
    if (first) {
        memcpy(rows->some, gone, n_words * sizeof *gone);
        memcpy(rows->all, gone, n_words * sizeof *gone);
    }
    if (first && last)
        add_row(c, j / CTS_FINE_MACROCELL, k, rows->some, rows->all);
}

void cts_cell_change_same(CtsCellChange *c, int k)
{
    if (!c->macrocells)
        return;
    memcpy(cts_bits_row(&c->lost, 0, k), cts_bits_row(&c->lost, 0, k - 1), slice_bytes(c));
    memcpy(cts_bits_row(&c->kept, 0, k), cts_bits_row(&c->kept, 0, k - 1), slice_bytes(c));
}

/* The largest level of the n_macrocells fine macro-cells from (bi, bj, bk) on, one after the other along a row. */
static void find_highest(const CtsVolume *v, cts_fold_fn fold, int bi, int bj, int bk, int n_macrocells,
                         CtsRange *range)
{
    enum { MOST = 64 + 3 }; /* macro-cells come from one word */
    const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1];
    const int k0 = bk * CTS_FINE_MACROCELL, j0 = bj * CTS_FINE_MACROCELL, i0 = bi * CTS_FINE_MACROCELL;
    const int k1 = k0 + REACH < v->dims[2] ? k0 + REACH : v->dims[2];
    const int n_rows = j0 + REACH < v->dims[1] ? REACH : v->dims[1] - j0, n = v->dims[0] - i0;
    /* Whole vectors of macro-cells where the row has them; what is found too much is not used. */
    const int whole = (n_macrocells + 3) / 4 * 4, n_found = 4 * whole < n ? whole : n_macrocells;
    CtsRange found[MOST];
    for (int b = 0; b < n_found; b++)
        found[b] = (CtsRange){65535, 0};
    for (int k = k0; k < k1; k++)
        fold(v->grey + ((size_t)k * ny + (size_t)j0) * nx + i0, nx, n_rows, n, found, n_found);
    for (int b = 0; b < n_macrocells; b++)
        range[b] = (CtsRange){0, found[b].high};
}

/* One row of fine macro-cells: as it was, all air, or air and something. */
static void change_row(const CtsCellChange *c, const CtsVolume *v, cts_fold_fn fold, int bj, int bk)
{
    const int *n = c->macrocells->n_fine, k0 = bk * CTS_FINE_MACROCELL;
    CtsRange *range = c->macrocells->fine + ((size_t)bk * (size_t)n[1] + (size_t)bj) * (size_t)n[0];
    for (size_t w = 0; w < c->lost.row_words; w++) {
        uint64_t lost = 0, kept = 0;
        for (int k = k0; k < k0 + REACH && k < v->dims[2]; k++) {
            lost |= cts_bits_row(&c->lost, bj, k)[w];
            kept |= cts_bits_row(&c->kept, bj, k)[w];
        }
        for (uint64_t run; lost; lost &= ~run) {
            const bool some_left = kept >> __builtin_ctzll(lost) & 1;
            run = lost & (some_left ? kept : ~kept);
            run &= ~(run + (lost & -lost));
            const int first = (int)(64 * w) + __builtin_ctzll(run), end = first + cts_popcount(run);
            if (some_left)
                find_highest(v, fold, first, bj, bk, end - first, range + first);
            for (int b = first; b < end && !some_left; b++)
                range[b] = (CtsRange){0, 0};
        }
    }
}

typedef struct Changing {
    const CtsCellChange *change;
    const CtsVolume *volume;
    cts_fold_fn fold;
} Changing;

static void change_layers(void *context, int worker, size_t first, size_t end)
{
    const Changing *const c = context;
    (void)worker;
    for (size_t bk = first; bk < end; bk++)
        for (int bj = 0; bj < c->change->macrocells->n_fine[1]; bj++)
            change_row(c->change, c->volume, c->fold, bj, (int)bk);
}

void cts_cell_change_apply(const CtsCellChange *c, const CtsVolume *volume, int n_threads)
{
    if (!c->macrocells)
        return;
    Changing changing = {c, volume, cts_fold(cts_cpu_flags())};
    cts_parallel(n_threads, (size_t)c->macrocells->n_fine[2], 1, change_layers, &changing);
    cts_macrocells_sum(c->macrocells, n_threads);
}
