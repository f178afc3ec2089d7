/* The march, on each SIMD path. */
#include "base/simd_path.h"

#ifndef CTS_PATH_PLAIN
#define GATHERS
#endif
#include "engine/tiled/tiled_march_tmpl.h"

void CTS_ON_PATH(cts_tiled_march)(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
