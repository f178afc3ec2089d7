/* The march in plain C, and on each SIMD path (tiled_march_avx2.c). */
#include "engine/tiled/tiled_march_tmpl.h"

void cts_tiled_march_c(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
