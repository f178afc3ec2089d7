#include "core/volume/threshold.h"

#include "base/parallel.h"
#include "core/volume/linear_layers.h"
#include <stdatomic.h>
#include <string.h>
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

/* One row: bit i is set if level i of n is at least min. */
static void threshold_row(uint64_t *row, const uint16_t *levels, int n, uint16_t min)
{
    for (int w = 0; w < n / 64; w++)
        row[w] = threshold_half(levels + 64 * w, min) | threshold_half(levels + 64 * w + HALF, min) << HALF;
    if (n % 64) {
        uint64_t last = 0;
        for (int i = n / 64 * 64; i < n; i++)
            last |= (uint64_t)(levels[i] >= min) << (i & 63);
        row[n / 64] = last;
    }
}

/* Parameters common to all rows. */
typedef struct Threshold {
    CtsBits *bits;
    const uint16_t *grey;          /* with `layers`: NULL */
    const CtsLinearLayers *layers; /* or NULL */
    const CtsBits *slices;         /* with `layers`: their slices */
    uint16_t min;
    _Atomic uint64_t n_runs;
} Threshold;

/* A level between two is at least the lower one and at most the higher one, so only words in which the slices differ
 * need levels. */
static void threshold_between(uint64_t *words, const uint64_t *low, const uint64_t *high, const CtsLinearLayer *layer,
                              size_t first, size_t n, uint16_t min)
{
    enum { COLUMNS = 64 }; /* of a word */
    for (size_t i = 0; i < n; i += COLUMNS, words++, low++, high++) {
        uint16_t made[COLUMNS];
        const size_t n_columns = n - i < COLUMNS ? n - i : COLUMNS;
        *words = *low;
        if (*low != *high)
            threshold_row(words, cts_linear_layer_row(layer, first + i, n_columns, made), (int)n_columns, min);
    }
}

static void threshold_rows(void *context, int worker, size_t first, size_t end)
{
    Threshold *const t = context;
    const size_t nx = (size_t)t->bits->dims[0], ny = (size_t)t->bits->dims[1];
    uint64_t n_runs = 0;
    (void)worker;
    for (size_t k = first; k < end; k++) {
        const CtsLinearLayer layer =
            t->layers ? cts_linear_layer(t->layers, nx * ny, (int)k) : (CtsLinearLayer){t->grey + k * nx * ny, NULL, 0};
        const int below = t->layers ? cts_slice_below(t->layers->layer, t->layers->n_slices, (int)k) : 0;
        for (size_t j = 0; j < ny; j++) {
            uint64_t *const words = cts_bits_row(t->bits, (int)j, (int)k);
            const uint64_t *const low = t->layers ? cts_bits_row(t->slices, (int)j, below) : NULL;
            if (!t->layers)
                threshold_row(words, layer.low + j * nx, (int)nx, t->min);
            else if (layer.high)
                threshold_between(words, low, cts_bits_row(t->slices, (int)j, below + 1), &layer, j * nx, nx, t->min);
            else
                memcpy(words, low, t->bits->row_words * sizeof *words);
            n_runs += cts_bits_count_runs(words, t->bits->row_words);
        }
    }
    atomic_fetch_add(&t->n_runs, n_runs);
}

uint64_t cts_bits_threshold(CtsBits *bits, const uint16_t *grey, uint16_t grey_min, int n_threads)
{
    Threshold t = {.bits = bits, .grey = grey, .min = grey_min};
    cts_parallel(n_threads, (size_t)bits->dims[2], 0, threshold_rows, &t);
    return atomic_load(&t.n_runs);
}

CtsStatus cts_bits_threshold_layers(CtsBits *bits, const CtsLinearLayers *layers, uint16_t grey_min, int n_threads,
                                    uint64_t *n_runs, CtsError *err)
{
    CtsBits slices = {0};
    Threshold t = {.bits = bits, .slices = &slices, .layers = layers, .min = grey_min};
    const CtsStatus st = cts_bits_new(&slices, (const int[]){bits->dims[0], bits->dims[1], layers->n_slices}, err);
    if (st)
        return st;
    cts_bits_threshold(&slices, layers->slices, grey_min, n_threads);
    cts_parallel(n_threads, (size_t)bits->dims[2], 0, threshold_rows, &t);
    cts_bits_free(&slices);
    *n_runs = atomic_load(&t.n_runs);
    return CTS_OK;
}
