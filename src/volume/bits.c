#include "volume/bits.h"

#include "base/cpu.h"
#include "base/mem.h"
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

CtsStatus cts_bits_new(CtsBits *bits, const int dims[3], CtsError *err)
{
    *bits = (CtsBits){.dims = {dims[0], dims[1], dims[2]}, .row_words = (size_t)dims[0] / 64 + 1};
    size_t n;
    if (bits->row_words > CTS_BITS_ROW_WORDS)
        return cts_fail(err, CTS_ERR_MEMORY, "rows of %d voxels are too long for a mask", dims[0]);
    if (cts_mul_overflows((size_t)dims[1] * (size_t)dims[2], bits->row_words, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a mask of %d x %d x %d voxels is too large", dims[0], dims[1], dims[2]);
    return cts_alloc_zeroed(&bits->words, n, err);
}

CtsStatus cts_bits_copy(CtsBits *bits, const CtsBits *of, CtsError *err)
{
    const CtsStatus st = cts_bits_new(bits, of->dims, err);
    if (!st)
        cts_bits_combine(bits, CTS_BITS_COPY, of);
    return st;
}

void cts_bits_free(CtsBits *bits)
{
    cts_free(&bits->words);
}

void cts_bits_fill(uint64_t *row, int first, int end)
{
    if (first >= end)
        return;
    const int w0 = first >> 6, w1 = (end - 1) >> 6;
    const uint64_t from = ~UINT64_C(0) << (first & 63), to = ~UINT64_C(0) >> (63 - ((end - 1) & 63));
    if (w0 == w1) {
        row[w0] |= from & to;
        return;
    }
    row[w0] |= from;
    for (int w = w0 + 1; w < w1; w++)
        row[w] = ~UINT64_C(0);
    row[w1] |= to;
}

uint64_t cts_bits_count_run(const uint64_t *row, int first, int end)
{
    const int w0 = first >> 6, w1 = (end - 1) >> 6;
    const uint64_t from = ~UINT64_C(0) << (first & 63), to = ~UINT64_C(0) >> (63 - ((end - 1) & 63));
    if (w0 == w1)
        return (uint64_t)cts_popcount(row[w0] & from & to);
    uint64_t n = (uint64_t)cts_popcount(row[w0] & from) + (uint64_t)cts_popcount(row[w1] & to);
    for (int w = w0 + 1; w < w1; w++)
        n += (uint64_t)cts_popcount(row[w]);
    return n;
}

/* 8 comparisons as 8 bits. SSE2 is part of every x86-64. */
static inline uint64_t threshold_byte(const uint16_t *grey, uint16_t grey_min)
{
#if defined(__SSE2__)
    __m128i levels, zero = _mm_setzero_si128();
    memcpy(&levels, grey, sizeof levels);
    const __m128i missing = _mm_subs_epu16(_mm_set1_epi16((short)grey_min), levels);
    return (uint64_t)_mm_movemask_epi8(_mm_packs_epi16(_mm_cmpeq_epi16(missing, zero), zero));
#else
    uint64_t byte = 0;
    for (int i = 0; i < 8; i++)
        byte |= (uint64_t)(grey[i] >= grey_min) << i;
    return byte;
#endif
}

static inline uint64_t threshold_word(const uint16_t *grey, uint16_t grey_min)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++)
        word |= threshold_byte(grey + 8 * i, grey_min) << (8 * i);
    return word;
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

/* Bits of one word that the blocks over it decide, and those of them that are set. */
typedef struct Known {
    uint64_t bits, set;
} Known;

enum { PER_WORD = 64 / CTS_FINE_BLOCK, ROW_BLOCKS = CTS_BITS_ROW_WORDS * PER_WORD };

/* What the n fine blocks of a row say, word by word; a voxel behind the last block belongs to it. */
CTS_VECTOR_CLONES static void look_at_blocks(const CtsRange *range, int n, uint16_t min, Known *known, size_t n_words)
{
    uint8_t all[ROW_BLOCKS], some[ROW_BLOCKS];
    for (int b = 0; b < n; b++) {
        all[b] = range[b].low >= min;
        some[b] = range[b].high >= min;
    }
    for (int b = n; b < (int)n_words * PER_WORD; b++) {
        all[b] = all[n - 1];
        some[b] = some[n - 1];
    }
    const uint64_t block = (UINT64_C(1) << CTS_FINE_BLOCK) - 1;
    for (size_t w = 0; w < n_words; w++) {
        uint64_t set = 0, open = 0;
        for (int b = 0; b < PER_WORD; b++) {
            const size_t at = w * PER_WORD + (size_t)b;
            set |= (uint64_t)all[at] << (b * CTS_FINE_BLOCK);
            open |= (uint64_t)(some[at] & !all[at]) << (b * CTS_FINE_BLOCK);
        }
        known[w] = (Known){~(open * block), set * block};
    }
}

static void threshold_open(uint64_t *row, const uint16_t *levels, int n, uint16_t min, const Known *known)
{
    for (int w = 0; w < n / 64; w++) {
        row[w] = known[w].set;
        for (uint64_t open = ~known[w].bits, byte; open; open &= ~byte) {
            const int at = __builtin_ctzll(open) / 8 * 8;
            byte = UINT64_C(0xFF) << at;
            row[w] = (row[w] & ~byte) | threshold_byte(levels + 64 * w + at, min) << at;
        }
    }
    if (n % 64)
        cts_bits_threshold_row(row + n / 64, levels + n / 64 * 64, n % 64, min);
}

/* Rows j0 <= j < j1 of slices k0 <= k < k1: those of one row of fine blocks. */
typedef struct Beam {
    int j0, j1, k0, k1;
} Beam;

/* The last block of an axis has the voxel behind it, too. */
static int block_end(int block, int n_blocks, int n)
{
    return block + 1 < n_blocks ? (block + 1) * CTS_FINE_BLOCK : n;
}

/* What is read is scattered; asking for it one row of blocks ahead hides the time that memory takes. */
static void ask_for_open(const CtsBits *bits, const uint16_t *grey, const Beam *beam, const Known *known)
{
    enum { PER_LINE = 32 }; /* levels of a cache line */
    const size_t nx = (size_t)bits->dims[0], ny = (size_t)bits->dims[1];
    for (size_t at = 0; at < nx; at += PER_LINE) {
        if (!(uint32_t)(~known[at / 64].bits >> at % 64))
            continue;
        for (int k = beam->k0; k < beam->k1; k++)
            for (int j = beam->j0; j < beam->j1; j++)
                __builtin_prefetch(grey + ((size_t)k * ny + (size_t)j) * nx + at);
    }
}

static void threshold_beam(CtsBits *bits, const uint16_t *grey, const Beam *beam, uint16_t min, const Known *known)
{
    const size_t nx = (size_t)bits->dims[0], ny = (size_t)bits->dims[1];
    for (int k = beam->k0; k < beam->k1; k++)
        for (int j = beam->j0; j < beam->j1; j++)
            threshold_open(cts_bits_row(bits, j, k), grey + ((size_t)k * ny + (size_t)j) * nx, bits->dims[0], min,
                           known);
}

static void threshold_layer(CtsBits *bits, const uint16_t *grey, const CtsBlocks *blocks, int bk, uint16_t min)
{
    const int *n = blocks->n_fine;
    Known known[2][CTS_BITS_ROW_WORDS];
    Beam beam[2];
    for (int bj = 0; bj <= n[1]; bj++) {
        const int ahead = bj % 2, now = !ahead;
        if (bj < n[1]) {
            beam[ahead] = (Beam){bj * CTS_FINE_BLOCK, block_end(bj, n[1], bits->dims[1]), bk * CTS_FINE_BLOCK,
                                 block_end(bk, n[2], bits->dims[2])};
            look_at_blocks(blocks->fine + ((size_t)bk * (size_t)n[1] + (size_t)bj) * (size_t)n[0], n[0], min,
                           known[ahead], bits->row_words);
            ask_for_open(bits, grey, &beam[ahead], known[ahead]);
        }
        if (bj)
            threshold_beam(bits, grey, &beam[now], min, known[now]);
    }
}

void cts_bits_threshold(CtsBits *bits, const uint16_t *grey, const CtsBlocks *blocks, uint16_t grey_min, int n_threads)
{
    const size_t nx = (size_t)bits->dims[0], ny = (size_t)bits->dims[1];
    if (!blocks) {
#pragma omp parallel for schedule(static) num_threads(n_threads)
        for (int k = 0; k < bits->dims[2]; k++)
            for (int j = 0; j < bits->dims[1]; j++)
                cts_bits_threshold_row(cts_bits_row(bits, j, k), grey + ((size_t)k * ny + (size_t)j) * nx,
                                       bits->dims[0], grey_min);
        return;
    }
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (int bk = 0; bk < blocks->n_fine[2]; bk++)
        threshold_layer(bits, grey, blocks, bk, grey_min);
}

/* Words of a slice that are spread at a time. */
enum { BLOCK = 256 };

/* Add words of a slice shifted by whole rows: sum[n] |= slice[from + n + shift] where that lies within the slice. */
static inline __attribute__((always_inline)) void add_shifted(uint64_t *restrict sum, const uint64_t *restrict slice,
                                                              ptrdiff_t from, ptrdiff_t n_sum, ptrdiff_t shift,
                                                              ptrdiff_t n_slice)
{
    const ptrdiff_t first = -(from + shift) > 0 ? -(from + shift) : 0;
    const ptrdiff_t end = n_slice - from - shift < n_sum ? n_slice - from - shift : n_sum;
    for (ptrdiff_t n = first; n < end; n++)
        sum[n] |= slice[from + n + shift];
}

/* The rows before and behind, and the row itself where that is wanted, at the edges of the slice. */
static inline __attribute__((always_inline)) void add_rows_at_edge(uint64_t *restrict sum,
                                                                   const uint64_t *restrict slice, ptrdiff_t from,
                                                                   ptrdiff_t n_sum, ptrdiff_t row, ptrdiff_t n_slice,
                                                                   bool with_own)
{
    add_shifted(sum, slice, from, n_sum, -row, n_slice);
    add_shifted(sum, slice, from, n_sum, row, n_slice);
    if (with_own)
        add_shifted(sum, slice, from, n_sum, 0, n_slice);
}

/* The same, in one go where both rows lie within the slice. */
static inline __attribute__((always_inline)) void add_rows(uint64_t *restrict sum, const uint64_t *restrict slice,
                                                           ptrdiff_t from, ptrdiff_t n_sum, ptrdiff_t row,
                                                           ptrdiff_t n_slice, bool with_own)
{
    const ptrdiff_t last = n_slice - from - row;
    const ptrdiff_t first = row > from ? row - from : 0, end = last < n_sum ? last : n_sum;
    if (first >= end) {
        add_rows_at_edge(sum, slice, from, n_sum, row, n_slice, with_own);
        return;
    }
    add_rows_at_edge(sum, slice, from, first, row, n_slice, with_own);
    if (with_own)
        for (ptrdiff_t n = first; n < end; n++)
            sum[n] |= slice[from + n - row] | slice[from + n] | slice[from + n + row];
    else
        for (ptrdiff_t n = first; n < end; n++)
            sum[n] |= slice[from + n - row] | slice[from + n + row];
    add_rows_at_edge(sum + end, slice, from + end, n_sum - end, row, n_slice, with_own);
}

/* All neighbouring rows and slices of a block; the word itself is left to the caller. */
static inline __attribute__((always_inline)) void add_neighbours(const CtsBits *in, int k, CtsNeighbours neighbours,
                                                                 unsigned axes, ptrdiff_t from, ptrdiff_t n_sum,
                                                                 uint64_t *sum)
{
    const ptrdiff_t row = (ptrdiff_t)in->row_words, n_slice = row * in->dims[1];
    for (int dk = -1; dk <= 1; dk++) {
        if (k + dk < 0 || k + dk >= in->dims[2] || (dk && !(axes & 4)))
            continue;
        const uint64_t *slice = cts_bits_row(in, 0, k + dk);
        if (axes & 2 && !(dk && neighbours == CTS_CROSS))
            add_rows(sum, slice, from, n_sum, row, n_slice, dk != 0);
        else if (dk)
            add_shifted(sum, slice, from, n_sum, 0, n_slice);
    }
}

/* The words from <= n < from + n_block of slice k. The box spreads the sum of all rows along x, the cross only its own.
 */
static inline __attribute__((always_inline)) void dilate_block(const CtsBits *in, CtsBits *out, int k,
                                                               CtsNeighbours neighbours, unsigned axes, ptrdiff_t from,
                                                               ptrdiff_t n_block)
{
    uint64_t sum[BLOCK + 2] = {0}, *restrict to = cts_bits_row(out, 0, k) + from;
    const ptrdiff_t n_slice = (ptrdiff_t)in->row_words * in->dims[1];
    add_shifted(sum, cts_bits_row(in, 0, k), from - 1, n_block + 2, 0, n_slice);
    if (neighbours == CTS_BOX)
        add_neighbours(in, k, neighbours, axes, from - 1, n_block + 2, sum);
    if (axes & 1)
        for (ptrdiff_t n = 0; n < n_block; n++)
            to[n] = sum[n + 1] | sum[n + 1] << 1 | sum[n + 1] >> 1 | sum[n] >> 63 | sum[n + 2] << 63;
    else
        for (ptrdiff_t n = 0; n < n_block; n++)
            to[n] = sum[n + 1];
    if (neighbours == CTS_CROSS)
        add_neighbours(in, k, neighbours, axes, from, n_block, to);
}

static inline __attribute__((always_inline)) void mask_last_words(const CtsBits *in, CtsBits *out, int k, int first,
                                                                  int end)
{
    for (int j = first; j < end; j++)
        cts_bits_row(out, j, k)[in->row_words - 1] &= cts_bits_mask(in, in->row_words - 1);
}

CTS_VECTOR_CLONES static void dilate_slice(const CtsBits *in, CtsBits *out, int k, CtsNeighbours neighbours,
                                           unsigned axes)
{
    const ptrdiff_t stop = (ptrdiff_t)in->row_words * in->dims[1];
    for (ptrdiff_t from = 0; from < stop; from += BLOCK)
        dilate_block(in, out, k, neighbours, axes, from, stop - from < BLOCK ? stop - from : BLOCK);
    mask_last_words(in, out, k, 0, in->dims[1]);
}

void cts_bits_dilate(const CtsBits *in, CtsBits *out, CtsNeighbours neighbours, unsigned axes, int n_threads)
{
#pragma omp parallel for schedule(static) num_threads(n_threads) if (cts_bits_is_large(in))
    for (int k = 0; k < in->dims[2]; k++)
        dilate_slice(in, out, k, neighbours, axes);
}

CTS_VECTOR_CLONES void cts_bits_combine(CtsBits *a, CtsBitsOp op, const CtsBits *b)
{
    const size_t n = cts_bits_n_words(a);
    switch (op) {
    case CTS_BITS_AND:
        for (size_t w = 0; w < n; w++)
            a->words[w] &= b->words[w];
        break;
    case CTS_BITS_AND_NOT:
        for (size_t w = 0; w < n; w++)
            a->words[w] &= ~b->words[w];
        break;
    case CTS_BITS_OR:
        for (size_t w = 0; w < n; w++)
            a->words[w] |= b->words[w];
        break;
    case CTS_BITS_COPY:
        memcpy(a->words, b->words, n * sizeof *a->words);
        break;
    case CTS_BITS_NOT:
        for (size_t w = 0; w < n; w++)
            a->words[w] = ~b->words[w];
        for (size_t w = a->row_words - 1; w < n; w += a->row_words)
            a->words[w] &= cts_bits_mask(a, a->row_words - 1);
        break;
    }
}

CTS_VECTOR_CLONES static uint64_t count_words(const uint64_t *words, size_t n)
{
    uint64_t count = 0;
    for (size_t w = 0; w < n; w++)
        count += (uint64_t)cts_popcount(words[w]);
    return count;
}

void cts_bits_take_slice(CtsBits *a, const CtsBits *b, int k)
{
    const size_t n = a->row_words * (size_t)a->dims[1];
    uint64_t *words = cts_bits_row(a, 0, k);
    const uint64_t *taken = cts_bits_row(b, 0, k);
    for (size_t w = 0; w < n; w++)
        words[w] &= ~taken[w];
}

uint64_t cts_bits_count_slice(const CtsBits *bits, int k)
{
    return count_words(cts_bits_row(bits, 0, k), bits->row_words * (size_t)bits->dims[1]);
}

uint64_t cts_bits_count(const CtsBits *bits)
{
    return count_words(bits->words, cts_bits_n_words(bits));
}

bool cts_bits_is_empty(const CtsBits *bits)
{
    const size_t n = cts_bits_n_words(bits);
    for (size_t w = 0; w < n; w++)
        if (bits->words[w])
            return false;
    return true;
}
