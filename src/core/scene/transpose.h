/* Squares of 8 x 8 voxels turned round, in vectors of eight. */
#ifndef CTS_SCENE_TRANSPOSE_H
#define CTS_SCENE_TRANSPOSE_H

#include <stddef.h>
#include <stdint.h>

typedef uint16_t cts_v8u __attribute__((vector_size(16)));
typedef uint16_t cts_v8u_any __attribute__((vector_size(16), aligned(2)));

/* 8 rows of 8 voxels, in_stride apart, become 8 columns, out_stride apart. */
static inline void cts_transpose_8(const uint16_t *in, size_t in_stride, uint16_t *out, size_t out_stride)
{
    cts_v8u a[8], b[8];
    for (size_t i = 0; i < 8; i++)
        a[i] = *(const cts_v8u_any *)(in + i * in_stride);
    /* Three rounds of interleaving rows i and i + 4. */
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < 4; i++) {
            b[2 * i] = __builtin_shufflevector(a[i], a[i + 4], 0, 8, 1, 9, 2, 10, 3, 11);
            b[2 * i + 1] = __builtin_shufflevector(a[i], a[i + 4], 4, 12, 5, 13, 6, 14, 7, 15);
        }
        for (int i = 0; i < 8; i++)
            a[i] = b[i];
    }
    for (int i = 0; i < 8; i++)
        *(cts_v8u_any *)(out + (size_t)i * out_stride) = a[i];
}

#endif
