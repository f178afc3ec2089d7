/* Packets of mip, minip and average in plain C. */
#include "base/mutation.h"

#define PROJECT_TMPL_TYPES
#include "engine/project/project_tmpl.h"

INLINE vd vd_sqrt(vd a)
{
    vd r;
    for (int l = 0; l < LANES; l++)
        r[l] = sqrt(a[l]);
    return r;
}

INLINE unsigned lanes_in(vm mask)
{
    unsigned lanes = 0;
    for (int l = 0; l < LANES; l++)
        lanes |= (unsigned)(mask[l] & 1) << l;
    return lanes;
}

#include "engine/project/project_tmpl.h"

void cts_project_tile_c(const CtsProjection *projection, const CtsProjectScratch *scratch, int x, int y, int width,
                        int height, double *grey)
{
    project_tile(projection, scratch, x, y, width, height, grey);
}
