/* Vectors of 8 pixels as GCC vector types: element-wise C that compiles with and without vector instructions. */
#ifndef CTS_SPLAT_VEC8_H
#define CTS_SPLAT_VEC8_H

#include <stdint.h>

typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef int32_t v8i_u __attribute__((vector_size(32), aligned(4))); /* for loads from plain arrays */

/* Fast kernels want their small functions inlined whatever the compiler thinks; plain ones, and builds with sanitizers,
 * whose code is several times as long, do not. */
#if defined(__AVX2__) && !defined(__SANITIZE_ADDRESS__) && !defined(CTS_SANITIZED)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
/* Kept out of the hot loops that call it now and then. */
#define OUTLINE static __attribute__((noinline))

#endif
