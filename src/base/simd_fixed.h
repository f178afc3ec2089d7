/* GCC vectors of a fixed number of lanes, such as pixels or runs of voxels. They may lie at any address of an element
 * and alias it, so that arrays are read and written through pointers to them. */
#pragma once

#include <stddef.h>
#include <stdint.h>
#ifdef __SSE__
#include <immintrin.h>
#endif

#define SHUFFLE __builtin_shufflevector
#define CONVERT __builtin_convertvector
#define SIMD_FIXED(name, element, n)                                                                                   \
    typedef element name __attribute__((vector_size(sizeof(element) * (n)), aligned(sizeof(element)), may_alias))
SIMD_FIXED(u8x8, uint8_t, 8);
SIMD_FIXED(i16x8, int16_t, 8);
SIMD_FIXED(u16x8, uint16_t, 8);
SIMD_FIXED(i32x4, int32_t, 4);
SIMD_FIXED(i32x8, int32_t, 8);
SIMD_FIXED(u32x2, uint32_t, 2);
SIMD_FIXED(u32x4, uint32_t, 4);
SIMD_FIXED(u32x8, uint32_t, 8);
SIMD_FIXED(i64x4, int64_t, 4);
SIMD_FIXED(f32x4, float, 4);
SIMD_FIXED(f32x8, float, 8);
SIMD_FIXED(f64x4, double, 4);

/* Lane by lane: b unless a is smaller, or larger. By name, since gcc makes four instructions of the operators. */
static inline f32x4 f32x4_min(f32x4 a, f32x4 b)
{
#ifdef __SSE__
    return (f32x4)_mm_min_ps((__m128)a, (__m128)b);
#else
    return (f32x4)(((a < b) & (i32x4)a) | (~(a < b) & (i32x4)b));
#endif
}

static inline f32x4 f32x4_max(f32x4 a, f32x4 b)
{
#ifdef __SSE__
    return (f32x4)_mm_max_ps((__m128)a, (__m128)b);
#else
    return (f32x4)(((a > b) & (i32x4)a) | (~(a > b) & (i32x4)b));
#endif
}

/* Eight rows of eight elements, in_stride apart, become eight columns, out_stride apart. */
static inline void transpose_8x8(const uint16_t *in, size_t in_stride, uint16_t *out, size_t out_stride)
{
    u16x8 row[8], mixed[8];
    for (size_t i = 0; i < 8; i++)
        row[i] = *(const u16x8 *)(in + i * in_stride);
    /* Three rounds of interleaving rows i and i + 4. */
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < 4; i++) {
            mixed[2 * i] = SHUFFLE(row[i], row[i + 4], 0, 8, 1, 9, 2, 10, 3, 11);
            mixed[2 * i + 1] = SHUFFLE(row[i], row[i + 4], 4, 12, 5, 13, 6, 14, 7, 15);
        }
        for (int i = 0; i < 8; i++)
            row[i] = mixed[i];
    }
    for (size_t i = 0; i < 8; i++)
        *(u16x8 *)(out + i * out_stride) = row[i];
}
