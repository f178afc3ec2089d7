/* The march in plain C, whose pictures are those of all SIMD paths, reporting its segments. */
#define MARCH_TRACED
#include "engine/tiled/tiled_march_tmpl.h"

void cts_tiled_march_traced(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
