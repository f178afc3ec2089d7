/* The march of PACKETS packets of 8 pixels, one below the other, in vectors of LANES pixels. Included by tiled_c.c,
 * tiled_avx2.c and tiled_avx512.c, which first define what tiled_vec_tmpl.h lists; everything else is element-wise and
 * the same in all. What is decided, is decided for each packet by itself, so that the picture does not depend on how
 * many march together. */

typedef struct Packet {
    double u_lane0[PACKETS], v_lane0[PACKETS]; /* first pixels, at q = 0 */
    int64_t u[PACKETS], v[PACKETS];            /* the same in 2^-32 */
    bool clipped;                              /* enter and leave are known */
    double enter[LANES], leave[LANES];         /* q between which each ray is inside the box */
    Taps straight;
} Packet;

/* 1 - exp(-d) for d >= 0, relative error below 1e-6 down to d = 0: with d = n ln 2 + f it is
 * (1 - 2^-n) - 2^-n (exp(-f) - 1). */
INLINE vf one_minus_exp(vf d)
{
    d = vf_min(d, vf_of(80.0f));
    const vi n = to_int(d * 1.44269504f + 0.5f);
    const vf nf = to_float(n);
    const vf f = (d - nf * 0.693359375f) - nf * -2.12194440e-4f;
    vf p = f * (-1.0f / 720) + (1.0f / 120);
    p = p * f - (1.0f / 24);
    p = p * f + (1.0f / 6);
    p = p * f - 0.5f;
    p = (p * f + 1.0f) * f; /* 1 - exp(-f) */
    const vf power = (vf)((127 - n) << 23);
    return (1.0f - power) + power * p;
}

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
    return make_taps(j, pu, pv, inner);
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

INLINE void init_packet(const TiledJob *j, Packet *pk, int x, int y)
{
    for (int h = 0; h < PACKETS; h++) {
        pk->u_lane0[h] = j->u_at[0] + j->u_at[1] * x + j->u_at[2] * (y + h);
        pk->v_lane0[h] = j->v_at[0] + j->v_at[1] * x + j->v_at[2] * (y + h);
        pk->u[h] = (int64_t)floor(pk->u_lane0[h] * 4294967296.0 + 0.5);
        pk->v[h] = (int64_t)floor(pk->v_lane0[h] * 4294967296.0 + 0.5);
    }
    pk->clipped = false;
    if (j->windowed && j->straight)
        pk->straight = sheet_taps(j, pk, 0, false);
}

typedef struct Light {
    vf r, g, b, a, t; /* premultiplied colour and opacity gathered, transmittance left: 1 - a loses small a */
    vf depth;         /* q of the first visible surface, -1: none */
    unsigned opaque;  /* bit h: packet h */
} Light;

/* The first visible surface: where half of the light is lost, or the first that is seen at all. */
INLINE void note_depth(const TiledJob *j, Light *light, vf t_before, vf q)
{
    if (!j->depth_mm)
        return;
    const vmask first = mask_and(vf_lt(light->depth, vf_of(0)), vf_lt(light->t, t_before));
    const vmask half = mask_and(vf_lt(vf_of(0.5f), t_before), vf_le(light->t, vf_of(0.5f)));
    light->depth = select_f(mask_or(first, half), q, light->depth);
}

typedef struct Entry {
    vi index;      /* of the table; not clamped below */
    vi r, g, b, k; /* the table's sums there */
} Entry;

INLINE void look_up(const TiledJob *j, vf s, Entry *e)
{
    const CtsSlabTable *t = &j->table;
    /* The shift keeps the conversion's truncation away from negative numbers. */
    const vf x = vf_max((s - t->grey_low) * t->per_grey, vf_of(-1e6f)) + 1e6f;
    e->index = to_int(x + 0.5f) - 1000000;
    look_up_entries(t->sum, t->n, e->index, &e->r, &e->g, &e->b, &e->k);
}

/* Lighting of the sheet on layer `layer`: what colour is multiplied with, and the white added to it. */
typedef struct Glow {
    vf colour, white;
} Glow;

/* One slab from entry a to entry b, length_mm long for each lane, for the packets in `marching`. With d levels between
 * the entries and an integral of k over them, depth = length * k / d, and the colour integral weighs alpha / depth: one
 * division serves both. */
INLINE void add_slab(const TiledJob *j, Light *light, vmask marching, const Entry *a, const Entry *b, vf length_mm,
                     const Glow *glow)
{
    const CtsSlabTable *t = &j->table;
    const vi n = b->index - a->index;
    const vmask flat = vi_eq(n, vi_of(0));
    /* All have the sign of the field's change. */
    vf nf = vf_abs(to_float(n)), k = vf_abs(to_float(b->k - a->k));
    vf r = vf_abs(to_float(b->r - a->r)), g = vf_abs(to_float(b->g - a->g)), b8 = vf_abs(to_float(b->b - a->b));
    if (__builtin_expect(any_in(flat) != 0, 0)) {
        /* The field does not change: the integrand itself, over one step of the table. */
        Entry here;
        look_up_entries(t->step, t->n, a->index + 1, &here.r, &here.g, &here.b, &here.k);
        nf = select_f(flat, vf_of(1), nf);
        r = select_f(flat, (vf)here.r, r);
        g = select_f(flat, (vf)here.g, g);
        b8 = select_f(flat, (vf)here.b, b8);
        k = select_f(flat, (vf)here.k, k);
    }
    /* Without depth there is no colour either. */
    const vf kf = vf_max(k, vf_of(1e-12f));
    const vf inverse = 1.0f / (nf * kf);
    const vf depth = (k * kf) * inverse * (t->depth_scale * length_mm);
    vf alpha = CTS_MUTATED(ATTENUATION) ? vf_min(depth, vf_of(1)) : one_minus_exp(depth);
    if (PACKETS > 1)
        alpha = select_f(marching, alpha, vf_of(0));
    const vf lost = light->t * alpha;
    const vf weight = lost * (nf * inverse) * t->colour_per_depth;
    r *= weight;
    g *= weight;
    b8 *= weight;
    if (glow) {
        const vf white = lost * glow->white;
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

/* Length inside the box of each lane's way through part `part` (from 1) of its packet's parts of the slab behind layer
 * q; whole_mm where the box does not cut it. */
INLINE vf slab_length(const TiledJob *j, const TiledBeam *beam, Packet *pk, int q, vf whole_mm, int part,
                      const int parts[PACKETS])
{
    if (q >= beam->full_from && q < beam->full_to)
        return whole_mm;
    if (!pk->clipped)
        clip_packet(j, pk);
    vf length;
    for (int l = 0; l < LANES; l++) {
        const int n = parts[l / CTS_PACKET];
        const double from = q + (double)(part - 1) / n, to = q + (double)part / n;
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

INLINE vf specular_power(const CtsShade *shade, vf facing)
{
    if (shade->whole_power == 0)
        return shade_power(shade, facing);
    vf square = vf_max(facing, vf_of(shade->least_power)), power = vf_of(1);
    for (int n = shade->whole_power;; square *= square) {
        if (n & 1)
            power *= square;
        n >>= 1;
        if (n == 0)
            return power;
    }
}

/* Lighting a fraction f of the way from slope a to slope b: the gradient is mixed, as it is between voxels, and only
 * then made a direction, so that the weak gradient of air does not turn that of a surface. */
INLINE Glow glow_between(const TiledJob *j, const Slope *a, const Slope *b, vf f)
{
    const CtsShade *shade = j->shade;
    const float *m = shade->form;
    const Slope slope = mix_slope(a, b, f);
    const vf u = slope.u, v = slope.v, k = slope.k;
    const vf towards = shade->along[0] * u + shade->along[1] * v + shade->along[2] * k;
    const vf square = u * (m[0] * u + m[3] * v + m[4] * k) + v * (m[1] * v + m[5] * k) + m[2] * k * k;
    const vmask sloped = vf_lt(vf_of(0), square);
    vf facing = (CTS_MUTATED(ONE_SIDED_LIGHT) ? vf_max(towards, vf_of(0)) : vf_abs(towards)) /
                vf_sqrt(select_f(sloped, square, vf_of(1)));
    facing = select_f(sloped, vf_min(facing, vf_of(1)), vf_of(0));
    return (Glow){shade->ambient + shade->diffuse * facing,
                  select_f(sloped, shade->specular * specular_power(shade, facing), vf_of(0))};
}

/* Which packets march through a slab from a to b, a bit each: those that are not opaque and in which something may
 * show. */
INLINE unsigned marching_packets(const TiledJob *j, const Light *light, vf a, vf b)
{
    const vmask quiet =
        mask_or(vf_le(vf_max(a, b), vf_of(j->table.quiet_low)), vf_le(vf_of(j->table.quiet_high), vf_min(a, b)));
    return ~(light->opaque | all_in(quiet)) & ALL_PACKETS;
}

/* What a lit march carries from slab to slab. */
typedef struct Course {
    Slope slope;
    int slope_layer; /* that slope belongs to */
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
OUTLINE void add_sheets(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0,
                        vf end, bool inner, bool lit, Course *course)
{
    const vf length_mm = vf_of(j->layer_mm / (float)j->samples);
    Entry e0, e1;
    Slope g0 = {.u = vf_of(0)}, g1;
    Glow glow;
    bool have_entry = false;
    int parts[PACKETS];
    for (int h = 0; h < PACKETS; h++)
        parts[h] = j->samples;
    for (int part = 1; part <= j->samples; part++) {
        const vf s1 = part == j->samples ? end : sample_sheet(j, pk, way, q, part, inner);
        const unsigned marching = marching_packets(j, light, s0, s1);
        if (!marching) {
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
            glow = glow_between(j, &g0, &g1, vf_of(0.5f));
            g0 = g1;
        }
        const vf t_before = light->t;
        add_slab(j, light, mask_packets(marching), &e0, &e1, slab_length(j, beam, pk, q, length_mm, part, parts),
                 lit ? &glow : NULL);
        note_depth(j, light, t_before, vf_of((float)q + ((float)part - 0.5f) / (float)j->samples));
        s0 = s1;
        e0 = e1;
        have_entry = true;
    }
}

/* The course of the field through a slab, a parabola from the front over the middle to the end, and how many parts each
 * packet cuts it into. */
typedef struct Bend {
    vf bend, rise; /* s0 + (rise + bend f) f, f from 0 to 1 */
    int parts[PACKETS], most;
} Bend;

/* The more the field bends, and the more light is lost on the way (colours in front hide those behind), the more parts.
 * Parts cost table entries, no voxels; on a straight way the middle itself costs nothing. */
INLINE Bend find_bend(const TiledJob *j, const Packet *pk, Way way, vf seen, int q, vf s0, vf end, bool inner,
                      unsigned cut, unsigned stiff)
{
    Bend b;
    const vf mid = way == WAY_STRAIGHT ? (s0 + end) * 0.5f : sample_sheet(j, pk, way, q, 1, inner);
    b.bend = 2 * (s0 + end) - 4 * mid;
    b.rise = end - s0 - b.bend;
    b.most = 1;
    const unsigned unbent = all_in(vf_lt(vf_abs(b.bend) * seen, vf_of(j->bend_grey)));
    for (int h = 0; h < PACKETS; h++) {
        b.parts[h] = !(cut >> h & 1) ? 1 : j->samples > 2 ? j->samples : stiff >> h & 1 ? 16 : unbent >> h & 1 ? 2 : 4;
        b.most = b.parts[h] > b.most ? b.parts[h] : b.most;
    }
    return b;
}

/* Lighting a fraction f through a slab; one that is cut knows the slope half way, unless that is the mean anyway. */
INLINE Glow course_glow(const TiledJob *j, Way way, const Bend *bend, vf f, const Slope *from, const Slope *mid,
                        const Slope *to)
{
    if (way == WAY_STRAIGHT)
        return glow_between(j, from, to, f);
    unsigned whole = 0;
    for (int h = 0; h < PACKETS; h++)
        whole |= (unsigned)(bend->parts[h] == 1) << h;
    const vmask uncut = mask_packets(whole), front = vf_lt(f, vf_of(0.5f));
    const Slope a = select_slope(mask_or(uncut, front), from, mid), half = select_slope(front, mid, to);
    const Slope b = select_slope(uncut, to, &half);
    return glow_between(j, &a, &b, select_f(uncut, f, select_f(front, 2 * f, 2 * f - 1)));
}

/* The slab behind layer q, from entry e0 to e1, in as many parts as its course asks of the packets in `cut`. */
INLINE void add_parts(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0, vf end,
                      bool inner, bool lit, unsigned marching, unsigned cut, unsigned stiff, vf seen, const Entry *e0,
                      const Entry *e1, const Slope *slope0, const Slope *slope1, Course *course)
{
    const Bend bend = find_bend(j, pk, way, seen, q, s0, end, inner, cut, stiff);
    Slope slope_mid;
    if (lit && way != WAY_STRAIGHT)
        slope_mid = timed_slope(j, pk, way, q, 1, inner, course);
    float shares[PACKETS];
    for (int h = 0; h < PACKETS; h++)
        shares[h] = 1.0f / (float)bend.parts[h];
    const vf share = vf_packets(shares);
    Entry before = *e0;
    for (int p = 1; p <= bend.most; p++) {
        const vf f = (float)p * share;
        unsigned adding = marching, last = 0;
        for (int h = 0; h < PACKETS; h++) {
            adding &= ~((unsigned)(p > bend.parts[h]) << h);
            last |= (unsigned)(p >= bend.parts[h]) << h;
        }
        Entry after = *e1;
        if (p < bend.most)
            look_up(j, select_f(mask_packets(last), end, s0 + (bend.rise + bend.bend * f) * f), &after);
        Glow glow;
        if (lit)
            glow = course_glow(j, way, &bend, f - 0.5f * share, slope0, &slope_mid, slope1);
        const vf t_before = light->t;
        add_slab(j, light, mask_packets(adding), &before, &after,
                 slab_length(j, beam, pk, q, j->layer_mm * share, p, bend.parts), lit ? &glow : NULL);
        note_depth(j, light, t_before, (float)q + f - 0.5f * share);
        before = after;
    }
}

/* The slab behind layer q, from entry e0 to e1: at once, or in parts where it changes so much that this would show. */
INLINE void add_course(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0,
                       vf end, bool inner, bool lit, unsigned marching, const Entry *e0, const Entry *e1,
                       Course *course)
{
    static const int whole[PACKETS] = CTS_PACKETS_OF(1);
    Slope slope0, slope1;
    if (lit) {
        slope0 = course->slope_layer == q ? course->slope : timed_slope(j, pk, way, q, 0, inner, course);
        slope1 = timed_slope(j, pk, way, q + 1, 0, inner, course);
        course->slope = slope1;
        course->slope_layer = q + 1;
    }
    const vf seen = select_f(vf_lt(light->t, vf_of(j->refine_transmittance)), vf_of(0), vf_of(1));
    const vf nf = vf_abs(to_float(e1->index - e0->index));
    const vf depth = vf_abs(to_float(e1->k - e0->k)) * (j->table.depth_scale * j->layer_mm);
    const vmask stiff = vf_lt(nf * j->stiff_depth, depth * seen);
    const vf limit = select_f(stiff, vf_of(j->stiff_grey), vf_of(j->refine_grey));
    const unsigned cut = marching & ~all_in(vf_lt(vf_abs(end - s0) * seen, limit));
    if (cut) {
        add_parts(j, beam, pk, way, light, q, s0, end, inner, lit, marching, cut, any_in(stiff), seen, e0, e1, &slope0,
                  &slope1, course);
        return;
    }
    Glow glow;
    if (lit)
        glow = glow_between(j, &slope0, &slope1, vf_of(0.5f));
    const vf t_before = light->t;
    add_slab(j, light, mask_packets(marching), e0, e1, slab_length(j, beam, pk, q, vf_of(j->layer_mm), 1, whole),
             lit ? &glow : NULL);
    note_depth(j, light, t_before, vf_of((float)q + 0.5f));
}

/* Notes the packets that have become opaque; true when all have. */
INLINE bool all_opaque(const TiledJob *j, Light *light)
{
    light->opaque |= all_in(vf_lt(light->t, vf_of(j->stop_transmittance)));
    return light->opaque == ALL_PACKETS;
}

INLINE void march(const TiledJob *j, TiledBeam *beam, Packet *pk, Way way, bool lit, Light *result, TiledCounts *counts)
{
    Light own = *result, *light = &own; /* in registers */
    vf s0 = vf_of(0);
    Course course = {.slope_layer = -1};
    Entry entry = {.index = vi_of(0)}; /* of s0, on layer entry_layer */
    int entry_layer = -1;
    int reached = -1; /* s0 is the field on this layer */
    uint64_t samples = 0, slabs = 0;
    bool opaque = false, inner = false;
    const bool timed = counts->marches % TILED_TIMED_MARCHES == 0;
    course.timed = timed;
    uint64_t start = timed ? tiled_ticks() : 0, composite = 0;
    for (int r = 0; !opaque && (r < beam->n_runs || tiled_beam_extend(j, beam)); r++) {
        const TiledRun run = beam->runs[r];
        if (run.from != reached)
            s0 = sample_sheet(j, pk, way, run.from, 0, run.inner);
        reached = run.to;
        /* Near the faces slopes are rounded in another way; which, must not depend on the packets beside. */
        if (lit && run.inner != inner)
            course.slope_layer = -1;
        inner = run.inner;
        for (int q = run.from; q < run.to && !opaque; q++) {
            const vf end = sample_sheet(j, pk, way, q + 1, 0, run.inner);
            samples++;
            const unsigned marching = j->adaptive ? marching_packets(j, light, s0, end) : ALL_PACKETS;
            if (marching) {
                const uint64_t before = timed ? tiled_ticks() : 0;
                slabs++;
                if (j->adaptive) {
                    Entry next;
                    if (entry_layer != q)
                        look_up(j, s0, &entry);
                    look_up(j, end, &next);
                    add_course(j, beam, pk, way, light, q, s0, end, run.inner, lit, marching, &entry, &next, &course);
                    entry = next;
                    entry_layer = q + 1;
                } else {
                    add_sheets(j, beam, pk, way, light, q, s0, end, run.inner, lit, &course);
                }
                opaque = all_opaque(j, light);
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
    counts->marches++;
    counts->samples += samples * LANES;
    counts->slabs += slabs * LANES;
    *result = own;
}

/* Each way of marching is a function of its own: the compiler keeps more of it in registers. */
#define MARCH(name, way, lit)                                                                                          \
    OUTLINE void name(const TiledJob *j, TiledBeam *beam, Packet *pk, Light *light, TiledCounts *counts)               \
    {                                                                                                                  \
        march(j, beam, pk, way, lit, light, counts);                                                                   \
    }
MARCH(march_straight, WAY_STRAIGHT, false)
MARCH(march_oblique, WAY_OBLIQUE, false)
MARCH(march_wide, WAY_WIDE, false)
MARCH(march_straight_lit, WAY_STRAIGHT, true)
MARCH(march_oblique_lit, WAY_OBLIQUE, true)
MARCH(march_wide_lit, WAY_WIDE, true)
#undef MARCH

static void march_any(const TiledJob *j, TiledBeam *beam, Packet *pk, Light *light, TiledCounts *counts)
{
    if (!j->windowed)
        (j->shade ? march_wide_lit : march_wide)(j, beam, pk, light, counts);
    else if (j->straight)
        (j->shade ? march_straight_lit : march_straight)(j, beam, pk, light, counts);
    else
        (j->shade ? march_oblique_lit : march_oblique)(j, beam, pk, light, counts);
}

/* What is left of the light in front of an opaque packet is taken to see the same colour as the rest did. */
INLINE void complete(const TiledJob *j, Light *light)
{
    const vmask dark = mask_and(vf_lt(light->t, vf_of(j->stop_transmittance)), mask_packets(light->opaque));
    const vf scale = select_f(dark, 1.0f / light->a, vf_of(1));
    light->r *= scale;
    light->g *= scale;
    light->b *= scale;
    light->a = select_f(dark, vf_of(1), light->a);
}

static void run_packets(const TiledJob *j, TiledBeam *beam, int x, int y, int n, TiledCounts *counts)
{
    Packet pk;
    Light light = {.t = vf_of(1), .depth = vf_of(-1)};
    init_packet(j, &pk, x, y);
    march_any(j, beam, &pk, &light, counts);
    complete(j, &light);
    for (int l = 0; l < LANES; l++) {
        const int row = y + l / CTS_PACKET, column = x + l % CTS_PACKET;
        if (l % CTS_PACKET >= n)
            continue;
        const size_t at = (size_t)(row - j->first_row) * (size_t)j->width + (size_t)column;
        float *out = j->rgba + 4 * at;
        out[0] = light.r[l];
        out[1] = light.g[l];
        out[2] = light.b[l];
        out[3] = light.a[l];
        if (j->depth_mm && light.depth[l] >= 0)
            j->depth_mm[at] = tiled_depth_mm(j, column, row, light.depth[l]);
    }
}
