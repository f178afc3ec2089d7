/* The march with AVX-512. Compiled for F, BW, DQ and VL; called only where the processor has them. */
#include "engine/tiled/cells.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__AVX512VL__)

#define LANES 16
#include "engine/tiled/vec_tmpl.h"
#include <immintrin.h>

typedef __mmask16 vmask;

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)_mm512_mask_blend_ps(mask, (__m512)no, (__m512)yes);
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (vi)_mm512_mask_blend_epi32(mask, (__m512i)no, (__m512i)yes);
}

INLINE vmask vf_lt(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LT_OQ);
}

INLINE vmask vf_le(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ);
}

INLINE vmask vi_lt(vi a, vi b)
{
    return _mm512_cmplt_epi32_mask((__m512i)a, (__m512i)b);
}

INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm512_min_ps((__m512)a, (__m512)b);
}

INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm512_max_ps((__m512)a, (__m512)b);
}

INLINE vi vi_min(vi a, vi b)
{
    return (vi)_mm512_min_epi32((__m512i)a, (__m512i)b);
}

INLINE vi vi_max(vi a, vi b)
{
    return (vi)_mm512_max_epi32((__m512i)a, (__m512i)b);
}

INLINE unsigned bits_of(vmask mask)
{
    return mask;
}

INLINE vmask mask_of(unsigned bits)
{
    return (vmask)bits;
}

INLINE vf look_up(const float *table, int n, vi index)
{
    if (n <= LANES)
        return (vf)_mm512_permutexvar_ps((__m512i)index, _mm512_loadu_ps(table));
    return (vf)_mm512_i32gather_ps((__m512i)index, table, 4);
}

INLINE vmask vi_above(vi a, vi b)
{
    return _mm512_cmpgt_epu32_mask((__m512i)a, (__m512i)b);
}

INLINE vmask share_bits(vi a, vi b)
{
    return _mm512_test_epi32_mask((__m512i)a, (__m512i)b);
}

INLINE vi load_words(const TiledMask *mask, const vi cell[3], vmask lanes)
{
    return (vi)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), lanes, (__m512i)word_of(mask, cell), mask->words, 4);
}

INLINE vi load_bytes(const uint8_t *from, vi at, vmask lanes)
{
    return (vi)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), lanes, (__m512i)at, from, 1) & 255;
}

#define GATHERS
INLINE vi voxel_of(const TiledJob *j, const vi cell[3])
{
    return cell[0] + cell[1] * (int32_t)j->stride[1] + cell[2] * (int32_t)j->stride[2];
}

INLINE vi load_pair(const uint16_t *from, vi at, vmask lanes)
{
    return (vi)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), lanes, (__m512i)at, from, 2);
}

#include "engine/tiled/log_tmpl.h"

#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_avx512(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}

#else

void cts_tiled_march_avx512(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    cts_tiled_march_c(job, rays, counts);
}

#endif
