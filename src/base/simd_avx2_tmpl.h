/* Operations of base/simd.h with AVX2. */
#include "base/simd_loads_tmpl.h"

SIMD_OP(vf, vf_select, (vmask mask, vf yes, vf no), (vf)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)mask))
SIMD_OP(vi, vi_select, (vmask mask, vi yes, vi no), (vi)_mm256_blendv_epi8((__m256i)no, (__m256i)yes, (__m256i)mask))
SIMD_OP(vf, vf_min, (vf a, vf b), (vf)_mm256_min_ps((__m256)a, (__m256)b))
SIMD_OP(vf, vf_max, (vf a, vf b), (vf)_mm256_max_ps((__m256)a, (__m256)b))
SIMD_OP(vi, vi_min, (vi a, vi b), (vi)_mm256_min_epi32((__m256i)a, (__m256i)b))
SIMD_OP(vi, vi_max, (vi a, vi b), (vi)_mm256_max_epi32((__m256i)a, (__m256i)b))
SIMD_OP(vf, vf_sqrt, (vf a), (vf)_mm256_sqrt_ps((__m256)a))
SIMD_OP(bool, mask_any, (vmask mask), _mm256_movemask_ps((__m256)mask) != 0)
SIMD_OP(unsigned, mask_bits, (vmask mask), (unsigned)_mm256_movemask_ps((__m256)mask))

INLINE vmask mask_of_bits(unsigned bits)
{
    const vi bit = {1, 2, 4, 8, 16, 32, 64, 128};
    return (vi_of((int32_t)bits) & bit) == bit;
}

INLINE vf vf_look_up(const float *table, int n, vi index)
{
    if (n <= LANES)
        return (vf)_mm256_permutevar8x32_ps(_mm256_loadu_ps(table), (__m256i)index);
    return (vf)load_eight_32(table, (__m256i)index, sizeof *table);
}

SIMD_OP(vi, vi_load_shorts, (const int16_t *from), (vi)_mm256_cvtepi16_epi32(_mm_loadu_si128((const void *)from)))
SIMD_OP(vi, vi_load_words, (const uint16_t *from), (vi)_mm256_cvtepu16_epi32(_mm_loadu_si128((const void *)from)))

SIMD_OP(vi, vi_take, (const void *from, vi index), (vi)load_eight_32(from, (__m256i)index, 4))
SIMD_OP(vi, vi_take_bytes, (const void *from, vi index), (vi)load_eight_32(from, (__m256i)index, 1) & 255)
SIMD_OP(vi, vi_take_pairs, (const void *from, vi index), (vi)load_eight_32(from, (__m256i)index, 2))

INLINE vi vi_take_64(const void *from, vi index, ptrdiff_t scale, vi *second)
{
    __m256i four[2];
    load_eight_64(from, (__m256i)index, scale, four);
    const __m256 low = (__m256)four[0], high = (__m256)four[1];
    const __m256d even = (__m256d)_mm256_shuffle_ps(low, high, 0x88), odd = (__m256d)_mm256_shuffle_ps(low, high, 0xdd);
    *second = (vi)_mm256_permute4x64_pd(odd, 0xd8);
    return (vi)_mm256_permute4x64_pd(even, 0xd8);
}

/* Index of the first lane of the mask, in every lane. */
SIMD_OP(vi, first_index, (vi index, vmask mask),
        (vi)_mm256_permutevar8x32_epi32((__m256i)index, _mm256_set1_epi32(__builtin_ctz(mask_bits(mask)))))

SIMD_OP(vi, vs_madd, (vs a, vs b), (vi)_mm256_madd_epi16((__m256i)a, (__m256i)b))
SIMD_OP(vs, vs_unsigned_max, (vs a, vs b), (vs)_mm256_max_epu16((__m256i)a, (__m256i)b))
SIMD_OP(vs, vs_unsigned_min, (vs a, vs b), (vs)_mm256_min_epu16((__m256i)a, (__m256i)b))
SIMD_OP(vs, vs_excess, (vs a, vs b), (vs)_mm256_subs_epu16((__m256i)a, (__m256i)b))
SIMD_OP(vs, vs_mul_high, (vs a, vs b), (vs)_mm256_mulhi_epu16((__m256i)a, (__m256i)b))

/* Byte offsets of both bytes of each element. */
SIMD_OP(__m256i, byte_index, (vs index), (__m256i)(index * 0x0202 + 0x0100))

/* Selects from rows of eight elements, row by row: a byte shuffle gives 0 where bit 7 of its offset is set, which the
 * saturating addition sets for offsets outside the row. */
INLINE vs select_from_rows(const ws *table, int n_parts, vs index)
{
    const __m256i byte = byte_index(index), bit_7 = _mm256_set1_epi8(0x70);
    __m256i v = _mm256_setzero_si256();
    for (int r = 0; r < 2 * n_parts; r++) {
        const __m256i two = (__m256i)table[r / 4].part[r / 2 % 2];
        const __m256i row = r % 2 ? _mm256_permute2x128_si256(two, two, 0x11) : _mm256_permute2x128_si256(two, two, 0);
        const __m256i offset = _mm256_adds_epu8(_mm256_sub_epi8(byte, _mm256_set1_epi8((char)(16 * r))), bit_7);
        v = _mm256_or_si256(v, _mm256_shuffle_epi8(row, offset));
    }
    return (vs)v;
}

INLINE ws ws_permute(ws table, ws index)
{
    return (ws){{select_from_rows(&table, 2, index.part[0]), select_from_rows(&table, 2, index.part[1])}};
}

INLINE ws ws_permute2(ws low, ws high, ws index)
{
    const ws table[2] = {low, high};
    return (ws){{select_from_rows(table, 4, index.part[0]), select_from_rows(table, 4, index.part[1])}};
}

SIMD_OP(__m128i, one_row, (const int16_t *from, ptrdiff_t stride, int n, int row),
        row < n ? _mm_loadu_si128((const __m128i *)(from + row * stride)) : _mm_setzero_si128())

INLINE ws ws_load_rows(const int16_t *from, ptrdiff_t stride, int n)
{
    ws rows;
    for (int p = 0; p < 2; p++)
        rows.part[p] = (vs)_mm256_set_m128i(one_row(from, stride, n, 2 * p + 1), one_row(from, stride, n, 2 * p));
    return rows;
}
