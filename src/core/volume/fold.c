#include "core/volume/fold.h"

#include "base/cpu.h"
#if defined(__x86_64__)
#include <immintrin.h>
#endif

/* A fine macro-cell reaches over so many columns and rows. */
enum { REACH = CTS_FINE_MACROCELL + 1 };

void cts_fold_plain(const uint16_t *row, size_t row_stride, int n_rows, int n, CtsRange *range, int n_macrocells)
{
    for (int r = 0; r < n_rows; r++, row += row_stride)
        for (int b = 0; b < n_macrocells; b++) {
            const int first = b * CTS_FINE_MACROCELL, end = first + REACH < n ? first + REACH : n;
            CtsRange *to = &range[b];
            for (int i = first; i < end; i++) {
                to->low = row[i] < to->low ? row[i] : to->low;
                to->high = row[i] > to->high ? row[i] : to->high;
            }
        }
}

#if defined(__x86_64__)
/* 16 columns of all rows. */
typedef struct Columns {
    __m256i low, high;
} Columns;

__attribute__((target("avx2"), always_inline)) static inline Columns fold_columns(const uint16_t *at, size_t row_stride,
                                                                                  int n_rows)
{
    const __m256i first = _mm256_loadu_si256((const void *)at);
    Columns c = {first, first};
    for (int r = 1; r < n_rows; r++) {
        const __m256i next = _mm256_loadu_si256((const void *)(at + (size_t)r * row_stride));
        c.low = _mm256_min_epu16(c.low, next);
        c.high = _mm256_max_epu16(c.high, next);
    }
    return c;
}

/* The columns from the fifth of v on. */
__attribute__((target("avx2"), always_inline)) static inline __m256i four_on(__m256i v, __m256i next)
{
    return _mm256_alignr_epi8(_mm256_permute2x128_si256(v, next, 0x21), v, 8);
}

/* Each 64 bits hold the four columns of a macro-cell; the fifth is the first of the macro-cell behind. */
__attribute__((target("avx2"), always_inline)) static inline void fold_macrocells(const Columns *c, const Columns *next,
                                                                                  CtsRange *range)
{
    __m256i low = _mm256_min_epu16(c->low, _mm256_srli_epi64(c->low, 16));
    __m256i high = _mm256_max_epu16(c->high, _mm256_srli_epi64(c->high, 16));
    low = _mm256_min_epu16(low, _mm256_srli_epi64(low, 32));
    high = _mm256_max_epu16(high, _mm256_srli_epi64(high, 32));
    low = _mm256_min_epu16(low, four_on(c->low, next->low));
    high = _mm256_max_epu16(high, four_on(c->high, next->high));
    const __m256i both = _mm256_blend_epi16(low, _mm256_slli_epi64(high, 16), 0x22);
    const __m256i packed = _mm256_permutevar8x32_epi32(both, _mm256_setr_epi32(0, 2, 4, 6, 0, 2, 4, 6));
    const __m128i made = _mm256_castsi256_si128(packed), old = _mm_loadu_si128((const void *)range);
    _mm_storeu_si128((void *)range, _mm_blend_epi16(_mm_min_epu16(made, old), _mm_max_epu16(made, old), 0xAA));
}

__attribute__((target("avx2"), always_inline)) static inline int
fold_rows(const uint16_t *row, size_t row_stride, int n_rows, int n, CtsRange *range, int n_macrocells)
{
    enum { COLUMNS = 16, MACROCELLS = COLUMNS / CTS_FINE_MACROCELL };
    int done = 0;
    if (n < COLUMNS)
        return done;
    Columns c = fold_columns(row, row_stride, n_rows);
    for (; done + MACROCELLS <= n_macrocells && CTS_FINE_MACROCELL * done + 2 * COLUMNS <= n; done += MACROCELLS) {
        const Columns next = fold_columns(row + CTS_FINE_MACROCELL * done + COLUMNS, row_stride, n_rows);
        fold_macrocells(&c, &next, range + done);
        c = next;
    }
    /* A row of whole vectors, as most are, ends here: there is no next column to change anything. */
    if (done + MACROCELLS == n_macrocells && CTS_FINE_MACROCELL * done + COLUMNS == n) {
        const Columns nothing = {_mm256_set1_epi16(-1), _mm256_setzero_si256()};
        fold_macrocells(&c, &nothing, range + done);
        done = n_macrocells;
    }
    return done;
}

__attribute__((target("avx2"))) static void fold_avx2(const uint16_t *row, size_t row_stride, int n_rows, int n,
                                                      CtsRange *range, int n_macrocells)
{
    /* Nearly all have five rows, for which the loop over them is written out. */
    const int done = n_rows == REACH ? fold_rows(row, row_stride, REACH, n, range, n_macrocells)
                                     : fold_rows(row, row_stride, n_rows, n, range, n_macrocells);
    const int columns = done * CTS_FINE_MACROCELL;
    if (done < n_macrocells)
        cts_fold_plain(row + columns, row_stride, n_rows, n - columns, range + done, n_macrocells - done);
}
#endif

cts_fold_fn cts_fold(unsigned cpu)
{
#if defined(__x86_64__)
    if (cpu & CTS_CPU_AVX2)
        return fold_avx2;
#endif
    (void)cpu;
    return cts_fold_plain;
}
