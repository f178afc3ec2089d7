#include "volume/bits.h"

#include "base/mem.h"
#include <string.h>

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

/* 64 comparisons as bytes, which compilers vectorise, then 8 bytes at a time into 8 bits. */
static uint64_t threshold_word(const uint16_t *grey, uint16_t grey_min)
{
    uint8_t at_least[64];
    for (int i = 0; i < 64; i++)
        at_least[i] = grey[i] >= grey_min;
    uint64_t word = 0;
    for (int i = 0; i < 8; i++) {
        uint64_t bytes = 0;
        for (int b = 0; b < 8; b++)
            bytes |= (uint64_t)at_least[8 * i + b] << (8 * b);
        word |= (bytes * UINT64_C(0x0102040810204080)) >> 56 << (8 * i);
    }
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

void cts_bits_threshold(CtsBits *bits, const uint16_t *grey, uint16_t grey_min, int n_threads)
{
    const size_t nx = (size_t)bits->dims[0], ny = (size_t)bits->dims[1];
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int k = 0; k < bits->dims[2]; k++)
        for (int j = 0; j < bits->dims[1]; j++)
            cts_bits_threshold_row(cts_bits_row(bits, j, k), grey + ((size_t)k * ny + (size_t)j) * nx, bits->dims[0],
                                   grey_min);
}

/* Words of a slice that are spread at a time. */
enum { BLOCK = 256 };

/* Add words of a slice shifted by whole rows: sum[n] |= slice[from + n + shift] where that lies within the slice. */
static void add_shifted(uint64_t *restrict sum, const uint64_t *restrict slice, ptrdiff_t from, ptrdiff_t n_sum,
                        ptrdiff_t shift, ptrdiff_t n_slice)
{
    const ptrdiff_t first = -(from + shift) > 0 ? -(from + shift) : 0;
    const ptrdiff_t end = n_slice - from - shift < n_sum ? n_slice - from - shift : n_sum;
    for (ptrdiff_t n = first; n < end; n++)
        sum[n] |= slice[from + n + shift];
}

/* All neighbouring rows and slices of a block; the word itself is left to the caller. */
static void add_neighbours(const CtsBits *in, int k, CtsNeighbours neighbours, unsigned axes, ptrdiff_t from,
                           ptrdiff_t n_sum, uint64_t *sum)
{
    const ptrdiff_t row = (ptrdiff_t)in->row_words, n_slice = row * in->dims[1];
    for (int dk = -1; dk <= 1; dk++) {
        if (k + dk < 0 || k + dk >= in->dims[2] || (dk && !(axes & 4)))
            continue;
        for (int dj = -1; dj <= 1; dj++)
            if ((dj || dk) && (!dj || axes & 2) && !(dj && dk && neighbours == CTS_CROSS))
                add_shifted(sum, cts_bits_row(in, 0, k + dk), from, n_sum, dj * row, n_slice);
    }
}

/* The words from <= n < from + n_block of slice k. The box spreads the sum of all rows along x, the cross only its own.
 */
static void dilate_block(const CtsBits *in, CtsBits *out, int k, CtsNeighbours neighbours, unsigned axes,
                         ptrdiff_t from, ptrdiff_t n_block)
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

static void dilate_slice_rows(const CtsBits *in, CtsBits *out, int k, CtsNeighbours neighbours, unsigned axes,
                              int first, int end)
{
    const ptrdiff_t row = (ptrdiff_t)in->row_words, stop = row * end;
    for (ptrdiff_t from = row * first; from < stop; from += BLOCK)
        dilate_block(in, out, k, neighbours, axes, from, stop - from < BLOCK ? stop - from : BLOCK);
    for (int j = first; j < end; j++)
        cts_bits_row(out, j, k)[row - 1] &= cts_bits_mask(in, in->row_words - 1);
}

void cts_bits_dilate(const CtsBits *in, CtsBits *out, CtsNeighbours neighbours, unsigned axes, int n_threads)
{
#pragma omp parallel for schedule(static) num_threads(n_threads) if (cts_bits_is_large(in))
    for (int k = 0; k < in->dims[2]; k++)
        dilate_slice_rows(in, out, k, neighbours, axes, 0, in->dims[1]);
}

void cts_bits_dilate_rows(const CtsBits *in, CtsBits *out, CtsNeighbours neighbours, int first, int end)
{
    dilate_slice_rows(in, out, 0, neighbours, CTS_AXES_SLICE, first, end);
}

void cts_bits_combine(CtsBits *a, CtsBitsOp op, const CtsBits *b)
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

uint64_t cts_bits_count(const CtsBits *bits)
{
    uint64_t count = 0;
    for (size_t w = 0; w < cts_bits_n_words(bits); w++)
        count += (uint64_t)cts_popcount(bits->words[w]);
    return count;
}
