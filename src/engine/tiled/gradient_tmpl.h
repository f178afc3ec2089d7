/* Voxels for the gradients of a cell, lane by lane, including those beyond the volume: part of shading_tmpl.h. */

/* The difference at a voxel along one axis: over two steps, or twice that over one at the border where no air is
 * beyond. */
INLINE int difference(const TiledJob *j, const uint16_t *v, int at, int axis)
{
    const int step = j->shade->step[axis];
    const ptrdiff_t away = step * j->stride[axis];
    const bool before = at >= step, after = at < j->dims[axis] - step;
    const int beyond = j->shade->air_beyond ? 0 : *v;
    if (j->dims[axis] == 1)
        return 0;
    const int rise = (after ? v[away] : beyond) - (before ? v[-away] : beyond);
    return j->shade->air_beyond || (before && after) ? rise : 2 * rise;
}

OUTLINE void load_corners_each(const TiledJob *j, const vi cell[3], vmask lanes, Corners *k)
{
    for (unsigned left = mask_bits(lanes); left; left &= left - 1)
        for (int i = 0; i < 8; i++) {
            const int l = __builtin_ctz(left);
            ptrdiff_t away = 0;
            int at[3];
            for (int a = 0; a < 3; a++) {
                at[a] = (int)cell[a][l] + (j->dims[a] > 1 ? i >> a & 1 : 0);
                away += at[a] * j->stride[a];
            }
            for (int a = 0; a < 3; a++)
                k->slope[a][i][l] = (real)difference(j, j->shown + away, at[a], a);
        }
}

#ifdef GATHERS
/* Cells whose differences all lie within the volume. */
INLINE vmask is_inner(const TiledJob *j, const vi cell[3], vmask lanes)
{
    for (int a = 0; a < 3; a++) {
        const int step = j->shade->step[a];
        lanes &= ~(vi_lt(cell[a], vi_of(step)) | vi_lt(vi_of(j->dims[a] - 2 - step), cell[a]));
    }
    return lanes;
}

INLINE vf lower(vi pair)
{
    return to_float(lower_half(pair));
}

INLINE vf upper(vi pair)
{
    return to_float(upper_half(pair));
}

OUTLINE void gather_corners(const TiledJob *j, const vi cell[3], vmask lanes, Corners *k)
{
    const vi at = voxel_of(j, cell);
    vf level[8];
    for (int z = 0; z < 2; z++)
        for (int y = 0; y < 2; y++) {
            const ptrdiff_t row = y * j->stride[1] + z * j->stride[2];
            const int i = 2 * y + 4 * z;
            const vi left = vi_gather_pairs(j->shown + row - 1, at, lanes),
                     right = vi_gather_pairs(j->shown + row + 1, at, lanes);
            level[i] = upper(left);
            level[i + 1] = lower(right);
            k->slope[0][i] = lower(right) - lower(left);
            k->slope[0][i + 1] = upper(right) - upper(left);
        }
    for (int axis = 1; axis < 3; axis++)
        for (int i = 0; i < 8; i += 2) {
            const ptrdiff_t row = (i >> 1 & 1) * j->stride[1] + (i >> 2) * j->stride[2];
            const ptrdiff_t away = j->shade->step[axis] * j->stride[axis];
            const bool low = !(i >> axis & 1), one = j->shade->step[axis] == 1;
            const int beside = i ^ 1 << axis; /* the cell's opposite voxel, if it is a step away */
            vf before[2] = {level[beside], level[beside + 1]}, after[2] = {before[0], before[1]};
            if (low || !one) {
                const vi pair = vi_gather_pairs(j->shown + row - away, at, lanes);
                before[0] = lower(pair);
                before[1] = upper(pair);
            }
            if (!low || !one) {
                const vi pair = vi_gather_pairs(j->shown + row + away, at, lanes);
                after[0] = lower(pair);
                after[1] = upper(pair);
            }
            k->slope[axis][i] = after[0] - before[0];
            k->slope[axis][i + 1] = after[1] - before[1];
        }
}
#endif

INLINE void load_corners(const TiledJob *j, const vi cell[3], vmask lanes, Corners *k)
{
#ifdef GATHERS
    const vmask inner = is_inner(j, cell, lanes);
    gather_corners(j, cell, inner, k);
    lanes &= ~inner;
#else
    memset(k, 0, sizeof *k);
#endif
    load_corners_each(j, cell, lanes, k);
}
