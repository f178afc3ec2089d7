/* The march in double precision, lane by lane where it is not element-wise: for a few rays. */
#define LANES 8
#define EXACT
#include "engine/tiled/vec_tmpl.h"

#include "engine/tiled/plain_tmpl.h"

INLINE vf vf_log2(vf x)
{
    for (int l = 0; l < LANES; l++)
        x[l] = log2(x[l]);
    return x;
}

INLINE vf vf_exp2(vf x)
{
    for (int l = 0; l < LANES; l++)
        x[l] = exp2(x[l]);
    return x;
}

INLINE vf vf_log2_rest(vf x)
{
    for (int l = 0; l < LANES; l++)
        x[l] = log1p(-x[l]) / M_LN2;
    return x;
}

INLINE vf vf_taken(vf x)
{
    for (int l = 0; l < LANES; l++)
        x[l] = -expm1(-M_LN2 * x[l]);
    return x;
}

#include "engine/tiled/cells_tmpl.h"

void cts_tiled_march_exact(const TiledJob *job, TiledRays *rays, TiledCounts *counts)
{
    march(job, rays, counts);
}
