/* The march in plain C, and on each SIMD path (cells_avx2.c). Eight lanes also in plain C: with four, few pixels of lit
 * pictures differ by a thousandth, for a reason not known. */
#define SIMD_PLAIN_LANES 8
#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_c(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
