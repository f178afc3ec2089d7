/* The field at packets' pixels, part of march_tmpl.h: sheets and slopes, through windows or lane by lane. */

typedef struct Packet {
    double u_lane0[PACKETS], v_lane0[PACKETS]; /* first pixels, at q = 0 */
    int64_t u[PACKETS], v[PACKETS];            /* the same in 2^-32 */
    bool near;                                 /* one window holds all packets */
    bool clipped;                              /* enter and leave are known */
    double enter[LANES], leave[LANES];         /* q between which each ray is inside the box */
    Taps straight;
    bool straight_inner; /* so are the voxels around its windows */
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

/* Where the packets' first rays meet sheet t, in 2^-16 voxels: exact sums, the same however the sheets before were
 * walked. */
INLINE void sheet_start(const TiledJob *j, const Packet *pk, int t_sheet, int32_t pu[PACKETS], int32_t pv[PACKETS])
{
    for (int h = 0; h < PACKETS; h++) {
        pu[h] = (int32_t)((pk->u[h] + t_sheet * j->u_step) >> 16);
        pv[h] = (int32_t)((pk->v[h] + t_sheet * j->v_step) >> 16);
    }
}

/* How a packet's samples are taken, known when the loop is compiled. */
typedef enum Way {
    WAY_STRAIGHT, /* windows that never move */
    WAY_OBLIQUE,  /* windows that move from sheet to sheet */
    WAY_NEAR,     /* the same, one window for all packets */
    WAY_WIDE      /* pixels too far apart for windows */
} Way;

/* Compiled away but where rays run straight. */
INLINE bool in_one_window(const Packet *pk, Way way)
{
    return way == WAY_NEAR || (way == WAY_STRAIGHT && pk->near);
}

/* The packets' windows on sheet t. */
INLINE Taps sheet_taps(const TiledJob *j, const Packet *pk, Way way, int t_sheet, bool inner)
{
    int32_t pu[PACKETS], pv[PACKETS];
    sheet_start(j, pk, t_sheet, pu, pv);
    return make_taps(j, pu, pv, in_one_window(pk, way), inner);
}

/* Pixels too far apart for a window: each lane's own four voxels, weighted as in Taps. */
typedef struct Gather {
    vi at; /* offset of the first voxel inside a layer */
    vi weights;
    vf fy;
} Gather;

/* u and v: the lanes' positions, in 2^-16 voxels. */
INLINE Gather gather_at(const TiledJob *j, vi u, vi v)
{
    u = vi_min(vi_max(u, vi_of(0)), vi_of((j->nu - 1) << 16));
    v = vi_min(vi_max(v, vi_of(0)), vi_of((j->nv - 1) << 16));
    /* At the far faces u and v are whole: the voxel before, with full weight for the one behind. */
    const vi column = vi_min(u >> 16, vi_of(j->nu > 1 ? j->nu - 2 : 0));
    const vi row = vi_min(v >> 16, vi_of(j->nv > 1 ? j->nv - 2 : 0));
    const vi wx = (u - (column << 16)) >> 2;
    return (Gather){row * (int32_t)j->row_stride + column, (wx << 16) | (16384 - wx),
                    to_float(v - (row << 16)) * (1.0f / 65536)};
}

INLINE Gather find_gather(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS])
{
    return gather_at(j, lane_positions(pu, j->lane_u), lane_positions(pv, j->lane_v));
}

INLINE vf load_gather(const TiledJob *j, const Gather *s, const uint16_t *layer)
{
    const vf a = to_float(weigh_pairs(layer, s->at, s->weights));
    const vf b = to_float(weigh_pairs(layer + j->row_stride, s->at, s->weights));
    return (a + s->fy * (b - a)) * (1.0f / 16384) + 32768.0f;
}

/* The same where offsets or positions do not fit 32 bits. */
OUTLINE vf sample_lanes(const TiledJob *j, const Packet *pk, const uint16_t *layer, double q)
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

/* Layers lie farther apart than what processors fetch by themselves: asks for the voxels that rays meet some layers
 * ahead. */
INLINE void fetch_ahead(const TiledJob *j, const Taps *t, ptrdiff_t offset)
{
    enum { ROWS = 4 };
    const uint16_t *p = t->at[0] + (offset + j->fetch_ahead);
    for (int row = 0; row < ROWS; row++)
        __builtin_prefetch(p + row * j->row_stride);
}

/* The field on the sheet a fraction part / samples behind layer q. */
INLINE vf sample_sheet(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    const Taps *t = &pk->straight;
    const ptrdiff_t offset = q * j->layer_stride;
    vf here, next;
    const uint16_t *layer = j->layer0 + offset;
    if (way == WAY_WIDE && j->gathers) {
        int32_t pu[PACKETS], pv[PACKETS];
        sheet_start(j, pk, q * j->samples + part, pu, pv);
        const Gather gather = find_gather(j, pu, pv);
        here = load_gather(j, &gather, layer);
        if (part == 0)
            return here;
        next = load_gather(j, &gather, layer + j->layer_stride);
    } else if (way == WAY_WIDE) {
        const double at = q + (double)part / j->samples;
        here = sample_lanes(j, pk, layer, at);
        if (part == 0)
            return here;
        next = sample_lanes(j, pk, layer + j->layer_stride, at);
    } else {
        if (way != WAY_STRAIGHT) {
            made = sheet_taps(j, pk, way, q * j->samples + part, inner);
            t = &made;
        }
        here = load_window(t, offset, j->row_stride);
        if (part == 0) {
            fetch_ahead(j, t, offset);
            return here;
        }
        next = load_window(t, offset + j->layer_stride, j->row_stride);
    }
    return here + ((float)part / (float)j->samples) * (next - here);
}

/* Where each ray is inside the box of voxel centres; wanted only for slabs that the faces cut. */
OUTLINE void clip_packet(const TiledJob *j, Packet *pk)
{
    for (int l = 0; l < LANES; l++)
        cts_tiled_clip(j, lane_u0(j, pk, l), lane_v0(j, pk, l), &pk->enter[l], &pk->leave[l]);
    pk->clipped = true;
}

/* Whether windows at the lanes' positions, and the voxels around them, are inside the volume. */
INLINE bool differences_inner(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS])
{
    const int32_t u7 = j->lane_u[7], v7 = j->lane_v[7], du = j->shade->step[0], dv = j->shade->step[1];
    bool inner = true;
    for (int h = 0; h < PACKETS; h++)
        inner &= pu[h] + (u7 < 0 ? u7 : 0) >= du * 65536 && pu[h] + (u7 > 0 ? u7 : 0) < (j->window_u - du) * 65536 &&
                 pv[h] + (v7 < 0 ? v7 : 0) >= dv * 65536 && pv[h] + (v7 > 0 ? v7 : 0) < (j->window_v - dv) * 65536;
    return inner;
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
    if (j->windowed && j->straight) {
        int32_t pu[PACKETS], pv[PACKETS];
        sheet_start(j, pk, 0, pu, pv);
        pk->straight = make_taps(j, pu, pv, pk->near, false);
        pk->straight_inner = j->shade && differences_inner(j, pu, pv);
    }
}

/* One lane's differences as load_differences() has them, from u and v in 2^-16 voxels; at the volume's faces to air, or
 * one-sided. */
OUTLINE void lane_difference(const TiledJob *j, int64_t u, int64_t v, int q, float g[3])
{
    const int n[3] = {j->nu, j->nv, j->nk}, *const step = j->shade->step;
    const ptrdiff_t stride[3] = {1, j->row_stride, j->layer_stride};
    const int64_t far_u = (int64_t)(j->nu - 1) << 16, far_v = (int64_t)(j->nv - 1) << 16;
    u = u < 0 ? 0 : u > far_u ? far_u : u;
    v = v < 0 ? 0 : v > far_v ? far_v : v;
    const int column = j->nu > 1 && u == far_u ? j->nu - 2 : (int)(u >> 16);
    const int row = j->nv > 1 && v == far_v ? j->nv - 2 : (int)(v >> 16);
    const int w1 = (int)(u - ((int64_t)column << 16)) >> 2, w0 = 16384 - w1;
    const float fy = (float)(int32_t)(v - ((int64_t)row << 16)) * (1.0f / 65536);
    for (int axis = 0; axis < 3; axis++) {
        int d[4];
        for (int corner = 0; corner < 4; corner++) {
            const int at[3] = {column + (j->nu > 1 ? corner & 1 : 0), row + (j->nv > 1 ? corner >> 1 : 0), q};
            const uint16_t *p = j->layer0 + at[0] + at[1] * stride[1] + at[2] * stride[2];
            const bool back = at[axis] >= step[axis], on = at[axis] < n[axis] - step[axis], air = j->shade->air_beyond;
            const ptrdiff_t away = step[axis] * stride[axis];
            const int before = back ? p[-away] : air ? 0 : p[0], after = on ? p[away] : air ? 0 : p[0];
            d[corner] = (after - before) * ((back && on) || air ? 1 : 2);
        }
        const float upper = (float)(d[0] * w0 + d[1] * w1), lower = (float)(d[2] * w0 + d[3] * w1);
        g[axis] = upper + fy * (lower - upper);
    }
}

/* The field's differences on a sheet, along u, v and from layer to layer. */
typedef struct Differences {
    vf u, v, k;
} Differences;

/* On layer q, lane by lane, where the packets' rays cross the sheet a fraction part / samples behind layer `from`. */
OUTLINE Differences differences_by_lane(const TiledJob *j, const Packet *pk, int q, int from, int part)
{
    Differences d;
    const double at = from + (double)part / j->samples;
    int32_t pu[PACKETS], pv[PACKETS];
    sheet_start(j, pk, from * j->samples + part, pu, pv);
    for (int l = 0; l < LANES; l++) {
        const int h = l / CTS_PACKET, i = l % CTS_PACKET;
        const bool fits = j->windowed || j->gathers;
        float lane[3];
        const int64_t u = fits ? pu[h] + j->lane_u[i] : (int64_t)floor((lane_u0(j, pk, l) + at * j->u_at[3]) * 65536);
        const int64_t v = fits ? pv[h] + j->lane_v[i] : (int64_t)floor((lane_v0(j, pk, l) + at * j->v_at[3]) * 65536);
        lane_difference(j, u, v, q, lane);
        d.u[l] = lane[0];
        d.v[l] = lane[1];
        d.k[l] = lane[2];
    }
    return d;
}

/* Two places on either side of others, for each lane, where there are such. */
typedef struct Beside {
    const uint16_t *before, *after; /* layers */
    vi before_at, after_at;         /* offsets of pairs of voxels in them, */
    vi before_weights, after_weights;
    vmask back, on; /* where the place before is in the volume, and the one after */
    vi none;        /* the weighted sum of air */
} Beside;

/* Between the weighted sums of the pairs; at a face to air, or one-sided and doubled. */
INLINE vi change_between(const TiledJob *j, const Beside *b)
{
    const vi before = weigh_pairs(b->before, b->before_at, b->before_weights);
    const vi after = weigh_pairs(b->after, b->after_at, b->after_weights);
    if (j->shade->air_beyond)
        return select_i(b->on, after, b->none) - select_i(b->back, before, b->none);
    const vi d = after - before;
    return d + select_i(mask_and(b->back, b->on), vi_of(0), d);
}

/* Of one column, c columns from the lanes' own, which has this weight. No pair reaches beyond its row. */
INLINE vi change_across(const TiledJob *j, const uint16_t *layer, vi at, vi column, int c, vi weight)
{
    const int step = j->shade->step[0];
    const vi low = weight, high = weight << 16, here = at + c;
    const vf place = to_float(column + c);
    Beside b = {.before = layer, .after = layer, .none = -32768 * weight};
    b.back = vf_le(vf_of((float)step), place);
    b.on = vf_lt(place, vf_of((float)(j->nu - step)));
    /* Where nothing is beside it, the place itself. */
    const vi own_at = at, own_weights = c ? high : low;
    b.before_at = select_i(b.back, here - step, own_at);
    b.before_weights = select_i(b.back, low, own_weights);
    b.after_at = select_i(b.on, here + (step - 1), own_at);
    b.after_weights = select_i(b.on, high, own_weights);
    return change_between(j, &b);
}

/* differences_by_lane() for all lanes at once, where offsets and positions fit 32 bits. */
OUTLINE Differences differences_at_faces(const TiledJob *j, const Packet *pk, int q, int from, int part)
{
    const int *const step = j->shade->step, row_stride = (int)j->row_stride;
    int32_t pu[PACKETS], pv[PACKETS];
    sheet_start(j, pk, from * j->samples + part, pu, pv);
    const vi far_u = vi_of((j->nu - 1) << 16), far_v = vi_of((j->nv - 1) << 16);
    const vi u = vi_min(vi_max(lane_positions(pu, j->lane_u), vi_of(0)), far_u);
    const vi v = vi_min(vi_max(lane_positions(pv, j->lane_v), vi_of(0)), far_v);
    const vi column = vi_min(u >> 16, vi_of(j->nu > 1 ? j->nu - 2 : 0));
    const vi row = vi_min(v >> 16, vi_of(j->nv > 1 ? j->nv - 2 : 0));
    const vi w1 = (u - (column << 16)) >> 2, w0 = 16384 - w1, weights = (w1 << 16) | w0;
    const vf fy = to_float(v - (row << 16)) * (1.0f / 65536);
    const uint16_t *const layer = j->layer0 + q * j->layer_stride;
    const bool back = q >= step[2], on = q < j->nk - step[2];
    const vmask all = vi_eq(u, u), no = vf_lt(fy, fy);
    vf rows[3][2]; /* of each axis, of the two rows */
    for (int r = 0; r < 2; r++) {
        const vi line = row + (j->nv > 1 ? r : 0), at = line * row_stride + column;
        const vf place = to_float(line);
        rows[0][r] = to_float(change_across(j, layer, at, column, 0, w0) + change_across(j, layer, at, column, 1, w1));
        Beside b = {.before = layer, .after = layer, .none = vi_of(-BIAS)};
        b.before_weights = b.after_weights = weights;
        b.back = vf_le(vf_of((float)step[1]), place);
        b.on = vf_lt(place, vf_of((float)(j->nv - step[1])));
        b.before_at = select_i(b.back, at - step[1] * row_stride, at);
        b.after_at = select_i(b.on, at + step[1] * row_stride, at);
        rows[1][r] = to_float(change_between(j, &b));
        b.before_at = b.after_at = at;
        b.before = back ? layer - step[2] * j->layer_stride : layer;
        b.after = on ? layer + step[2] * j->layer_stride : layer;
        b.back = back ? all : no;
        b.on = on ? all : no;
        rows[2][r] = to_float(change_between(j, &b));
    }
    return (Differences){rows[0][0] + fy * (rows[0][1] - rows[0][0]), rows[1][0] + fy * (rows[1][1] - rows[1][0]),
                         rows[2][0] + fy * (rows[2][1] - rows[2][0])};
}

/* Anywhere. */
INLINE Differences differences_outside(const TiledJob *j, const Packet *pk, int q, int from, int part)
{
    return j->narrow_offsets ? differences_at_faces(j, pk, q, from, part) : differences_by_lane(j, pk, q, from, part);
}

INLINE vf gather_difference(const TiledJob *j, const Gather *s, const uint16_t *minus, const uint16_t *plus)
{
    const ptrdiff_t row = j->row_stride;
    const vf a = to_float(weigh_pairs(plus, s->at, s->weights) - weigh_pairs(minus, s->at, s->weights));
    const vf b = to_float(weigh_pairs(plus + row, s->at, s->weights) - weigh_pairs(minus + row, s->at, s->weights));
    return a + s->fy * (b - a);
}

INLINE vf gather_level(const TiledJob *j, const Gather *s, const uint16_t *layer)
{
    const vf a = to_float(weigh_pairs(layer, s->at, s->weights) + BIAS);
    const vf b = to_float(weigh_pairs(layer + j->row_stride, s->at, s->weights) + BIAS);
    return a + s->fy * (b - a);
}

/* The same through windows or, where there are none, from gather, which must be inner. */
INLINE Differences differences(const TiledJob *j, const Taps *t, const Gather *gather, int q)
{
    const int *const step = j->shade->step;
    const bool back = q >= step[2], on = q < j->nk - step[2];
    const ptrdiff_t at = q * j->layer_stride, row = j->row_stride;
    const ptrdiff_t away[3] = {step[0], step[1] * row, step[2] * j->layer_stride};
    const ptrdiff_t minus[3] = {at - away[0], at - away[1], back ? at - away[2] : at};
    const ptrdiff_t plus[3] = {at + away[0], at + away[1], on ? at + away[2] : at};
    vf d[3];
    if (gather)
        for (int axis = 0; axis < 3; axis++)
            d[axis] = gather_difference(j, gather, j->layer0 + minus[axis], j->layer0 + plus[axis]);
    else
        load_differences(t, minus, plus, row, j->narrow, d);
    if (back != on && !j->shade->air_beyond) {
        d[2] = 2 * d[2];
    } else if (back != on) {
        const ptrdiff_t beside = back ? minus[2] : plus[2];
        d[2] =
            (back ? -1.0f : 1.0f) * (gather ? gather_level(j, gather, j->layer0 + beside) : load_level(t, beside, row));
    }
    return (Differences){d[0], d[1], d[2]};
}

/* The gradient to the right, up and along the view, times one and the same factor everywhere. */
typedef struct Slope {
    vf right, up, along;
} Slope;

INLINE Slope slope_of(const TiledJob *j, const Differences *d)
{
    const float(*const f)[3] = j->frame;
    return (Slope){f[0][0] * d->u + f[0][1] * d->v + f[0][2] * d->k, f[1][0] * d->u + f[1][1] * d->v + f[1][2] * d->k,
                   f[2][0] * d->u + f[2][1] * d->v + f[2][2] * d->k};
}

/* On the sheet a fraction part / samples behind layer q. inner: that much is known of the whole beam. */
INLINE Slope slope_at(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    Gather found;
    const Taps *t = &pk->straight;
    const Gather *gather = NULL;
    if (way == WAY_STRAIGHT) {
        inner = pk->straight_inner;
    } else if (way != WAY_WIDE || j->gathers) {
        int32_t pu[PACKETS], pv[PACKETS];
        sheet_start(j, pk, q * j->samples + part, pu, pv);
        inner = inner || differences_inner(j, pu, pv);
        if (way == WAY_WIDE) {
            found = find_gather(j, pu, pv);
            gather = &found;
        } else if (inner) {
            made = make_taps(j, pu, pv, in_one_window(pk, way), true);
            t = &made;
        }
    } else {
        inner = false;
    }
    Differences d = inner ? differences(j, t, gather, q) : differences_outside(j, pk, q, q, part);
    if (part > 0) {
        const vf f = vf_of((float)part / (float)j->samples);
        const Differences next = inner ? differences(j, t, gather, q + 1) : differences_outside(j, pk, q + 1, q, part);
        d.u += (next.u - d.u) * f;
        d.v += (next.v - d.v) * f;
        d.k += (next.k - d.k) * f;
    }
    return slope_of(j, &d);
}
