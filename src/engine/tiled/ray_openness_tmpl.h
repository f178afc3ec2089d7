/* Openness along segments of rays: part of shading_tmpl.h. */

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
    const OpenCell c = load_open(j->open, vox, lanes);
    return open_between(j->open, &c, vox);
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
    const OpenCell c = load_open(j->open, vox[1], lanes);
    for (int i = 0; i < 3; i++)
        open[i] = IS_REFERENCE ? openness_at(j, w, end[i], lanes) : open_between(j->open, &c, vox[i]);
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
