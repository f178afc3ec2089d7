/* GCC vectors of a fixed number of lanes, such as pixels or runs of voxels. They may lie at any address of an element
 * and alias it, so that arrays are read and written through pointers to them. */
#pragma once

#include <stdint.h>

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
