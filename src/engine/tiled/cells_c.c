/* The march in plain C, and on each SIMD path (cells_avx2.c). */
#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_c(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
