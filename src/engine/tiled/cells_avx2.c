/* The march with AVX2; called only where the processor has it. */
#include "engine/tiled/cells.h"

#if defined(__AVX2__)

#define LANES 8
#include "engine/tiled/vec_tmpl.h"
#include <immintrin.h>

typedef vi vmask;

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)mask);
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (vi)_mm256_blendv_epi8((__m256i)no, (__m256i)yes, (__m256i)mask);
}

INLINE vmask vf_lt(vf a, vf b)
{
    return a < b;
}

INLINE vmask vf_le(vf a, vf b)
{
    return a <= b;
}

INLINE vmask vi_lt(vi a, vi b)
{
    return a < b;
}

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

INLINE unsigned bits_of(vmask mask)
{
    return (unsigned)_mm256_movemask_ps((__m256)mask);
}

INLINE vmask mask_of(unsigned bits)
{
    const vi bit = {1, 2, 4, 8, 16, 32, 64, 128};
    return (vi_of((int32_t)bits) & bit) == bit;
}

INLINE vf look_up(const float *table, int n, vi index)
{
    if (n <= LANES)
        return (vf)_mm256_permutevar8x32_ps(_mm256_loadu_ps(table), (__m256i)index);
    return (vf)_mm256_i32gather_ps(table, (__m256i)index, 4);
}

INLINE vi gather(const void *from, vi index, vmask lanes, const int scale)
{
    const __m256i zero = _mm256_setzero_si256();
    return (vi)(scale == 4   ? _mm256_mask_i32gather_epi32(zero, from, (__m256i)index, (__m256i)lanes, 4)
                : scale == 2 ? _mm256_mask_i32gather_epi32(zero, from, (__m256i)index, (__m256i)lanes, 2)
                             : _mm256_mask_i32gather_epi32(zero, from, (__m256i)index, (__m256i)lanes, 1));
}

INLINE vmask vi_above(vi a, vi b)
{
    return (vu)a > (vu)b;
}

INLINE vmask share_bits(vi a, vi b)
{
    return (a & b) != 0;
}

INLINE vi load_words(const TiledMask *mask, const vi cell[3], vmask lanes)
{
    return gather(mask->words, word_of(mask, cell), lanes, 4);
}

INLINE vi load_bytes(const uint8_t *from, vi at, vmask lanes)
{
    return gather(from, at, lanes, 1) & 255;
}

#define GATHERS
INLINE vi voxel_of(const TiledJob *j, const vi cell[3])
{
    return cell[0] + cell[1] * (int32_t)j->stride[1] + cell[2] * (int32_t)j->stride[2];
}

INLINE vi load_pair(const uint16_t *from, vi at, vmask lanes)
{
    return gather(from, at, lanes, 2);
}

#include "engine/tiled/log_tmpl.h"

#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_avx2(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}

#else

void cts_tiled_march_avx2(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    cts_tiled_march_c(job, rays, counts);
}

#endif
