/* Openness along segments of rays: part of shading_tmpl.h. */

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

INLINE vi load_squares(const uint32_t *square, vi at, vmask lanes)
{
#ifdef SIMD_DOUBLE
    vi v = vi_of(0);
    for (unsigned left = mask_bits(lanes); left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        v[l] = (whole)square[at[l]];
    }
    return v;
#else
    return vi_gather(square, at, lanes);
#endif
}

INLINE OpenCell load_open(const TiledJob *j, const vf vox[3], vmask lanes)
{
    const CtsOpenness *const o = j->open;
    OpenCell c;
    for (int a = 0; a < 3; a++)
        c.at[a] = vi_min(to_int(block_coordinate(o, a, vox[a])), vi_of(o->n[a] > 1 ? o->n[a] - 2 : 0));
    const vi at = (c.at[2] * (whole)o->n[1] + c.at[1]) * (whole)o->n[0] + c.at[0];
    for (int k = 0; k < 2; k++) {
        const vi square = load_squares(o->square + k * o->plane, at, lanes);
        for (int i = 0; i < 4; i++)
            c.corner[4 * k + i] = to_float((vi)((vu)square >> 8 * i) & 255);
    }
    return c;
}

/* 0 to 1. Beyond the cell as its corners go on. */
INLINE vf open_between(const TiledJob *j, const OpenCell *c, const vf vox[3])
{
    vf share[3];
    for (int a = 0; a < 3; a++)
        share[a] = block_coordinate(j->open, a, vox[a]) - to_float(c->at[a]);
    return between(c->corner, share) * (real)(1 / 255.0);
}

INLINE void place_on(const QueueEntries *w, vf s, vf vox[3])
{
    for (int a = 0; a < 3; a++)
        vox[a] = to_float(w->cell[a]) + w->enter[a] + s * w->displacement[a];
}

/* At a share s of the way. */
INLINE vf openness_at(const TiledJob *j, const QueueEntries *w, vf s, vmask lanes)
{
    vf vox[3];
    place_on(w, s, vox);
    const OpenCell c = load_open(j, vox, lanes);
    return open_between(j, &c, vox);
}

/* Openness at the weighted centre of a segment, and an error estimate of its mean: half of the distance of the centre
 * from the ends' line, the error of the centre (centre_of(), 0.008 of the change), and the product with a change of
 * light. */
typedef struct Open {
    vf at_centre, error;
} Open;

INLINE Open open_along(const TiledJob *j, const QueueEntries *w, vmask lanes)
{
    const vf end[3] = {vf_of(0), w->centre, vf_of(1)};
    vf vox[3][3], open[3];
    for (int i = 0; i < 3; i++)
        place_on(w, end[i], vox[i]);
    const OpenCell c = load_open(j, vox[1], lanes);
    for (int i = 0; i < 3; i++)
        open[i] = IS_REFERENCE ? openness_at(j, w, end[i], lanes) : open_between(j, &c, vox[i]);
    const vf change = open[2] - open[0], line = open[0] + w->centre * change;
    return (Open){open[1], (real)0.5f * vf_abs(open[1] - line) + (real)0.008f * vf_abs(change) +
                               (real)(1 / 24.0) * change * change};
}

/* Error estimate of two points of a step: the error of the halves' centroids counts by the square of the absorbed share
 * of light, the change of openness before the points of an opaque step by that share. */
INLINE vf open_error_of_two(const vf open[2], vf share)
{
    const vf change = vf_abs(open[1] - open[0]);
    return change * share * ((real)0.011f * share + (real)0.125f * change);
}
