/* Operations of base/simd.h in plain C, which the other paths are compared with. Of lanes of 64 bits by name, where
 * compilers do not find them. */
#if defined(SIMD_DOUBLE) && LANES > 2
#include <immintrin.h>
#endif

/* Defines a function on the lanes of one register: `value` computes lane l of its result. */
#define SIMD_LANES(type, name, parameters, value)                                                                      \
    INLINE type name parameters                                                                                        \
    {                                                                                                                  \
        type result = {0};                                                                                             \
        for (int l = 0; l < LANES; l++)                                                                                \
            result[l] = value;                                                                                         \
        return result;                                                                                                 \
    }

SIMD_OP(vi, vi_select, (vmask mask, vi yes, vi no), (mask & yes) | (~mask & no))
#if defined(SIMD_DOUBLE) && LANES == 4
SIMD_OP(vf, vf_select, (vmask mask, vf yes, vf no), (vf)_mm256_blendv_pd((__m256d)no, (__m256d)yes, (__m256d)mask))
SIMD_OP(vf, vf_min, (vf a, vf b), (vf)_mm256_min_pd((__m256d)a, (__m256d)b))
SIMD_OP(vf, vf_max, (vf a, vf b), (vf)_mm256_max_pd((__m256d)a, (__m256d)b))
#else
SIMD_OP(vf, vf_select, (vmask mask, vf yes, vf no), (vf)((mask & (vi)yes) | (~mask & (vi)no)))
SIMD_OP(vf, vf_min, (vf a, vf b), vf_select(a < b, a, b))
SIMD_OP(vf, vf_max, (vf a, vf b), vf_select(a > b, a, b))
#endif
SIMD_OP(vi, vi_min, (vi a, vi b), vi_select(a < b, a, b))
SIMD_OP(vi, vi_max, (vi a, vi b), vi_select(a > b, a, b))

/* Correctly rounded: of a float in double precision, too. */
SIMD_LANES(vf, vf_sqrt, (vf a), (real)sqrt((double)a[l]))

#if defined(SIMD_DOUBLE) && LANES == 8
SIMD_OP(unsigned, mask_bits, (vmask mask), _mm512_movepi64_mask((__m512i)mask))
SIMD_OP(bool, mask_any, (vmask mask), mask_bits(mask) != 0)
#elif defined(SIMD_DOUBLE) && LANES == 4
SIMD_OP(unsigned, mask_bits, (vmask mask), (unsigned)_mm256_movemask_pd((__m256d)mask))
SIMD_OP(bool, mask_any, (vmask mask), mask_bits(mask) != 0)
#else
INLINE bool mask_any(vmask mask)
{
    whole any = 0;
    for (int l = 0; l < LANES; l++)
        any |= mask[l];
    return any != 0;
}

INLINE unsigned mask_bits(vmask mask)
{
    unsigned bits = 0;
    for (int l = 0; l < LANES; l++)
        bits |= (unsigned)(mask[l] & 1) << l;
    return bits;
}
#endif

SIMD_LANES(vmask, mask_of_bits, (unsigned bits), -(whole)(bits >> l & 1))
SIMD_LANES(vf, vf_look_up, (const float *table, int n, vi index), ((void)n, (real)table[index[l]]))
SIMD_LANES(vi, vi_take_bytes, (const void *from, vi index), ((const uint8_t *)from)[index[l]])

INLINE vi first_index(vi index, vmask mask)
{
    return vi_of(index[__builtin_ctz(mask_bits(mask))]);
}

INLINE int32_t load_one(const char *from)
{
    int32_t one;
    memcpy(&one, from, sizeof one);
    return one;
}

SIMD_LANES(vi, vi_take, (const void *from, vi index), load_one((const char *)from + 4 * (ptrdiff_t)index[l]))

#ifndef SIMD_DOUBLE
SIMD_LANES(vi, vi_load_shorts, (const int16_t *from), from[l])
SIMD_LANES(vi, vi_load_words, (const uint16_t *from), from[l])
SIMD_LANES(vi, vi_take_pairs, (const void *from, vi index),
           (int32_t)(((const uint16_t *)from)[index[l]] | (uint32_t)((const uint16_t *)from)[index[l] + 1] << 16))

SIMD_LANES(vi, vi_take_64, (const void *from, vi index, ptrdiff_t scale, vi *second),
           ((*second)[l] = load_one((const char *)from + index[l] * scale + 4),
            load_one((const char *)from + index[l] * scale)))

/* The sum wraps where all four are INT16_MIN. */
INLINE vi vs_madd(vs a, vs b)
{
    const vu lower = (vu)(((vi)a << 16 >> 16) * ((vi)b << 16 >> 16));
    return (vi)(lower + (vu)(((vi)a >> 16) * ((vi)b >> 16)));
}

typedef uint16_t vus SIMD_VECTOR(real);
SIMD_OP(vs, vs_unsigned_max, (vs a, vs b), (((vus)a > (vus)b) & a) | (~((vus)a > (vus)b) & b))
SIMD_OP(vs, vs_unsigned_min, (vs a, vs b), (((vus)a < (vus)b) & a) | (~((vus)a < (vus)b) & b))
SIMD_OP(vs, vs_excess, (vs a, vs b), (a - b) & ((vus)a > (vus)b))
INLINE vs vs_mul_high(vs a, vs b)
{
    const vu low = ((vu)a & 0xffff) * ((vu)b & 0xffff), high = ((vu)a >> 16) * ((vu)b >> 16);
    return (vs)(low >> 16 | (high & 0xffff0000));
}

INLINE ws ws_permute2(ws low, ws high, ws index)
{
    int16_t table[64], at[32];
    memcpy(table, &low, sizeof low);
    memcpy(table + 32, &high, sizeof high);
    memcpy(at, &index, sizeof index);
    for (int l = 0; l < 32; l++)
        at[l] = table[at[l]];
    memcpy(&index, at, sizeof index);
    return index;
}

SIMD_OP(ws, ws_permute, (ws table, ws index), ws_permute2(table, table, index))

INLINE ws ws_load_rows(const int16_t *from, ptrdiff_t stride, int n)
{
    ws rows = {{{0}}};
    for (int r = 0; r < n; r++)
        memcpy((int16_t *)&rows + 8 * r, from + r * stride, 8 * sizeof *from);
    return rows;
}
#endif
