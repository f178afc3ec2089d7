/* One bit a voxel: shapes, small enough to be swept many times. */
#pragma once

#include "ctsplat/status.h"
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Voxel (i, j, k) is bit i % 64 of words[(k * dims[1] + j) * row_words + i / 64]. At least one bit of a row is spare;
 * spare bits stay 0, so that shifts and sums do not carry into the next row. */
typedef struct CtsBits {
    int dims[3];
    size_t row_words;
    uint64_t *words;
} CtsBits;

enum { CTS_BITS_ROW_WORDS = 1025 }; /* at most, 65599 voxels a row */

/* All bits 0. A zero-initialised CtsBits may be freed. */
CtsStatus cts_bits_new(CtsBits *bits, const int dims[3], CtsError *err);
/* Without initialisation, for callers that write every word before reading any. */
CtsStatus cts_bits_new_unset(CtsBits *bits, const int dims[3], CtsError *err);
void cts_bits_free(CtsBits *bits);

static inline size_t cts_bits_n_words(const CtsBits *bits)
{
    return bits->row_words * (size_t)bits->dims[1] * (size_t)bits->dims[2];
}

static inline uint64_t *cts_bits_row(const CtsBits *bits, int j, int k)
{
    return bits->words + ((size_t)k * (size_t)bits->dims[1] + (size_t)j) * bits->row_words;
}

/* Slice k as bits of its own, sharing the words. */
static inline CtsBits cts_bits_slice(const CtsBits *bits, int k)
{
    return (CtsBits){{bits->dims[0], bits->dims[1], 1}, bits->row_words, cts_bits_row(bits, 0, k)};
}

static inline bool cts_bits_get(const CtsBits *bits, int i, int j, int k)
{
    return cts_bits_row(bits, j, k)[i >> 6] >> (i & 63) & 1;
}

static inline void cts_bits_set(const CtsBits *bits, int i, int j, int k)
{
    cts_bits_row(bits, j, k)[i >> 6] |= UINT64_C(1) << (i & 63);
}

/* The bits of word w of a row that lie inside the volume. */
static inline uint64_t cts_bits_mask(const CtsBits *bits, size_t w)
{
    return w + 1 < bits->row_words ? ~UINT64_C(0) : (UINT64_C(1) << (bits->dims[0] & 63)) - 1;
}

/* Written out because the processor that this is compiled for may have no instruction for it. */
static inline int cts_popcount(uint64_t x)
{
    x -= x >> 1 & UINT64_C(0x5555555555555555);
    x = (x & UINT64_C(0x3333333333333333)) + (x >> 2 & UINT64_C(0x3333333333333333));
    x = (x + (x >> 4)) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    return (int)(x * UINT64_C(0x0101010101010101) >> 56);
}

/* Set the bits first <= i < end of one row. */
void cts_bits_fill(uint64_t *row, int first, int end);

/* Number of set bits first <= i < end of one row; first < end. */
uint64_t cts_bits_count_run(const uint64_t *row, int first, int end);

/* Number of runs of set bits in a row of n_words. */
static inline uint32_t cts_bits_count_runs(const uint64_t *row, size_t n_words)
{
    uint32_t n = 0;
    for (size_t w = 0; w < n_words; w++) {
        const uint64_t starts = row[w] & ~(row[w] << 1 | (w ? row[w - 1] >> 63 : 0));
        if (starts) /* most words start no run */
            n += (uint32_t)cts_popcount(starts);
    }
    return n;
}

/* Voxels lo[] to hi[], inclusive; lo above hi: none. */
typedef struct CtsVoxelBox {
    int lo[3], hi[3];
} CtsVoxelBox;
#define CTS_NO_VOXELS ((CtsVoxelBox){{INT_MAX, INT_MAX, INT_MAX}, {-1, -1, -1}})

/* Makes the box hold voxels first to last of row (j, k), too. */
static inline void cts_voxel_box_grow(CtsVoxelBox *box, int first, int last, int j, int k)
{
    const int at[3][2] = {{first, last}, {j, j}, {k, k}};
    for (int axis = 0; axis < 3; axis++) {
        box->lo[axis] = at[axis][0] < box->lo[axis] ? at[axis][0] : box->lo[axis];
        box->hi[axis] = at[axis][1] > box->hi[axis] ? at[axis][1] : box->hi[axis];
    }
}

/* The box of the voxels that are set, or with `unset` of those that are not. */
CtsVoxelBox cts_bits_box(const CtsBits *bits, bool unset);

typedef enum CtsBitsOp { CTS_BITS_AND, CTS_BITS_AND_NOT, CTS_BITS_OR, CTS_BITS_NOT } CtsBitsOp;
/* a = a op b, word by word; CTS_BITS_NOT uses b alone. */
void cts_bits_combine(CtsBits *a, CtsBitsOp op, const CtsBits *b);
bool cts_bits_any(const CtsBits *bits);
uint64_t cts_bits_count(const CtsBits *bits);
/* Number of bits set in both, which have the same dimensions. */
uint64_t cts_bits_count_common(const CtsBits *a, const CtsBits *b);
