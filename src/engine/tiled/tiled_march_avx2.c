/* The march with AVX2. */
#define GATHERS
#define cts_tiled_march_c cts_tiled_march_avx2
#include "engine/tiled/tiled_march_c.c"
