/* The march of one packet, in vectors of 8 pixels. Included by tiled_c.c and tiled_avx2.c, which first define
 * v8f_min, v8f_max, v8i_min, v8i_max, v8_any, v8_all, load_window and lookup8; everything else is element-wise and the
 * same in both. */

typedef struct Packet {
    double u_lane0, v_lane0;                     /* first pixel, at q = 0 */
    int64_t u, v;                                /* the same in 2^-32 */
    bool clipped;                                /* enter and leave are known */
    double enter[CTS_PACKET], leave[CTS_PACKET]; /* q between which each ray is inside the box */
    Taps straight;
} Packet;

INLINE v8f select8(v8i mask, v8f yes, v8f no)
{
    return (v8f)((mask & (v8i)yes) | (~mask & (v8i)no));
}

INLINE v8f v8f_abs(v8f a)
{
    return (v8f)((v8i)a & 0x7fffffff);
}

INLINE v8f splat8(float x)
{
    return (v8f){x, x, x, x, x, x, x, x};
}

/* 1 - exp(-d) for d >= 0, relative error about 1e-7 down to d = 0: with d = n ln 2 + f it is
 * (1 - 2^-n) - 2^-n (exp(-f) - 1). */
INLINE v8f one_minus_exp(v8f d)
{
    d = v8f_min(d, splat8(80.0f));
    const v8i n = __builtin_convertvector(d * 1.44269504f + 0.5f, v8i);
    const v8f nf = __builtin_convertvector(n, v8f);
    const v8f f = (d - nf * 0.693359375f) - nf * -2.12194440e-4f;
    v8f p = f * (1.0f / 5040) - (1.0f / 720);
    p = p * f + (1.0f / 120);
    p = p * f - (1.0f / 24);
    p = p * f + (1.0f / 6);
    p = p * f - 0.5f;
    p = (p * f + 1.0f) * f; /* 1 - exp(-f) */
    const v8f power = (v8f)((127 - n) << 23);
    return (1.0f - power) + power * p;
}

INLINE v8i splat8i(int32_t x)
{
    return (v8i){x, x, x, x, x, x, x, x};
}

INLINE int clamp_int(int x, int low, int high)
{
    return x < low ? low : x > high ? high : x;
}

/* The packet's windows on sheet t. Positions are in 2^-16 voxels, so they are exact sums, the same however the
 * sheets before were walked. inner: all of it is far enough from the volume's faces to need no clamping. */
INLINE Taps make_taps(const TiledJob *j, const Packet *pk, int t_sheet, bool inner)
{
    Taps t;
    const int32_t pu = (int32_t)((pk->u + t_sheet * j->u_step) >> 16),
                  pv = (int32_t)((pk->v + t_sheet * j->v_step) >> 16);
    const v8i half_u = *(const v8i_u *)j->half_u, half_v = *(const v8i_u *)j->half_v;
    v8i u = splat8i(pu) + *(const v8i_u *)j->lane_u, v = splat8i(pv) + *(const v8i_u *)j->lane_v;
    v8i iu = (splat8i(pu) + half_u) >> 16, iv = (splat8i(pv) + half_v) >> 16;
    int cu[2] = {(pu + j->half_u[0]) >> 16, (pu + j->half_u[4]) >> 16};
    int cv[2] = {(pv + j->half_v[0]) >> 16, (pv + j->half_v[4]) >> 16};
    if (!inner) {
        u = v8i_min(v8i_max(u, splat8i(0)), splat8i((j->nu - 1) << 16));
        v = v8i_min(v8i_max(v, splat8i(0)), splat8i((j->nv - 1) << 16));
        iu = v8i_min(v8i_max(iu, splat8i(0)), splat8i(j->window_u));
        iv = v8i_min(v8i_max(iv, splat8i(0)), splat8i(j->window_v));
        for (int h = 0; h < 2; h++) {
            cu[h] = clamp_int(cu[h], 0, j->window_u);
            cv[h] = clamp_int(cv[h], 0, j->window_v);
        }
    }
    t.at[0] = j->layer0 + cv[0] * j->row_stride + cu[0];
    t.at[1] = j->layer0 + cv[1] * j->row_stride + cu[1];
    /* At the far face u is whole and its column would be the window's last: take the one before, with full weight. */
    const v8i x0 = v8i_min((u >> 16) - iu, splat8i(6));
    const v8i wx = (u - ((x0 + iu) << 16)) >> 2;
    t.pick = make_pick(x0);
    t.weights = (wx << 16) | (16384 - wx);
    v -= iv << 16;
    t.row1 = v >= splat8i(1 << 16);
    t.fy = __builtin_convertvector(v + (t.row1 << 16), v8f) * (1.0f / 65536);
    return t;
}

/* Pixels too far apart for a window: each lane reads its own four voxels. */
INLINE v8f sample_wide(const TiledJob *j, const Packet *pk, const uint16_t *layer, double q)
{
    v8f s;
    for (int l = 0; l < CTS_PACKET; l++) {
        double u = pk->u_lane0 + l * j->u_at[1] + q * j->u_at[3], v = pk->v_lane0 + l * j->v_at[1] + q * j->v_at[3];
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
INLINE v8f sample_sheet(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    const Taps *t = &pk->straight;
    const ptrdiff_t offset = q * j->layer_stride;
    v8f here, next;
    if (way == WAY_WIDE) {
        const double at = q + (double)part / j->samples;
        here = sample_wide(j, pk, j->layer0 + offset, at);
        if (part == 0)
            return here;
        next = sample_wide(j, pk, j->layer0 + offset + j->layer_stride, at);
    } else {
        if (way == WAY_OBLIQUE) {
            made = make_taps(j, pk, q * j->samples + part, inner);
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
    for (int l = 0; l < CTS_PACKET; l++)
        tiled_clip(j, pk->u_lane0 + l * j->u_at[1], pk->v_lane0 + l * j->v_at[1], &pk->enter[l], &pk->leave[l]);
    pk->clipped = true;
}

INLINE void init_packet(const TiledJob *j, Packet *pk, int x, int y)
{
    pk->u_lane0 = j->u_at[0] + j->u_at[1] * x + j->u_at[2] * y;
    pk->v_lane0 = j->v_at[0] + j->v_at[1] * x + j->v_at[2] * y;
    pk->u = (int64_t)floor(pk->u_lane0 * 4294967296.0 + 0.5);
    pk->v = (int64_t)floor(pk->v_lane0 * 4294967296.0 + 0.5);
    pk->clipped = false;
    if (j->windowed && j->straight)
        pk->straight = make_taps(j, pk, 0, false);
}

typedef struct Light {
    v8f r, g, b, a, t; /* premultiplied colour and opacity gathered, transmittance left: 1 - a loses small a */
    v8f depth;         /* q of the first visible surface, -1: none */
} Light;

/* The first visible surface: where half of the light is lost, or the first that is seen at all. */
INLINE void note_depth(Light *light, v8f t_before, float q)
{
    const v8i first = (light->depth < 0) & (light->t < t_before), half = (t_before > 0.5f) & (light->t <= 0.5f);
    light->depth = select8(first | half, splat8(q), light->depth);
}

typedef struct Entry {
    v8i index;      /* of the table; not clamped below */
    v8i r, g, b, k; /* the table's sums there */
} Entry;

INLINE void look_up(const TiledJob *j, v8f s, Entry *e)
{
    const CtsSlabTable *t = &j->table;
    /* The shift keeps the conversion's truncation away from negative numbers. */
    const v8f x = v8f_max((s - t->grey_low) * t->per_grey, splat8(-1e6f)) + 1e6f;
    e->index = __builtin_convertvector(x + 0.5f, v8i) - 1000000;
    lookup8(t->sum, t->n, e->index, &e->r, &e->g, &e->b, &e->k);
}

/* Lighting of the sheet on layer `layer`: what colour is multiplied with, and the white added to it. */
typedef struct Glow {
    v8f colour, white;
} Glow;

/* One slab from entry a to entry b, length_mm long for each lane. With d levels between the entries and an integral of
 * k over them, depth = length * k / d, and the colour integral weighs alpha / depth: one division serves both. */
INLINE void add_slab(const TiledJob *j, Light *light, const Entry *a, const Entry *b, v8f length_mm, const Glow *glow)
{
    const CtsSlabTable *t = &j->table;
    const v8i n = b->index - a->index, sign = n < 0, flat = n == 0;
    /* All have the sign of the field's change. */
    v8f nf = __builtin_convertvector((n ^ sign) - sign, v8f);
    v8f r = __builtin_convertvector(((b->r - a->r) ^ sign) - sign, v8f);
    v8f g = __builtin_convertvector(((b->g - a->g) ^ sign) - sign, v8f);
    v8f b8 = __builtin_convertvector(((b->b - a->b) ^ sign) - sign, v8f);
    v8f k = __builtin_convertvector(((b->k - a->k) ^ sign) - sign, v8f);
    if (v8_any(flat)) {
        /* The field does not change: the integrand itself, over one step of the table. */
        Entry here = {.index = a->index + 1};
        lookup8(t->step, t->n, here.index, &here.r, &here.g, &here.b, &here.k);
        nf = select8(flat, splat8(1), nf);
        r = select8(flat, (v8f)here.r, r);
        g = select8(flat, (v8f)here.g, g);
        b8 = select8(flat, (v8f)here.b, b8);
        k = select8(flat, (v8f)here.k, k);
    }
    /* Without depth there is no colour either. */
    const v8f kf = v8f_max(k, splat8(1e-12f));
    const v8f inverse = 1.0f / (nf * kf);
    const v8f depth = (k * kf) * inverse * (t->depth_scale * length_mm);
    const v8f alpha = CTS_MUTATED(ATTENUATION) ? v8f_min(depth, splat8(1)) : one_minus_exp(depth);
    const v8f weight = light->t * alpha * (nf * inverse) * t->colour_per_depth;
    r *= weight;
    g *= weight;
    b8 *= weight;
    const v8f lost = light->t * alpha;
    if (glow) {
        const v8f white = lost * glow->white;
        r = r * glow->colour + white;
        g = g * glow->colour + white;
        b8 = b8 * glow->colour + white;
    }
    light->r += r;
    light->g += g;
    light->b += b8;
    light->a += lost;
    light->t -= lost;
}

/* Length inside the box of each lane's way from sheet position from to position to, in layers. */
INLINE v8f slab_length(const TiledJob *j, const TiledBeam *beam, Packet *pk, int q, float whole_mm, double from,
                       double to)
{
    if (q >= beam->full_from && q < beam->full_to)
        return splat8(whole_mm);
    if (!pk->clipped)
        clip_packet(j, pk);
    v8f length;
    for (int l = 0; l < CTS_PACKET; l++) {
        const double a = pk->enter[l] > from ? pk->enter[l] : from, b = pk->leave[l] < to ? pk->leave[l] : to;
        length[l] = b > a ? (float)((b - a) * j->layer_mm) : 0;
    }
    return length;
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
    v8f u, v, k;
} Slope;

/* On layer q, where the packet's rays cross the sheet a fraction part / samples behind layer `from`. */
INLINE Slope slope_on_layer(const TiledJob *j, const Packet *pk, Way way, const Taps *t, int q, int from, int part,
                            bool inner)
{
    Slope g;
    if (way == WAY_WIDE || !inner) {
        const double at = from + (double)part / j->samples;
        for (int l = 0; l < CTS_PACKET; l++) {
            float lane[3];
            lane_gradient(j, pk->u_lane0 + l * j->u_at[1] + at * j->u_at[3],
                          pk->v_lane0 + l * j->v_at[1] + at * j->v_at[3], q, lane);
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

INLINE Slope mix_slope(const Slope *a, const Slope *b, float f)
{
    return (Slope){a->u + (b->u - a->u) * f, a->v + (b->v - a->v) * f, a->k + (b->k - a->k) * f};
}

OUTLINE Slope slope_at(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner)
{
    Taps made;
    const Taps *t = &pk->straight;
    if (way == WAY_OBLIQUE) {
        made = make_taps(j, pk, q * j->samples + part, inner);
        t = &made;
    }
    const Slope here = slope_on_layer(j, pk, way, t, q, q, part, inner);
    if (part == 0)
        return here;
    const Slope next = slope_on_layer(j, pk, way, t, q + 1, q, part, inner);
    return mix_slope(&here, &next, (float)part / (float)j->samples);
}

/* Lighting a fraction f of the way from slope a to slope b: the gradient is mixed, as it is between voxels, and only
 * then made a direction, so that the weak gradient of air does not turn that of a surface. */
INLINE Glow glow_between(const TiledJob *j, const Slope *a, const Slope *b, float f)
{
    const CtsShade *shade = j->shade;
    const float *m = shade->form;
    const Slope slope = mix_slope(a, b, f);
    const v8f u = slope.u, v = slope.v, k = slope.k;
    const v8f towards = shade->along[0] * u + shade->along[1] * v + shade->along[2] * k;
    const v8f square = u * (m[0] * u + m[3] * v + m[4] * k) + v * (m[1] * v + m[5] * k) + m[2] * k * k;
    const v8i any = square > 0;
    v8f facing = (CTS_MUTATED(ONE_SIDED_LIGHT) ? v8f_max(towards, splat8(0)) : v8f_abs(towards)) /
                 v8f_sqrt(select8(any, square, splat8(1)));
    facing = select8(any, v8f_min(facing, splat8(1)), splat8(0));
    return (Glow){shade->ambient + shade->diffuse * facing,
                  select8(any, shade->specular * shade_power(shade, facing), splat8(0))};
}

INLINE bool is_quiet(const TiledJob *j, v8f a, v8f b)
{
    return v8_all((v8f_max(a, b) <= j->table.quiet_low) | (v8f_min(a, b) >= j->table.quiet_high));
}

/* What a march carries from slab to slab, each with the layer it belongs to. */
typedef struct Course {
    Entry entry;
    Slope slope;
    int entry_layer, slope_layer;
    bool timed;
    uint64_t shade_ticks; /* spent on slopes, where timed */
} Course;

INLINE Slope timed_slope(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner, Course *course)
{
    const uint64_t before = course->timed ? tiled_ticks() : 0;
    const Slope slope = slope_at(j, pk, way, q, part, inner);
    course->shade_ticks += course->timed ? tiled_ticks() - before : 0;
    return slope;
}

/* The slab behind layer q with a fixed number of sheets in it. */
OUTLINE void add_sheets(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, v8f s0,
                        v8f end, bool inner, bool lit, Course *course)
{
    Entry e0, e1;
    Slope g0 = {.u = splat8(0)}, g1;
    Glow glow;
    bool have_entry = false;
    for (int part = 1; part <= j->samples; part++) {
        const v8f s1 = part == j->samples ? end : sample_sheet(j, pk, way, q, part, inner);
        if (is_quiet(j, s0, s1)) {
            s0 = s1;
            have_entry = false;
            continue;
        }
        if (!have_entry)
            look_up(j, s0, &e0);
        look_up(j, s1, &e1);
        if (lit) {
            if (!have_entry)
                g0 = timed_slope(j, pk, way, q, part - 1, inner, course);
            g1 = part == j->samples ? timed_slope(j, pk, way, q + 1, 0, inner, course)
                                    : timed_slope(j, pk, way, q, part, inner, course);
            glow = glow_between(j, &g0, &g1, 0.5f);
            g0 = g1;
        }
        const v8f t_before = light->t;
        add_slab(j, light, &e0, &e1,
                 slab_length(j, beam, pk, q, j->layer_mm / (float)j->samples, q + (double)(part - 1) / j->samples,
                             q + (double)part / j->samples),
                 lit ? &glow : NULL);
        note_depth(light, t_before, (float)q + ((float)part - 0.5f) / (float)j->samples);
        s0 = s1;
        e0 = e1;
        have_entry = true;
    }
}

/* Lighting a fraction f through a slab; one that is cut knows the slope half way, unless that is the mean anyway. */
INLINE Glow course_glow(const TiledJob *j, Way way, int parts, float f, const Slope *from, const Slope *mid,
                        const Slope *to)
{
    if (parts == 1 || way == WAY_STRAIGHT)
        return glow_between(j, from, to, f);
    return f < 0.5f ? glow_between(j, from, mid, 2 * f) : glow_between(j, mid, to, 2 * f - 1);
}

/* The slab behind layer q in as many parts as its course asks for. From s0 over mid to end the field is taken for a
 * parabola; the more it bends, and the more light is lost on the way (colours in front hide those behind), the more
 * parts. Parts cost table entries, no voxels; on a straight way mid itself costs nothing. */
INLINE void add_course(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, v8f s0,
                       v8f end, bool inner, bool lit, Course *course)
{
    Entry e0, e1;
    Slope slope0, slope1, slope_mid;
    if (course->entry_layer == q)
        e0 = course->entry;
    else
        look_up(j, s0, &e0);
    look_up(j, end, &e1);
    const Entry last = e1;
    if (lit) {
        slope0 = course->slope_layer == q ? course->slope : timed_slope(j, pk, way, q, 0, inner, course);
        slope1 = timed_slope(j, pk, way, q + 1, 0, inner, course);
        course->slope = slope1;
        course->slope_layer = q + 1;
    }
    const v8f seen = select8(light->t < j->refine_transmittance, splat8(0), splat8(1));
    int parts = 1;
    v8f bend = splat8(0), rise = bend;
    if (!v8_all(v8f_abs(end - s0) * seen < j->refine_grey)) {
        const v8f mid = way == WAY_STRAIGHT ? (s0 + end) * 0.5f : sample_sheet(j, pk, way, q, 1, inner);
        if (lit && way != WAY_STRAIGHT)
            slope_mid = timed_slope(j, pk, way, q, 1, inner, course);
        bend = 2 * (s0 + end) - 4 * mid;
        rise = end - s0 - bend;
        parts = v8_all(v8f_abs(bend) * seen < j->bend_grey) ? 2 : 4;
        const v8f nf = v8f_abs(__builtin_convertvector(e1.index - e0.index, v8f));
        const v8f depth = v8f_abs(__builtin_convertvector(e1.k - e0.k, v8f)) * (j->table.depth_scale * j->layer_mm);
        if (j->samples > 2)
            parts = j->samples;
        else if (v8_any(depth * seen > nf * j->stiff_depth))
            parts = 16;
    }
    const float share = 1.0f / (float)parts;
    for (int p = 1; p <= parts; p++) {
        const float f = (float)p * share;
        if (p == parts)
            e1 = last;
        else
            look_up(j, s0 + (rise + bend * f) * f, &e1);
        Glow glow;
        if (lit)
            glow = course_glow(j, way, parts, f - 0.5f * share, &slope0, &slope_mid, &slope1);
        const v8f t_before = light->t;
        add_slab(j, light, &e0, &e1,
                 slab_length(j, beam, pk, q, j->layer_mm * share, q + (double)(p - 1) / parts, q + (double)p / parts),
                 lit ? &glow : NULL);
        note_depth(light, t_before, (float)q + f - 0.5f * share);
        e0 = e1;
    }
    course->entry = last;
    course->entry_layer = q + 1;
}

/* True when the packet became opaque. */
INLINE bool march(const TiledJob *j, TiledBeam *beam, Packet *pk, Way way, bool lit, Light *light, TiledCounts *counts)
{
    v8f s0 = splat8(0);
    Course course = {.entry_layer = -1, .slope_layer = -1};
    int reached = -1; /* s0 is the field on this layer */
    uint64_t samples = 0, slabs = 0;
    bool opaque = false;
    const bool timed = counts->packets % TILED_TIMED_PACKETS == 0;
    course.timed = timed;
    uint64_t start = timed ? tiled_ticks() : 0, composite = 0;
    for (int r = 0; !opaque && (r < beam->n_runs || tiled_beam_extend(j, beam)); r++) {
        const TiledRun run = beam->runs[r];
        if (run.from != reached)
            s0 = sample_sheet(j, pk, way, run.from, 0, run.inner);
        reached = run.to;
        for (int q = run.from; q < run.to && !opaque; q++) {
            const v8f end = sample_sheet(j, pk, way, q + 1, 0, run.inner);
            samples++;
            if (!j->adaptive || !is_quiet(j, s0, end)) {
                const uint64_t before = timed ? tiled_ticks() : 0;
                slabs++;
                if (j->adaptive)
                    add_course(j, beam, pk, way, light, q, s0, end, run.inner, lit, &course);
                else
                    add_sheets(j, beam, pk, way, light, q, s0, end, run.inner, lit, &course);
                opaque = v8_all(light->t < j->stop_transmittance);
                composite += timed ? tiled_ticks() - before : 0;
            }
            s0 = end;
        }
    }
    if (timed) {
        counts->composite_ticks += composite - course.shade_ticks;
        counts->shade_ticks += course.shade_ticks;
        counts->splat_ticks += tiled_ticks() - start - composite;
    }
    counts->samples += samples * CTS_PACKET;
    counts->slabs += slabs * CTS_PACKET;
    return opaque;
}

INLINE bool march_any(const TiledJob *j, TiledBeam *beam, Packet *pk, bool lit, Light *light, TiledCounts *counts)
{
    return !j->windowed  ? march(j, beam, pk, WAY_WIDE, lit, light, counts)
           : j->straight ? march(j, beam, pk, WAY_STRAIGHT, lit, light, counts)
                         : march(j, beam, pk, WAY_OBLIQUE, lit, light, counts);
}

static void run_packet(const TiledJob *j, TiledBeam *beam, int x, int y, int n, TiledCounts *counts)
{
    Packet pk;
    Light light = {.t = splat8(1), .depth = splat8(-1)};
    init_packet(j, &pk, x, y);
    const bool opaque =
        j->shade ? march_any(j, beam, &pk, true, &light, counts) : march_any(j, beam, &pk, false, &light, counts);
    if (opaque) {
        /* What is left of the light is taken to see the same colour as the rest did. */
        const v8i dark = light.t < j->stop_transmittance;
        const v8f scale = select8(dark, 1.0f / light.a, splat8(1));
        light.r *= scale;
        light.g *= scale;
        light.b *= scale;
        light.a = select8(dark, splat8(1), light.a);
    }
    counts->packets++;
    const size_t first = (size_t)(y - j->first_row) * (size_t)j->width + (size_t)x;
    float *out = j->rgba + 4 * first;
    for (int l = 0; l < n; l++, out += 4) {
        out[0] = light.r[l];
        out[1] = light.g[l];
        out[2] = light.b[l];
        out[3] = light.a[l];
    }
    for (int l = 0; l < n && j->depth_mm; l++)
        if (light.depth[l] >= 0)
            j->depth_mm[first + (size_t)l] = tiled_depth_mm(j, x + l, y, light.depth[l]);
}
