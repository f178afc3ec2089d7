#include "core/volume/threshold.h"

#include "base/parallel.h"
#include <stdatomic.h>
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
    const uint16_t *grey;
    uint16_t min;
    _Atomic uint64_t n_runs;
} Threshold;

static void threshold_slices(void *context, int worker, size_t first, size_t end)
{
    Threshold *const t = context;
    const size_t nx = (size_t)t->bits->dims[0], ny = (size_t)t->bits->dims[1];
    uint64_t n_runs = 0;
    (void)worker;
    for (size_t row = first * ny; row < end * ny; row++) {
        uint64_t *words = t->bits->words + row * t->bits->row_words;
        threshold_row(words, t->grey + row * nx, (int)nx, t->min);
        n_runs += cts_bits_count_runs(words, t->bits->row_words);
    }
    atomic_fetch_add(&t->n_runs, n_runs);
}

uint64_t cts_bits_threshold(CtsBits *bits, const uint16_t *grey, uint16_t grey_min, int n_threads)
{
    Threshold t = {.bits = bits, .grey = grey, .min = grey_min};
    cts_parallel(n_threads, (size_t)bits->dims[2], 0, threshold_slices, &t);
    return atomic_load(&t.n_runs);
}
