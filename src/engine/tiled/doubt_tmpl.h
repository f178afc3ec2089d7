/* What a stretch may be wrong by, part of march_tmpl.h; march.h derives it. */
#include "engine/tiled/slab_tmpl.h"

/* What the table says of a way on which the field is taken to run from low to high and may run up to `off` grey levels
 * beside that, in `share` of the way across each level in between: what its depth, and its colour, may be off by. */
OUTLINE void look_up_doubt(const TiledJob *j, vf low, vf high, vf off, vf share, float length_mm, vf *depth, vf *tint)
{
    const CtsSlabTable *t = &j->table;
    vf below[2], above[2];
    look_up_pairs(t->change, t->n, entry_of(j, low - off) - 1, below);
    look_up_pairs(t->change, t->n, entry_of(j, high + off) + 1, above);
    *depth = vf_min(share * (above[0] - below[0]) * length_mm, vf_of(1));
    *tint = vf_min(share * (above[1] - below[1]), *tint);
}

/* In how much of a way that runs evenly from low to high the field may be on the other side of a level, where it is at
 * most `off` away. */
INLINE vf even_share(vf low, vf high, vf off)
{
    return vf_min(2 * off / vf_max(high - low, vf_of(1e-6f)), vf_of(1));
}

/* What is taken for opaque may not be, if it is less deep than found: what shows then is not known. */
OUTLINE vf unknown_behind(vf t_before, vf t_after, vf depth)
{
    vf shown;
    for (int l = 0; l < LANES; l++) {
        const float less = t_after[l] * expf(depth[l]);
        shown[l] = less < t_before[l] ? less : t_before[l];
    }
    return shown;
}

typedef struct Colour {
    vf r, g, b;
} Colour;

/* The colour of what took `lost` of the light, and where nothing did, that which shows first. */
INLINE Colour colour_of(const TiledJob *j, const Light *light, const Colour *before, vf lost)
{
    const float *first = j->table.first_rgb;
    const vmask some = vf_lt(vf_of(1e-7f), lost);
    const vf share = 1.0f / vf_max(lost, vf_of(1e-7f));
    return (Colour){select_f(some, (light->r - before->r) * share, vf_of(first[0])),
                    select_f(some, (light->g - before->g) * share, vf_of(first[1])),
                    select_f(some, (light->b - before->b) * share, vf_of(first[2]))};
}

/* A stretch's depth may be off by `depth` where the pixel, had all light ended there, had this colour. */
INLINE void note_depth_doubt(Doubt *doubt, vf depth, vf r, vf g, vf b)
{
    const vf weight = depth * depth;
    doubt->depth += weight;
    doubt->r = vf_fma(weight, r, doubt->r);
    doubt->g = vf_fma(weight, g, doubt->g);
    doubt->b = vf_fma(weight, b, doubt->b);
    doubt->square = vf_fma(weight, vf_fma(r, r, vf_fma(g, g, b * b)), doubt->square);
}
