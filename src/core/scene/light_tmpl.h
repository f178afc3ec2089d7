/* Openness at the places of rays, and the law of light (core/scene/shade.h), in the registers of base/simd.h. */
#include "core/scene/openness.h"
#include "core/scene/shade.h"

/* Trilinear between the eight corners of a cell. */
INLINE vf between(const vf v[8], const vf at[3])
{
    const vf a = v[0] + at[0] * (v[1] - v[0]), b = v[2] + at[0] * (v[3] - v[2]);
    const vf c = v[4] + at[0] * (v[5] - v[4]), d = v[6] + at[0] * (v[7] - v[6]);
    const vf low = a + at[1] * (b - a), high = c + at[1] * (d - c);
    return low + at[2] * (high - low);
}

/* A cell between the middles of 2 x 2 x 2 blocks: openness there, 0 to 255. */
typedef struct OpenCell {
    vi at[3];
    vf corner[8];
} OpenCell;

INLINE vf block_coordinate(const CtsOpenness *o, int axis, vf vox)
{
    const vf at = vox * (real)o->scale[axis] + (real)o->shift[axis];
    return vf_min(vf_max(at, vf_of(0)), vf_of((real)(o->n[axis] - 1)));
}

INLINE OpenCell load_open(const CtsOpenness *o, const vf vox[3], vmask lanes)
{
    OpenCell c;
    for (int a = 0; a < 3; a++)
        c.at[a] = vi_min(to_int(block_coordinate(o, a, vox[a])), vi_of(o->n[a] > 1 ? o->n[a] - 2 : 0));
    const vi at = (c.at[2] * (whole)o->n[1] + c.at[1]) * (whole)o->n[0] + c.at[0];
    for (int k = 0; k < 2; k++) {
        const vi square = vi_gather(o->square + k * o->plane, at, lanes);
        for (int i = 0; i < 4; i++)
            c.corner[4 * k + i] = to_float((vi)((vu)square >> 8 * i) & 255);
    }
    return c;
}

/* 0 to 1. Beyond the cell as its corners go on. */
INLINE vf open_between(const CtsOpenness *o, const OpenCell *c, const vf vox[3])
{
    vf share[3];
    for (int a = 0; a < 3; a++)
        share[a] = block_coordinate(o, a, vox[a]) - to_float(c->at[a]);
    return between(c->corner, share) * (real)(1 / 255.0);
}

/* Factor of the colour, and white to be added, for |n.v|, its power, and the openness that dims both; for the direct
 * share of the light twice. */
INLINE void light_terms(const CtsShade *s, vf facing, vf highlight, vf open, vf *colour, vf *white)
{
    const vf dark = (real)s->occlusion - open * (real)s->occlusion, left = 1 - dark;
    *colour = left * (real)s->ambient + facing * (real)s->diffuse * (1 - dark * (real)s->occlusion);
    *white = highlight * (real)s->specular * left;
}
