/* The march in plain C. */
#define LANES 8
#include "engine/tiled/vec_tmpl.h"

#include "engine/tiled/plain_tmpl.h"

#include "engine/tiled/log_tmpl.h"

#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_c(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
