/* The march with AVX-512. */
#define GATHERS
#define cts_tiled_march_c cts_tiled_march_avx512
#include "engine/tiled/tiled_march_c.c"
