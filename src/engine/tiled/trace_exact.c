/* The march in double precision, reporting its segments. */
#define MARCH_TRACED
#define cts_tiled_march_exact_plain cts_tiled_march_exact_traced
#include "engine/tiled/tiled_march_exact.c"
