/* Vectors of 8 pixels as GCC vector types: element-wise C that compiles with and without vector instructions. */
#ifndef CTS_SPLAT_VEC8_H
#define CTS_SPLAT_VEC8_H

#include <stdint.h>

typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef int32_t v8i_u __attribute__((vector_size(32), aligned(4))); /* for loads from plain arrays */

#define INLINE static inline __attribute__((always_inline))

#endif
