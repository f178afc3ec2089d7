#include "base/bits.h"

#include "base/mem.h"

static CtsStatus new_bits(CtsBits *bits, const int dims[3], bool zeroed, CtsError *err)
{
    size_t n;
    *bits = (CtsBits){.dims = {dims[0], dims[1], dims[2]}, .row_words = (size_t)dims[0] / 64 + 1};
    if (bits->row_words > CTS_BITS_ROW_WORDS)
        return cts_fail(err, CTS_ERR_MEMORY, "rows of %d voxels are too long for a mask", dims[0]);
    if (cts_mul_overflows((size_t)dims[1] * (size_t)dims[2], bits->row_words, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a mask of %d x %d x %d voxels is too large", dims[0], dims[1], dims[2]);
    return zeroed ? cts_alloc_zeroed(&bits->words, n, err) : cts_alloc_array(&bits->words, n, err);
}

CtsStatus cts_bits_new(CtsBits *bits, const int dims[3], CtsError *err)
{
    return new_bits(bits, dims, true, err);
}

CtsStatus cts_bits_new_unset(CtsBits *bits, const int dims[3], CtsError *err)
{
    return new_bits(bits, dims, false, err);
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
    case CTS_BITS_NOT:
        for (size_t w = 0; w < n; w++)
            a->words[w] = ~b->words[w];
        for (size_t w = a->row_words - 1; w < n; w += a->row_words)
            a->words[w] &= cts_bits_mask(a, a->row_words - 1);
        break;
    }
}

CtsVoxelBox cts_bits_box(const CtsBits *bits, bool unset)
{
    CtsVoxelBox box = CTS_NO_VOXELS;
    for (int k = 0; k < bits->dims[2]; k++)
        for (int j = 0; j < bits->dims[1]; j++) {
            const uint64_t *const row = cts_bits_row(bits, j, k);
            int first = INT_MAX, last = -1;
            for (int w = 0; w < (int)bits->row_words; w++) {
                const uint64_t found = (unset ? ~row[w] : row[w]) & cts_bits_mask(bits, (size_t)w);
                if (!found)
                    continue;
                first = last < 0 ? 64 * w + __builtin_ctzll(found) : first;
                last = 64 * w + 63 - __builtin_clzll(found);
            }
            if (last >= 0)
                cts_voxel_box_grow(&box, first, last, j, k);
        }
    return box;
}

bool cts_bits_any(const CtsBits *bits)
{
    const size_t n = cts_bits_n_words(bits);
    size_t w = 0;
    while (w < n && !bits->words[w])
        w++;
    return w < n;
}

uint64_t cts_bits_count(const CtsBits *bits)
{
    return cts_bits_count_common(bits, bits);
}

uint64_t cts_bits_count_common(const CtsBits *a, const CtsBits *b)
{
    uint64_t count = 0;
    for (size_t w = 0; w < cts_bits_n_words(a); w++)
        count += (uint64_t)cts_popcount(a->words[w] & b->words[w]);
    return count;
}
