/* Where a packet's 8 rays meet a sheet: two windows of 8 x 3 voxels, one for each half of the packet. */
#ifndef CTS_TILED_TAPS_TMPL_H
#define CTS_TILED_TAPS_TMPL_H

#include "engine/tiled/vec_tmpl.h"

typedef int32_t vi_u __attribute__((vector_size(32), aligned(4))); /* for loads from plain arrays */

/* Positions of a packet's lanes, offsets from `first`, in 2^-16 voxels. */
INLINE vi lane_positions(const int32_t first[PACKETS], const int32_t lanes[CTS_PACKET])
{
    return first[0] + *(const vi_u *)lanes;
}

typedef struct Taps {
    const uint16_t *at[2]; /* first voxel of each half packet's window, in layer q = 0 */
    vi pick, row1;         /* what finds the column x0 in the window; all ones where the upper row is its second */
    vi weights;            /* 14-bit weights of columns x0 and x0 + 1, packed as two int16 */
    vf fy;
} Taps;

/* The windows for a packet whose first pixel is at (pu, pv), in 2^-16 voxels. inner: all of it is far enough from the
 * volume's faces to need no clamping. */
INLINE Taps make_taps(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS], bool one, bool inner)
{
    Taps t;
    (void)one;
    const vi half_u = *(const vi_u *)j->half_u, half_v = *(const vi_u *)j->half_v;
    vi u = lane_positions(pu, j->lane_u), v = lane_positions(pv, j->lane_v);
    vi iu = (pu[0] + half_u) >> 16, iv = (pv[0] + half_v) >> 16;
    int cu[2] = {(pu[0] + j->half_u[0]) >> 16, (pu[0] + j->half_u[4]) >> 16};
    int cv[2] = {(pv[0] + j->half_v[0]) >> 16, (pv[0] + j->half_v[4]) >> 16};
    if (!inner) {
        u = vi_min(vi_max(u, vi_of(0)), vi_of((j->nu - 1) << 16));
        v = vi_min(vi_max(v, vi_of(0)), vi_of((j->nv - 1) << 16));
        iu = vi_min(vi_max(iu, vi_of(0)), vi_of(j->window_u));
        iv = vi_min(vi_max(iv, vi_of(0)), vi_of(j->window_v));
        for (int h = 0; h < 2; h++) {
            cu[h] = clamp_int(cu[h], 0, j->window_u);
            cv[h] = clamp_int(cv[h], 0, j->window_v);
        }
    }
    t.at[0] = j->layer0 + cv[0] * j->row_stride + cu[0];
    t.at[1] = j->layer0 + cv[1] * j->row_stride + cu[1];
    /* At the far face u is whole and its column would be the window's last: take the one before, with full weight. */
    const vi x0 = vi_min((u >> 16) - iu, vi_of(6));
    const vi wx = (u - ((x0 + iu) << 16)) >> 2;
    t.pick = make_pick(x0);
    t.weights = (wx << 16) | (16384 - wx);
    v -= iv << 16;
    t.row1 = v >= vi_of(1 << 16);
    t.fy = to_float(v + (t.row1 << 16)) * (1.0f / 65536);
    return t;
}

#endif
