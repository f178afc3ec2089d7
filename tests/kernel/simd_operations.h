/* Input and results of the operations of base/simd.h, for each SIMD path. */
#pragma once

#include <stdint.h>

enum { TABLE_SIZE = 256 };

/* Any values, including NaN and the extremes, except for:
 *
 * - c: floats in the range of int32_t; r: floats from -2^22 to 2^22
 * - b: 0..255; p, q: 0..31, 0..63
 * - m, n: one bit a lane */
typedef struct SimdInput {
    float f[16], g[16], c[16], r[16], table[TABLE_SIZE];
    int32_t i[16], j[16], b[16], twos[TABLE_SIZE][2];
    int16_t s[32], t[32], u[32], p[32], q[32], rows[TABLE_SIZE];
    uint16_t grey[TABLE_SIZE + 2];
    unsigned m, n;
} SimdInput;

/* Result of one operation: 16 lanes of 32 bits, or 32 of 16. */
typedef union SimdRow {
    float floats[16];
    int32_t wholes[16];
    int16_t shorts[32];
} SimdRow;
enum { MAX_ROWS = 100 };

/* Returns the number of rows written. */
typedef int (*simd_operations_fn)(const SimdInput *in, SimdRow row[MAX_ROWS]);
int simd_operations_c(const SimdInput *in, SimdRow row[MAX_ROWS]);
int simd_operations_avx2(const SimdInput *in, SimdRow row[MAX_ROWS]);
int simd_operations_avx512(const SimdInput *in, SimdRow row[MAX_ROWS]);
