/* The march in double precision, for processors with AVX-512: the same operations, and numbers. */
#define cts_tiled_march_exact cts_tiled_march_exact_avx512
#include "engine/tiled/tiled_march_exact.c"
