/* AVX2 primitives for the tiled engine's march. Compiled with -mavx2; called only where the processor has it. */
#include "engine/tiled/march.h"

#if defined(__AVX2__) && defined(__FMA__)

#include "base/mutation.h"
#include <immintrin.h>
#include <math.h>

#define LANES 8
#include "engine/tiled/mask_tmpl.h"

INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm256_min_ps((__m256)a, (__m256)b);
}

INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm256_max_ps((__m256)a, (__m256)b);
}

INLINE vi vi_min(vi a, vi b)
{
    return (vi)_mm256_min_epi32((__m256i)a, (__m256i)b);
}

INLINE vi vi_max(vi a, vi b)
{
    return (vi)_mm256_max_epi32((__m256i)a, (__m256i)b);
}

INLINE vs vs_min(vs a, vs b)
{
    return (vs)_mm_min_epi16((__m128i)a, (__m128i)b);
}

INLINE vs vs_max(vs a, vs b)
{
    return (vs)_mm_max_epi16((__m128i)a, (__m128i)b);
}

INLINE vf vf_fma(vf a, vf b, vf c)
{
    return (vf)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
}

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)mask);
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (vi)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)mask);
}

INLINE unsigned any_in(vmask mask)
{
    return _mm256_movemask_ps((__m256)mask) != 0;
}

INLINE unsigned all_in(vmask mask)
{
    return _mm256_movemask_ps((__m256)mask) == 255;
}

INLINE vi clamped(vi index, int last)
{
    return vi_min(vi_max(index, vi_of(0)), vi_of(last));
}

/* Of eight rows of four floats, each two side by side, the columns. */
INLINE void transpose_rows(__m256 e04, __m256 e15, __m256 e26, __m256 e37, vf column[4])
{
    const __m256d rg01 = _mm256_castps_pd(_mm256_unpacklo_ps(e04, e15)),
                  bk01 = _mm256_castps_pd(_mm256_unpackhi_ps(e04, e15));
    const __m256d rg23 = _mm256_castps_pd(_mm256_unpacklo_ps(e26, e37)),
                  bk23 = _mm256_castps_pd(_mm256_unpackhi_ps(e26, e37));
    column[0] = (vf)_mm256_unpacklo_pd(rg01, rg23);
    column[1] = (vf)_mm256_unpackhi_pd(rg01, rg23);
    column[2] = (vf)_mm256_unpacklo_pd(bk01, bk23);
    column[3] = (vf)_mm256_unpackhi_pd(bk01, bk23);
}

INLINE __m128 row_difference_of(const double *from, const double *to)
{
    return _mm256_cvtpd_ps(_mm256_sub_pd(_mm256_load_pd(to), _mm256_load_pd(from)));
}

INLINE __m256 two_differences(const double (*rows)[4], const int32_t *from, const int32_t *to, int lane)
{
    const __m256 one = _mm256_castps128_ps256(row_difference_of(rows[from[lane]], rows[to[lane]]));
    return _mm256_insertf128_ps(one, row_difference_of(rows[from[lane + 4]], rows[to[lane + 4]]), 1);
}

/* Rows `to` less rows `from`, both clamped to 0..last, subtracted as doubles. */
INLINE void look_up_difference(const double (*rows)[4], int last, vi from, vi to, vf d[4])
{
    int32_t a[LANES] __attribute__((aligned(32))), b[LANES] __attribute__((aligned(32)));
    _mm256_store_si256((__m256i *)a, (__m256i)clamped(from, last));
    _mm256_store_si256((__m256i *)b, (__m256i)clamped(to, last));
    transpose_rows(two_differences(rows, a, b, 0), two_differences(rows, a, b, 1), two_differences(rows, a, b, 2),
                   two_differences(rows, a, b, 3), d);
}

INLINE __m256 two_rows(const float (*rows)[4], const int32_t *at, int lane)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(rows[at[lane]])), _mm_load_ps(rows[at[lane + 4]]),
                                1);
}

/* Rows index, clamped to 0..last. */
INLINE void look_up_rows(const float (*rows)[4], int last, vi index, vf row[4])
{
    int32_t at[LANES] __attribute__((aligned(32)));
    _mm256_store_si256((__m256i *)at, (__m256i)clamped(index, last));
    transpose_rows(two_rows(rows, at, 0), two_rows(rows, at, 1), two_rows(rows, at, 2), two_rows(rows, at, 3), row);
}

INLINE __m128 two_pairs(const float (*rows)[2], const int32_t *at)
{
    const __m128 one = _mm_castpd_ps(_mm_load_sd((const double *)(const void *)rows[at[0]]));
    return _mm_loadh_pi(one, (const __m64 *)(const void *)rows[at[1]]);
}

/* Of lanes 0 and 1 of every four: a gather would take longer. */
INLINE __m256 four_pairs(const float (*rows)[2], const int32_t *at)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(two_pairs(rows, at)), two_pairs(rows, at + 4), 1);
}

INLINE void look_up_pairs(const float (*rows)[2], int last, vi index, vf pair[2])
{
    int32_t at[LANES] __attribute__((aligned(32)));
    _mm256_store_si256((__m256i *)at, (__m256i)clamped(index, last));
    const __m256 left = four_pairs(rows, at), right = four_pairs(rows, at + 2);
    pair[0] = (vf)_mm256_shuffle_ps(left, right, 0x88);
    pair[1] = (vf)_mm256_shuffle_ps(left, right, 0xdd);
}

/* facing to the power of the preset, from shade's table. */
INLINE vf shade_power(const CtsShade *shade, vf facing)
{
    const vf at = facing * (float)shade->n_power;
    const vi i = vi_min(__builtin_convertvector(at, vi), (vi)_mm256_set1_epi32(shade->n_power - 1));
    const vf low = (vf)_mm256_i32gather_ps(shade->power, (__m256i)i, 4);
    const vf high = (vf)_mm256_i32gather_ps(shade->power + 1, (__m256i)i, 4);
    return low + (high - low) * (at - __builtin_convertvector(i, vf));
}

/* Control bytes that fetch the voxels of columns x0 and x0 + 1. */
INLINE vi make_pick(vi x0)
{
    return x0 * 0x02020202 + 0x03020100;
}

#include "engine/tiled/taps_tmpl.h"

/* As in march_c.c. */
INLINE vi weigh_pairs(const uint16_t *layer, vi at, vi weights)
{
    const __m256i pairs = _mm256_i32gather_epi32((const int *)(const void *)layer, (__m256i)at, 2);
    return (vi)_mm256_madd_epi16(_mm256_xor_si256(pairs, _mm256_set1_epi32((int)0x80008000)), (__m256i)weights);
}

INLINE __m256i window_row(const Taps *t, ptrdiff_t offset)
{
    const __m256i low = _mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)(t->at[0] + offset)));
    return _mm256_inserti128_si256(low, _mm_loadu_si128((const __m128i *)(t->at[1] + offset)), 1);
}

/* The pairs of voxels x0, x0 + 1 of the upper and the lower of the lanes' rows, by byte shuffle instead of a gather. */
INLINE void pick_pairs(const Taps *t, const __m256i row[3], __m256i *upper, __m256i *lower)
{
    const __m256i pick = (__m256i)t->pick;
    const __m256i p0 = _mm256_shuffle_epi8(row[0], pick), p1 = _mm256_shuffle_epi8(row[1], pick);
    const __m256i p2 = _mm256_shuffle_epi8(row[2], pick);
    *upper = _mm256_blendv_epi8(p0, p1, (__m256i)t->row1);
    *lower = _mm256_blendv_epi8(p1, p2, (__m256i)t->row1);
}

/* Weighted sums of the pairs, in 2^-14, less 32768. */
INLINE void weigh_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride, __m256i *upper, __m256i *lower)
{
    const __m256i bias = _mm256_set1_epi32((int)0x80008000), weights = (__m256i)t->weights;
    const __m256i row[3] = {window_row(t, offset), window_row(t, offset + row_stride),
                            window_row(t, offset + 2 * row_stride)};
    pick_pairs(t, row, upper, lower);
    *upper = _mm256_madd_epi16(_mm256_xor_si256(*upper, bias), weights);
    *lower = _mm256_madd_epi16(_mm256_xor_si256(*lower, bias), weights);
}

INLINE vf load_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    __m256i upper, lower;
    weigh_window(t, offset, row_stride, &upper, &lower);
    const vf a = (vf)_mm256_cvtepi32_ps(upper), b = (vf)_mm256_cvtepi32_ps(lower);
    return vf_fma(vf_fma(t->fy, b - a, a), vf_of(1.0f / 16384), vf_of(32768));
}

INLINE vf of_rows(const Taps *t, __m256i upper, __m256i lower)
{
    const vf a = (vf)_mm256_cvtepi32_ps(upper), b = (vf)_mm256_cvtepi32_ps(lower);
    return a + t->fy * (b - a);
}

INLINE __m256i row_difference(const Taps *t, ptrdiff_t minus, ptrdiff_t plus)
{
    return _mm256_sub_epi16(window_row(t, plus), window_row(t, minus));
}

/* Differences that fit 16 bits: they are taken before they are picked. */
INLINE vf narrow_difference(const Taps *t, ptrdiff_t minus, ptrdiff_t plus, ptrdiff_t row_stride)
{
    const __m256i row[3] = {row_difference(t, minus, plus), row_difference(t, minus + row_stride, plus + row_stride),
                            row_difference(t, minus + 2 * row_stride, plus + 2 * row_stride)};
    __m256i upper, lower;
    pick_pairs(t, row, &upper, &lower);
    return of_rows(t, _mm256_madd_epi16(upper, (__m256i)t->weights), _mm256_madd_epi16(lower, (__m256i)t->weights));
}

INLINE vf wide_difference(const Taps *t, ptrdiff_t minus, ptrdiff_t plus, ptrdiff_t row_stride)
{
    __m256i upper, lower, upper_minus, lower_minus;
    weigh_window(t, plus, row_stride, &upper, &lower);
    weigh_window(t, minus, row_stride, &upper_minus, &lower_minus);
    return of_rows(t, _mm256_sub_epi32(upper, upper_minus), _mm256_sub_epi32(lower, lower_minus));
}

/* As in march_c.c. */
INLINE vf load_level(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    const __m256i bias = _mm256_set1_epi32(BIAS);
    __m256i upper, lower;
    weigh_window(t, offset, row_stride, &upper, &lower);
    return of_rows(t, _mm256_add_epi32(upper, bias), _mm256_add_epi32(lower, bias));
}

/* As in march_c.c. */
INLINE void load_differences(const Taps *t, const ptrdiff_t minus[3], const ptrdiff_t plus[3], ptrdiff_t row_stride,
                             bool narrow, vf d[3])
{
    if (narrow)
        for (int axis = 0; axis < 3; axis++)
            d[axis] = narrow_difference(t, minus[axis], plus[axis], row_stride);
    else
        for (int axis = 0; axis < 3; axis++)
            d[axis] = wide_difference(t, minus[axis], plus[axis], row_stride);
}

#include "engine/tiled/march_tmpl.h"

void cts_tiled_packets_avx2(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    run_packets(job, beam, spans, counts);
}

#else

void cts_tiled_packets_avx2(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    cts_tiled_packets_c(job, beam, spans, counts);
}

#endif
