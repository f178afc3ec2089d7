#define cts_simd_init_plain cts_simd_init_avx2
#include "engine/splat/loops.c"
