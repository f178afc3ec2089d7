/* The field at packets' pixels, part of tiled_tmpl.h: sheets and slopes, through windows or lane by lane. */

typedef struct Packet {
    double u_lane0[PACKETS], v_lane0[PACKETS]; /* first pixels, at q = 0 */
    int64_t u[PACKETS], v[PACKETS];            /* the same in 2^-32 */
    bool near;                                 /* one window holds all packets */
    bool clipped;                              /* enter and leave are known */
    double enter[LANES], leave[LANES];         /* q between which each ray is inside the box */
    Taps straight;
} Packet;

/* Where lane l's ray meets layer q = 0. */
INLINE double lane_u0(const TiledJob *j, const Packet *pk, int l)
{
    return pk->u_lane0[l / CTS_PACKET] + l % CTS_PACKET * j->u_at[1];
}

INLINE double lane_v0(const TiledJob *j, const Packet *pk, int l)
{
    return pk->v_lane0[l / CTS_PACKET] + l % CTS_PACKET * j->v_at[1];
}

/* The packets' windows on sheet t. Positions are in 2^-16 voxels, so they are exact sums, the same however the sheets
 * before were walked. */
INLINE Taps sheet_taps(const TiledJob *j, const Packet *pk, int t_sheet, bool inner)
{
    int32_t pu[PACKETS], pv[PACKETS];
    for (int h = 0; h < PACKETS; h++) {
        pu[h] = (int32_t)((pk->u[h] + t_sheet * j->u_step) >> 16);
        pv[h] = (int32_t)((pk->v[h] + t_sheet * j->v_step) >> 16);
    }
    return make_taps(j, pu, pv, pk->near, inner);
}

/* Pixels too far apart for a window: each lane reads its own four voxels. */
INLINE vf sample_wide(const TiledJob *j, const Packet *pk, const uint16_t *layer, double q)
{
    vf s;
    for (int l = 0; l < LANES; l++) {
        double u = lane_u0(j, pk, l) + q * j->u_at[3], v = lane_v0(j, pk, l) + q * j->v_at[3];
        u = u < 0 ? 0 : u > j->nu - 1 ? j->nu - 1 : u;
        v = v < 0 ? 0 : v > j->nv - 1 ? j->nv - 1 : v;
        const int iu = u >= j->nu - 1 && j->nu > 1 ? j->nu - 2 : (int)u;
        const int iv = v >= j->nv - 1 && j->nv > 1 ? j->nv - 2 : (int)v;
        const float fu = (float)(u - iu), fv = (float)(v - iv);
        const uint16_t *p = layer + iv * j->row_stride + iu;
        const float a = (float)p[0] + fu * (float)(p[1] - p[0]);
        const float b = (float)p[j->row_stride] + fu * (float)(p[j->row_stride + 1] - p[j->row_stride]);
        s[l] = a + fv * (b - a);
    }
    return s;
}

/* How a packet's samples are taken, known when the loop is compiled. */
typedef enum Way {
    WAY_STRAIGHT, /* windows that never move */
    WAY_OBLIQUE,  /* windows that move from sheet to sheet */
    WAY_WIDE      /* pixels too far apart for windows */
} Way;

/* The field on the sheet a fraction part / samples behind layer q. */
INLINE vf sample_sheet(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    const Taps *t = &pk->straight;
    const ptrdiff_t offset = q * j->layer_stride;
    vf here, next;
    if (way == WAY_WIDE) {
        const double at = q + (double)part / j->samples;
        here = sample_wide(j, pk, j->layer0 + offset, at);
        if (part == 0)
            return here;
        next = sample_wide(j, pk, j->layer0 + offset + j->layer_stride, at);
    } else {
        if (way == WAY_OBLIQUE) {
            made = sheet_taps(j, pk, q * j->samples + part, inner);
            t = &made;
        }
        here = load_window(t, offset, j->row_stride);
        if (part == 0)
            return here;
        next = load_window(t, offset + j->layer_stride, j->row_stride);
    }
    return here + ((float)part / (float)j->samples) * (next - here);
}

/* Where each ray is inside the box of voxel centres; wanted only for slabs that the faces cut. */
OUTLINE void clip_packet(const TiledJob *j, Packet *pk)
{
    for (int l = 0; l < LANES; l++)
        tiled_clip(j, lane_u0(j, pk, l), lane_v0(j, pk, l), &pk->enter[l], &pk->leave[l]);
    pk->clipped = true;
}

INLINE void init_packet(const TiledJob *j, Packet *pk, const TiledSpan spans[PACKETS])
{
    for (int h = 0; h < PACKETS; h++) {
        pk->u_lane0[h] = j->u_at[0] + j->u_at[1] * spans[h].x + j->u_at[2] * spans[h].y;
        pk->v_lane0[h] = j->v_at[0] + j->v_at[1] * spans[h].x + j->v_at[2] * spans[h].y;
        pk->u[h] = (int64_t)floor(pk->u_lane0[h] * 4294967296.0 + 0.5);
        pk->v[h] = (int64_t)floor(pk->v_lane0[h] * 4294967296.0 + 0.5);
    }
    pk->near = spans[PACKETS - 1].y - spans[0].y <= j->one_window_rows;
    pk->clipped = false;
    if (j->windowed && j->straight)
        pk->straight = sheet_taps(j, pk, 0, false);
}

/* Grey level differences of one lane, doubled derivatives as shade.h wants them, voxel by voxel: at the volume's faces
 * one-sided. */
OUTLINE void lane_gradient(const TiledJob *j, double u, double v, int q, float g[3])
{
    u = u < 0 ? 0 : u > j->nu - 1 ? j->nu - 1 : u;
    v = v < 0 ? 0 : v > j->nv - 1 ? j->nv - 1 : v;
    const int n[3] = {j->nu, j->nv, j->nk};
    const int iu = j->nu > 1 && u >= j->nu - 1 ? j->nu - 2 : (int)u,
              iv = j->nv > 1 && v >= j->nv - 1 ? j->nv - 2 : (int)v;
    const float fu = (float)(u - iu), fv = (float)(v - iv);
    const ptrdiff_t stride[3] = {1, j->row_stride, j->layer_stride};
    g[0] = g[1] = g[2] = 0;
    for (int corner = 0; corner < 4; corner++) {
        const int cu = corner & 1, cv = corner >> 1;
        const float weight = (cu ? fu : 1 - fu) * (cv ? fv : 1 - fv);
        const int at[3] = {iu + (j->nu > 1 ? cu : 0), iv + (j->nv > 1 ? cv : 0), q};
        const uint16_t *p = j->layer0 + at[0] + at[1] * stride[1] + at[2] * stride[2];
        for (int axis = 0; axis < 3; axis++) {
            const int back = at[axis] > 0, on = at[axis] < n[axis] - 1;
            if (back || on)
                g[axis] += weight * (float)((p[on * stride[axis]] - p[-back * stride[axis]]) * (back && on ? 1 : 2));
        }
    }
}

/* The field's differences on a sheet, along u, v and the volume's layers. */
typedef struct Slope {
    vf u, v, k;
} Slope;

/* On layer q, where the packet's rays cross the sheet a fraction part / samples behind layer `from`. */
INLINE Slope slope_on_layer(const TiledJob *j, const Packet *pk, Way way, const Taps *t, int q, int from, int part,
                            bool inner)
{
    Slope g;
    if (way == WAY_WIDE || !inner) {
        const double at = from + (double)part / j->samples;
        for (int l = 0; l < LANES; l++) {
            float lane[3];
            lane_gradient(j, lane_u0(j, pk, l) + at * j->u_at[3], lane_v0(j, pk, l) + at * j->v_at[3], q, lane);
            g.u[l] = lane[0];
            g.v[l] = lane[1];
            g.k[l] = lane[2];
        }
    } else {
        /* Away from the faces a difference of interpolated values is the interpolated difference. */
        const ptrdiff_t offset = q * j->layer_stride, row = j->row_stride;
        const int back = q > 0, on = q < j->nk - 1;
        g.u = load_window(t, offset + 1, row) - load_window(t, offset - 1, row);
        g.v = load_window(t, offset + row, row) - load_window(t, offset - row, row);
        g.k = load_window(t, offset + on * j->layer_stride, row) - load_window(t, offset - back * j->layer_stride, row);
        if (back + on == 1)
            g.k = 2 * g.k;
    }
    if (!j->rising)
        g.k = -g.k;
    return g;
}

INLINE Slope mix_slope(const Slope *a, const Slope *b, vf f)
{
    return (Slope){a->u + (b->u - a->u) * f, a->v + (b->v - a->v) * f, a->k + (b->k - a->k) * f};
}

INLINE Slope select_slope(vmask mask, const Slope *yes, const Slope *no)
{
    return (Slope){select_f(mask, yes->u, no->u), select_f(mask, yes->v, no->v), select_f(mask, yes->k, no->k)};
}

OUTLINE Slope slope_at(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    const Taps *t = &pk->straight;
    if (way == WAY_OBLIQUE) {
        made = sheet_taps(j, pk, q * j->samples + part, inner);
        t = &made;
    }
    const Slope here = slope_on_layer(j, pk, way, t, q, q, part, inner);
    if (part == 0)
        return here;
    const Slope next = slope_on_layer(j, pk, way, t, q + 1, q, part, inner);
    return mix_slope(&here, &next, vf_of((float)part / (float)j->samples));
}
