#include "core/volume/threshold.h"

#include "base/parallel.h"
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

enum { HALF = 32 }; /* levels of a cache line, and bits of half a word */

/* 32 comparisons as 32 bits. SSE2 is part of every x86-64. */
static inline uint64_t threshold_half(const uint16_t *grey, uint16_t grey_min)
{
    uint64_t half = 0;
#if defined(__SSE2__)
    const __m128i zero = _mm_setzero_si128(), min = _mm_set1_epi16((short)grey_min);
    for (int i = 0; i < HALF; i += 16) {
        const __m128i a = _mm_loadu_si128((const void *)(grey + i)), b = _mm_loadu_si128((const void *)(grey + i + 8));
        const __m128i reached = _mm_packs_epi16(_mm_cmpeq_epi16(_mm_subs_epu16(min, a), zero),
                                                _mm_cmpeq_epi16(_mm_subs_epu16(min, b), zero));
        half |= (uint64_t)(unsigned)_mm_movemask_epi8(reached) << i;
    }
#else
    for (int i = 0; i < HALF; i++)
        half |= (uint64_t)(grey[i] >= grey_min) << i;
#endif
    return half;
}

static inline uint64_t threshold_word(const uint16_t *grey, uint16_t grey_min)
{
    return threshold_half(grey, grey_min) | threshold_half(grey + HALF, grey_min) << HALF;
}

void cts_bits_threshold_row(uint64_t *row, const uint16_t *levels, int n, uint16_t min)
{
    for (int w = 0; w < n / 64; w++)
        row[w] = threshold_word(levels + 64 * w, min);
    if (n % 64) {
        uint64_t last = 0;
        for (int i = n / 64 * 64; i < n; i++)
            last |= (uint64_t)(levels[i] >= min) << (i & 63);
        row[n / 64] = last;
    }
}

/* Bits of one word that the macro-cells over it decide, and those of them that are set. */
typedef struct Known {
    uint64_t bits, set;
} Known;

enum { PER_WORD = 64 / CTS_FINE_MACROCELL, ROW_CELLS = CTS_BITS_ROW_WORDS * PER_WORD };

/* What the n fine macro-cells of a row say, word by word; a voxel behind the last macro-cell belongs to it. */
static void look_at_macrocells(const CtsRange *range, int n, uint16_t min, Known *known, size_t n_words)
{
    uint8_t all[ROW_CELLS], some[ROW_CELLS];
    for (int b = 0; b < n; b++) {
        all[b] = range[b].low >= min;
        some[b] = range[b].high >= min;
    }
    for (int b = n; b < (int)n_words * PER_WORD; b++) {
        all[b] = all[n - 1];
        some[b] = some[n - 1];
    }
    const uint64_t macrocell = (UINT64_C(1) << CTS_FINE_MACROCELL) - 1;
    for (size_t w = 0; w < n_words; w++) {
        uint64_t set = 0, open = 0;
        for (int b = 0; b < PER_WORD; b++) {
            const size_t at = w * PER_WORD + (size_t)b;
            set |= (uint64_t)all[at] << (b * CTS_FINE_MACROCELL);
            open |= (uint64_t)(some[at] & !all[at]) << (b * CTS_FINE_MACROCELL);
        }
        known[w] = (Known){~(open * macrocell), set * macrocell};
    }
}

/* Whole lines are looked at where something is open; what is known comes out the same. */
static void threshold_open(uint64_t *row, const uint16_t *levels, int n, uint16_t min, const Known *known)
{
    const uint64_t low = ~UINT64_C(0) >> HALF;
    for (int w = 0; w < n / 64; w++) {
        const uint64_t open = ~known[w].bits;
        uint64_t word = known[w].set;
        if (open & low)
            word = (word & ~low) | threshold_half(levels + 64 * w, min);
        if (open & ~low)
            word = (word & low) | threshold_half(levels + 64 * w + HALF, min) << HALF;
        row[w] = word;
    }
    if (n % 64)
        cts_bits_threshold_row(row + n / 64, levels + n / 64 * 64, n % 64, min);
}

/* Rows j0 <= j < j1 of slices k0 <= k < k1: those of one row of fine macro-cells. */
typedef struct Beam {
    int j0, j1, k0, k1;
} Beam;

/* The last macro-cell of an axis has the voxel behind it, too. */
static int macrocell_end(int macrocell, int n_macrocells, int n)
{
    return macrocell + 1 < n_macrocells ? (macrocell + 1) * CTS_FINE_MACROCELL : n;
}

/* What is read is scattered; asking for it one row of macro-cells ahead hides the time that memory takes. */
static void ask_for_open(const CtsBits *bits, const uint16_t *grey, const Beam *beam, const Known *known)
{
    const size_t nx = (size_t)bits->dims[0], ny = (size_t)bits->dims[1];
    for (size_t at = 0; at < nx; at += HALF) {
        if (!(uint32_t)(~known[at / 64].bits >> at % 64))
            continue;
        for (int k = beam->k0; k < beam->k1; k++)
            for (int j = beam->j0; j < beam->j1; j++)
                __builtin_prefetch(grey + ((size_t)k * ny + (size_t)j) * nx + at);
    }
}

/* What all rows are thresholded with. */
typedef struct Threshold {
    CtsBits *bits;
    const uint16_t *grey;
    const CtsMacrocells *macrocells;
    uint16_t min;
    uint32_t *n_runs;
} Threshold;

/* Row j of slice k; known tells what is known of it, NULL: nothing. */
static void threshold_row(const Threshold *t, int j, int k, const Known *known)
{
    const size_t row = (size_t)k * (size_t)t->bits->dims[1] + (size_t)j;
    const uint16_t *grey = t->grey + row * (size_t)t->bits->dims[0];
    uint64_t *words = cts_bits_row(t->bits, j, k);
    if (known)
        threshold_open(words, grey, t->bits->dims[0], t->min, known);
    else
        cts_bits_threshold_row(words, grey, t->bits->dims[0], t->min);
    if (t->n_runs)
        t->n_runs[row] = cts_bits_count_runs(words, t->bits->row_words);
}

static void threshold_layer(const Threshold *t, int bk)
{
    const CtsMacrocells *macrocells = t->macrocells;
    const int *n = macrocells->n_fine;
    Known known[2][CTS_BITS_ROW_WORDS];
    Beam beam[2] = {{0}};
    for (int bj = 0; bj <= n[1]; bj++) {
        const int ahead = bj % 2, now = !ahead;
        if (bj < n[1]) {
            beam[ahead] = (Beam){bj * CTS_FINE_MACROCELL, macrocell_end(bj, n[1], t->bits->dims[1]),
                                 bk * CTS_FINE_MACROCELL, macrocell_end(bk, n[2], t->bits->dims[2])};
            look_at_macrocells(macrocells->fine + ((size_t)bk * (size_t)n[1] + (size_t)bj) * (size_t)n[0], n[0], t->min,
                               known[ahead], t->bits->row_words);
            ask_for_open(t->bits, t->grey, &beam[ahead], known[ahead]);
        }
        for (int k = beam[now].k0; bj && k < beam[now].k1; k++)
            for (int j = beam[now].j0; j < beam[now].j1; j++)
                threshold_row(t, j, k, known[now]);
    }
}

static void threshold_layers(void *context, int worker, size_t first, size_t end)
{
    (void)worker;
    for (size_t bk = first; bk < end; bk++)
        threshold_layer(context, (int)bk);
}

static void threshold_slices(void *context, int worker, size_t first, size_t end)
{
    const Threshold *const t = context;
    (void)worker;
    for (size_t k = first; k < end; k++)
        for (int j = 0; j < t->bits->dims[1]; j++)
            threshold_row(t, j, (int)k, NULL);
}

void cts_bits_threshold(CtsBits *bits, const uint16_t *grey, const CtsMacrocells *macrocells, uint16_t grey_min,
                        uint32_t *n_runs, int n_threads)
{
    Threshold t = {bits, grey, macrocells, grey_min, n_runs};
    if (macrocells)
        cts_parallel(n_threads, (size_t)macrocells->n_fine[2], 1, threshold_layers, &t);
    else
        cts_parallel(n_threads, (size_t)bits->dims[2], 0, threshold_slices, &t);
}
