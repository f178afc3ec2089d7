/* Operations of base/simd.h with AVX-512 F, BW, DQ and VL. */
#include "base/simd_loads_tmpl.h"

typedef __mmask16 vmask;

SIMD_OP(vf, vf_select, (vmask mask, vf yes, vf no), (vf)_mm512_mask_blend_ps(mask, (__m512)no, (__m512)yes))
SIMD_OP(vi, vi_select, (vmask mask, vi yes, vi no), (vi)_mm512_mask_blend_epi32(mask, (__m512i)no, (__m512i)yes))
SIMD_OP(vmask, vf_lt, (vf a, vf b), _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LT_OQ))
SIMD_OP(vmask, vf_le, (vf a, vf b), _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ))
SIMD_OP(vmask, vi_lt, (vi a, vi b), _mm512_cmplt_epi32_mask((__m512i)a, (__m512i)b))
SIMD_OP(vmask, vi_eq, (vi a, vi b), _mm512_cmpeq_epi32_mask((__m512i)a, (__m512i)b))
SIMD_OP(vmask, vu_lt, (vi a, vi b), _mm512_cmplt_epu32_mask((__m512i)a, (__m512i)b))
SIMD_OP(vmask, vi_test, (vi a, vi b), _mm512_test_epi32_mask((__m512i)a, (__m512i)b))
SIMD_OP(vf, vf_min, (vf a, vf b), (vf)_mm512_min_ps((__m512)a, (__m512)b))
SIMD_OP(vf, vf_max, (vf a, vf b), (vf)_mm512_max_ps((__m512)a, (__m512)b))
SIMD_OP(vi, vi_min, (vi a, vi b), (vi)_mm512_min_epi32((__m512i)a, (__m512i)b))
SIMD_OP(vi, vi_max, (vi a, vi b), (vi)_mm512_max_epi32((__m512i)a, (__m512i)b))
SIMD_OP(vf, vf_sqrt, (vf a), (vf)_mm512_sqrt_ps((__m512)a))
SIMD_OP(bool, mask_any, (vmask mask), mask != 0)
SIMD_OP(unsigned, mask_bits, (vmask mask), mask)
SIMD_OP(vmask, mask_of_bits, (unsigned bits), (vmask)bits)

INLINE void vf_pack(float *to, vf from, vmask mask)
{
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps(mask, (__m512)from));
}

INLINE vf vf_look_up(const float *table, int n, vi index)
{
    if (n <= LANES)
        return (vf)_mm512_permutexvar_ps((__m512i)index, _mm512_loadu_ps(table));
    return (vf)_mm512_i32gather_ps((__m512i)index, table, 4);
}

SIMD_OP(vi, vi_load_shorts, (const int16_t *from), (vi)_mm512_cvtepi16_epi32(_mm256_loadu_si256((const void *)from)))
SIMD_OP(vi, vi_load_words, (const uint16_t *from), (vi)_mm512_cvtepu16_epi32(_mm256_loadu_si256((const void *)from)))

/* Gathers, not loads: one of 16 lanes of 32 bits takes no longer than one of eight, and the exact march, which gathers
 * for some lanes, takes 1.08 to 1.13 of the time with loads (measured). */
#define SIMD_GATHER(suffix, scale, bits)                                                                               \
    SIMD_OP(vi, vi_take##suffix, (const void *from, vi index),                                                         \
            (vi)_mm512_i32gather_epi32((__m512i)index, from, scale) & (bits))                                          \
    SIMD_OP(vi, vi_gather##suffix, (const void *from, vi index, vmask mask),                                           \
            (vi)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), mask, (__m512i)index, from, scale) & (bits))
SIMD_GATHER(, 4, -1)
SIMD_GATHER(_bytes, 1, 255)
SIMD_GATHER(_pairs, 2, -1)

INLINE __m512i of_halves(__m256i low, __m256i high)
{
    return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
}

INLINE vi vi_take_64(const void *from, vi index, ptrdiff_t scale, vi *second)
{
    const __m512i at = (__m512i)index;
    __m256i four[4];
    load_eight_64(from, _mm512_castsi512_si256(at), scale, four);
    load_eight_64(from, _mm512_extracti64x4_epi64(at, 1), scale, four + 2);
    const __m512i low = of_halves(four[0], four[1]), high = of_halves(four[2], four[3]);
    const vi even = {0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30};
    *second = (vi)_mm512_permutex2var_epi32(low, (__m512i)(even + 1), high);
    return (vi)_mm512_permutex2var_epi32(low, (__m512i)even, high);
}

SIMD_OP(vi, vs_madd, (vs a, vs b), (vi)_mm512_madd_epi16((__m512i)a, (__m512i)b))
SIMD_OP(vs, vs_unsigned_max, (vs a, vs b), (vs)_mm512_max_epu16((__m512i)a, (__m512i)b))
SIMD_OP(vs, vs_unsigned_min, (vs a, vs b), (vs)_mm512_min_epu16((__m512i)a, (__m512i)b))
SIMD_OP(vs, vs_excess, (vs a, vs b), (vs)_mm512_subs_epu16((__m512i)a, (__m512i)b))

SIMD_OP(vs, vs_mul_high, (vs a, vs b), (vs)_mm512_mulhi_epu16((__m512i)a, (__m512i)b))

INLINE ws ws_permute(ws table, ws index)
{
    return (ws){{(vs)_mm512_permutexvar_epi16((__m512i)index.part[0], (__m512i)table.part[0])}};
}

INLINE ws ws_permute2(ws low, ws high, ws index)
{
    return (ws){{(vs)_mm512_permutex2var_epi16((__m512i)low.part[0], (__m512i)index.part[0], (__m512i)high.part[0])}};
}

SIMD_OP(__m512i, add_row, (__m512i rows, __mmask16 lanes, const int16_t *from),
        _mm512_mask_broadcast_i32x4(rows, lanes, _mm_loadu_si128((const __m128i *)from)))

INLINE ws ws_load_rows(const int16_t *from, ptrdiff_t stride, int n)
{
    __m512i rows = _mm512_zextsi128_si512(_mm_loadu_si128((const __m128i *)from));
    if (n > 1)
        rows = add_row(rows, 0x00f0, from + stride);
    if (n > 2)
        rows = add_row(rows, 0x0f00, from + 2 * stride);
    if (n > 3)
        rows = add_row(rows, 0xf000, from + 3 * stride);
    return (ws){{(vs)rows}};
}
