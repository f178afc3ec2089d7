/* AVX2 primitives for the tiled engine's march. Compiled with -mavx2; called only where the processor has it. */
#include "splat/tiled_kernel.h"

#if defined(__AVX2__)

#include "base/mutation.h"
#include "splat/tiled_taps.h"
#include <immintrin.h>
#include <math.h>

INLINE v8f v8f_min(v8f a, v8f b)
{
    return (v8f)_mm256_min_ps((__m256)a, (__m256)b);
}

INLINE v8f v8f_max(v8f a, v8f b)
{
    return (v8f)_mm256_max_ps((__m256)a, (__m256)b);
}

INLINE v8i v8i_min(v8i a, v8i b)
{
    return (v8i)_mm256_min_epi32((__m256i)a, (__m256i)b);
}

INLINE v8i v8i_max(v8i a, v8i b)
{
    return (v8i)_mm256_max_epi32((__m256i)a, (__m256i)b);
}

INLINE v8f v8f_sqrt(v8f a)
{
    return (v8f)_mm256_sqrt_ps((__m256)a);
}

INLINE bool v8_any(v8i mask)
{
    return _mm256_movemask_ps((__m256)mask) != 0;
}

INLINE bool v8_all(v8i mask)
{
    return _mm256_movemask_ps((__m256)mask) == 255;
}

INLINE __m256i two_entries(const int32_t (*rows)[4], int low, int high)
{
    const __m256i one = _mm256_castsi128_si256(_mm_load_si128((const __m128i *)rows[low]));
    return _mm256_inserti128_si256(one, _mm_load_si128((const __m128i *)rows[high]), 1);
}

/* Rows index, clamped to 0..last: one 128-bit load a pixel, then a transpose. */
INLINE void lookup8(const int32_t (*rows)[4], int last, v8i index, v8i *r, v8i *g, v8i *b, v8i *k)
{
    const __m256i most = _mm256_set1_epi32(last);
    const __m256i clamped = _mm256_min_epi32(_mm256_max_epi32((__m256i)index, _mm256_setzero_si256()), most);
    const v8i i = (v8i)clamped;
    const __m256i e04 = two_entries(rows, i[0], i[4]), e15 = two_entries(rows, i[1], i[5]);
    const __m256i e26 = two_entries(rows, i[2], i[6]), e37 = two_entries(rows, i[3], i[7]);
    const __m256i rg01 = _mm256_unpacklo_epi32(e04, e15), bk01 = _mm256_unpackhi_epi32(e04, e15);
    const __m256i rg23 = _mm256_unpacklo_epi32(e26, e37), bk23 = _mm256_unpackhi_epi32(e26, e37);
    *r = (v8i)_mm256_unpacklo_epi64(rg01, rg23);
    *g = (v8i)_mm256_unpackhi_epi64(rg01, rg23);
    *b = (v8i)_mm256_unpacklo_epi64(bk01, bk23);
    *k = (v8i)_mm256_unpackhi_epi64(bk01, bk23);
}

/* facing to the power of the preset, from shade's table. */
INLINE v8f shade_power(const CtsShade *shade, v8f facing)
{
    const v8f at = facing * (float)shade->n_power;
    const v8i i = v8i_min(__builtin_convertvector(at, v8i), (v8i)_mm256_set1_epi32(shade->n_power - 1));
    const v8f low = (v8f)_mm256_i32gather_ps(shade->power, (__m256i)i, 4);
    const v8f high = (v8f)_mm256_i32gather_ps(shade->power + 1, (__m256i)i, 4);
    return low + (high - low) * (at - __builtin_convertvector(i, v8f));
}

/* Control bytes that fetch the voxels of columns x0 and x0 + 1. */
INLINE v8i make_pick(v8i x0)
{
    return x0 * 0x02020202 + 0x03020100;
}

INLINE __m256i window_row(const Taps *t, ptrdiff_t offset)
{
    const __m256i low = _mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)(t->at[0] + offset)));
    return _mm256_inserti128_si256(low, _mm_loadu_si128((const __m128i *)(t->at[1] + offset)), 1);
}

/* The pairs of voxels x0, x0 + 1 of three rows by byte shuffle instead of a gather. */
INLINE v8f load_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    const __m256i pick = (__m256i)t->pick;
    const __m256i bias = _mm256_set1_epi32((int)0x80008000);
    const __m256i p0 = _mm256_shuffle_epi8(window_row(t, offset), pick);
    const __m256i p1 = _mm256_shuffle_epi8(window_row(t, offset + row_stride), pick);
    const __m256i p2 = _mm256_shuffle_epi8(window_row(t, offset + 2 * row_stride), pick);
    const __m256i upper = _mm256_blendv_epi8(p0, p1, (__m256i)t->row1);
    const __m256i lower = _mm256_blendv_epi8(p1, p2, (__m256i)t->row1);
    const v8f a = (v8f)_mm256_cvtepi32_ps(_mm256_madd_epi16(_mm256_xor_si256(upper, bias), (__m256i)t->weights));
    const v8f b = (v8f)_mm256_cvtepi32_ps(_mm256_madd_epi16(_mm256_xor_si256(lower, bias), (__m256i)t->weights));
    return (a + t->fy * (b - a)) * (1.0f / 16384) + 32768.0f;
}

#include "splat/tiled_tmpl.h"

void tiled_packet_avx2(const TiledJob *job, TiledBeam *beam, int x, int y, int n, TiledCounts *counts)
{
    run_packet(job, beam, x, y, n, counts);
}

#else

void tiled_packet_avx2(const TiledJob *job, TiledBeam *beam, int x, int y, int n, TiledCounts *counts)
{
    tiled_packet_c(job, beam, x, y, n, counts);
}

#endif
