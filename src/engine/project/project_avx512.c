/* Packets of mip, minip and average for AVX-512. */
#include "engine/project/project_packets.h"

#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512VL__)

#include "base/mutation.h"
#include <immintrin.h>

#define PROJECT_TMPL_TYPES
#include "engine/project/project_tmpl.h"

INLINE vd vd_sqrt(vd a)
{
    return _mm512_sqrt_pd(a);
}

INLINE unsigned lanes_in(vm mask)
{
    return _mm512_movepi64_mask((__m512i)mask);
}

#include "engine/project/project_tmpl.h"

void cts_project_tile_avx512(const CtsProjection *projection, const CtsProjectScratch *scratch, int x, int y, int width,
                             int height, double *grey)
{
    project_tile(projection, scratch, x, y, width, height, grey);
}

#else

void cts_project_tile_avx512(const CtsProjection *projection, const CtsProjectScratch *scratch, int x, int y, int width,
                             int height, double *grey)
{
    cts_project_tile_avx2(projection, scratch, x, y, width, height, grey);
}

#endif
