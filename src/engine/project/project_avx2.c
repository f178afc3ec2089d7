/* Packets of mip, minip and average for AVX2. */
#include "engine/project/project_packets.h"

#if defined(__AVX2__) && defined(__FMA__)

#include "base/mutation.h"
#include <immintrin.h>

#define PROJECT_TMPL_TYPES
#include "engine/project/project_tmpl.h"

typedef double vd4 __attribute__((vector_size(32)));

INLINE vd vd_sqrt(vd a)
{
    const vd4 low = _mm256_sqrt_pd(__builtin_shufflevector(a, a, 0, 1, 2, 3));
    const vd4 high = _mm256_sqrt_pd(__builtin_shufflevector(a, a, 4, 5, 6, 7));
    return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
}

INLINE unsigned lanes_in(vm mask)
{
    const vd a = (vd)mask;
    return (unsigned)_mm256_movemask_pd(__builtin_shufflevector(a, a, 0, 1, 2, 3)) |
           (unsigned)_mm256_movemask_pd(__builtin_shufflevector(a, a, 4, 5, 6, 7)) << 4;
}

#include "engine/project/project_tmpl.h"

void cts_project_tile_avx2(const CtsProjection *projection, const CtsProjectScratch *scratch, int x, int y, int width,
                           int height, double *grey)
{
    project_tile(projection, scratch, x, y, width, height, grey);
}

#else

void cts_project_tile_avx2(const CtsProjection *projection, const CtsProjectScratch *scratch, int x, int y, int width,
                           int height, double *grey)
{
    cts_project_tile_c(projection, scratch, x, y, width, height, grey);
}

#endif
