/* The march in double precision, lane by lane where it is not element-wise: for a few rays. Only logarithms and powers
 * are as in single precision. */
#define SIMD_DOUBLE
#include "base/simd_path.h"
#include "engine/tiled/tiled_march_tmpl.h"

void CTS_ON_PATH(cts_tiled_march_double)(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
