/* The march of one packet, in vectors of 8 pixels. Included by tiled_c.c and tiled_avx2.c, which first define
 * v8f_min, v8f_max, v8_any, v8_all, load_window and lookup8; everything else is element-wise and the same in both. */

typedef struct Packet {
    v4d base;   /* smallest u of either half, then smallest v, at q = 0 */
    v8f lane_u, lane_v; /* each lane's distance from its half's base */
    double u_lane0, v_lane0, u_min, u_max, v_min, v_max; /* of the whole packet at q = 0 */
    double enter[CTS_PACKET], leave[CTS_PACKET];         /* q where each lane's ray is inside the box */
    int first, last; /* slabs first..last - 1 hold something */
    int full_from, full_to; /* slabs full_from..full_to - 1 are inside for all lanes */
    Taps straight;
} Packet;

INLINE v8f select8(v8i mask, v8f yes, v8f no)
{
    return (v8f)((mask & (v8i)yes) | (~mask & (v8i)no));
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

INLINE Taps make_taps(const TiledJob *j, const Packet *pk, double q)
{
    Taps t;
    const v4d zero = {0, 0, 0, 0}, step = {j->u_at[3], j->u_at[3], j->v_at[3], j->v_at[3]};
    const v4d most = {j->window_u, j->window_u, j->window_v, j->window_v};
    const v4d top = {j->nu - 1, j->nu - 1, j->nv - 1, j->nv - 1};
    const v4d at = pk->base + step * q;
    v4d corner = v4d_min(v4d_max(at, zero), most);
    const v4i whole = __builtin_convertvector(corner, v4i);
    corner = __builtin_convertvector(whole, v4d);
    const v4f rest = __builtin_convertvector(at - corner, v4f), limit = __builtin_convertvector(top - corner, v4f);
    for (int h = 0; h < 2; h++)
        t.at[h] = j->layer0 + whole[2 + h] * j->row_stride + whole[h];
    v8f u = (v8f){rest[0], rest[0], rest[0], rest[0], rest[1], rest[1], rest[1], rest[1]} + pk->lane_u;
    v8f v = (v8f){rest[2], rest[2], rest[2], rest[2], rest[3], rest[3], rest[3], rest[3]} + pk->lane_v;
    const v8f limit_u = {limit[0], limit[0], limit[0], limit[0], limit[1], limit[1], limit[1], limit[1]};
    const v8f limit_v = {limit[2], limit[2], limit[2], limit[2], limit[3], limit[3], limit[3], limit[3]};
    u = v8f_min(v8f_max(u, splat8(0)), limit_u);
    v = v8f_min(v8f_max(v, splat8(0)), limit_v);
    t.x0 = __builtin_convertvector(v8f_min(u, splat8(6)), v8i);
    const v8f fx = (u - __builtin_convertvector(t.x0, v8f)) * 16384.0f + 0.5f;
    const v8i wx = __builtin_convertvector(fx, v8i);
    t.weights = (wx << 16) | (16384 - wx);
    t.row1 = v >= splat8(1);
    t.fy = v - select8(t.row1, splat8(1), splat8(0));
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

INLINE v8f sample_layer(const TiledJob *j, const Packet *pk, const Taps *t, int layer, double q)
{
    const ptrdiff_t offset = layer * j->layer_stride;
    return j->windowed ? load_window(t, offset, j->row_stride) : sample_wide(j, pk, j->layer0 + offset, q);
}

/* The field on the sheet a fraction part / samples behind layer q. */
INLINE v8f sample_sheet(const TiledJob *j, const Packet *pk, int q, int part)
{
    Taps made;
    const Taps *t = &pk->straight;
    const double at = q + (double)part / j->samples;
    if (j->windowed && !j->straight) {
        made = make_taps(j, pk, at);
        t = &made;
    }
    const v8f here = sample_layer(j, pk, t, q, at);
    if (part == 0)
        return here;
    const v8f next = sample_layer(j, pk, t, q + 1, at);
    return here + ((float)part / (float)j->samples) * (next - here);
}

/* When each lane's ray is inside the box of voxel centres, and the slabs that matter. */
INLINE bool clip_packet(const TiledJob *j, Packet *pk)
{
    const double size[2] = {j->nu - 1, j->nv - 1};
    double first = INFINITY, last = -INFINITY, full_from = 0, full_to = j->nk - 1;
    for (int l = 0; l < CTS_PACKET; l++) {
        const double at[2] = {pk->u_lane0 + l * j->u_at[1], pk->v_lane0 + l * j->v_at[1]};
        const double step[2] = {j->u_at[3], j->v_at[3]};
        double enter = 0, leave = j->nk - 1;
        for (int c = 0; c < 2; c++) {
            if (step[c] == 0) {
                /* A hair's breadth of rounding must not lose a face that a ray runs along. */
                if (at[c] < -1e-9 * (1 + size[c]) || at[c] > size[c] + 1e-9 * (1 + size[c]))
                    leave = -1;
                continue;
            }
            const double a = (0 - at[c]) / step[c], b = (size[c] - at[c]) / step[c];
            const double lo = a < b ? a : b, hi = a < b ? b : a;
            enter = lo > enter ? lo : enter;
            leave = hi < leave ? hi : leave;
        }
        pk->enter[l] = enter;
        pk->leave[l] = leave;
        full_from = enter > full_from ? enter : full_from;
        full_to = leave < full_to ? leave : full_to;
        if (enter < leave) {
            first = enter < first ? enter : first;
            last = leave > last ? leave : last;
        }
    }
    if (!(first < last))
        return false;
    pk->first = (int)first;
    pk->last = (int)ceil(last);
    pk->full_from = (int)ceil(full_from);
    pk->full_to = full_to > 0 ? (int)full_to : 0;
    return true;
}

INLINE bool init_packet(const TiledJob *j, Packet *pk, int x, int y)
{
    pk->u_lane0 = j->u_at[0] + j->u_at[1] * x + j->u_at[2] * y;
    pk->v_lane0 = j->v_at[0] + j->v_at[1] * x + j->v_at[2] * y;
    if (!clip_packet(j, pk))
        return false;
    const double du = j->u_at[1], dv = j->v_at[1];
    const double u3 = du < 0 ? 3 * du : 0, v3 = dv < 0 ? 3 * dv : 0;
    pk->base = (v4d){pk->u_lane0 + u3, pk->u_lane0 + 4 * du + u3, pk->v_lane0 + v3, pk->v_lane0 + 4 * dv + v3};
    for (int l = 0; l < CTS_PACKET; l++) {
        pk->lane_u[l] = (float)((l & 3) * du - u3);
        pk->lane_v[l] = (float)((l & 3) * dv - v3);
    }
    pk->u_min = pk->u_lane0 + (du < 0 ? 7 * du : 0);
    pk->u_max = pk->u_lane0 + (du < 0 ? 0 : 7 * du);
    pk->v_min = pk->v_lane0 + (dv < 0 ? 7 * dv : 0);
    pk->v_max = pk->v_lane0 + (dv < 0 ? 0 : 7 * dv);
    if (j->windowed && j->straight)
        pk->straight = make_taps(j, pk, 0);
    return true;
}

/* Layers for which [low, high] + step * q, one coordinate of the packet, stays inside the blocks b0 - (n - 1) to
 * b1 + (n - 1); beyond the volume's ends there is nothing to stay inside of. */
INLINE double room(double low, double high, double step, int b0, int b1, int n, int n_blocks)
{
    if (step > 0)
        return b1 + n >= n_blocks ? INFINITY : ((b1 + n) * CTS_BLOCK - high) / step;
    if (step < 0)
        return b0 - (n - 1) <= 0 ? INFINITY : (low - (b0 - (n - 1)) * CTS_BLOCK) / -step;
    return INFINITY;
}

INLINE int block_of(double at, int n_blocks)
{
    const int b = at > 0 ? (int)at / CTS_BLOCK : 0;
    return b < n_blocks ? b : n_blocks - 1;
}

/* How many layers the packet may leap from layer q. 0: something may be visible; *until is then the layer up to which
 * it marches before it asks again. */
INLINE int leap_from(const TiledJob *j, const Packet *pk, int q, int *until)
{
    const CtsLeap *leap = &j->leap;
    const double u_low = pk->u_min + j->u_at[3] * q, u_high = pk->u_max + j->u_at[3] * q;
    const double v_low = pk->v_min + j->v_at[3] * q, v_high = pk->v_max + j->v_at[3] * q;
    const int bu0 = block_of(u_low, leap->nu), bu1 = block_of(u_high, leap->nu);
    const int bv0 = block_of(v_low, leap->nv), bv1 = block_of(v_high, leap->nv);
    const int cell = j->rising ? q : j->nk - 2 - q;
    const int rest = j->rising ? CTS_BLOCK - cell % CTS_BLOCK : cell % CTS_BLOCK + 1;
    const uint8_t *d = leap->distance + (ptrdiff_t)(cell / CTS_BLOCK) * leap->nu * leap->nv;
    int n = 255;
    for (int bv = bv0; bv <= bv1; bv++)
        for (int bu = bu0; bu <= bu1; bu++) {
            const int here = d[bv * leap->nu + bu];
            n = here < n ? here : n;
        }
    *until = q + rest;
    if (n == 0)
        return 0;
    double most = rest + CTS_BLOCK * (n - 1);
    const double ru = room(u_low, u_high, j->u_at[3], bu0, bu1, n, leap->nu);
    const double rv = room(v_low, v_high, j->v_at[3], bv0, bv1, n, leap->nv);
    most = ru < most ? ru : most;
    most = rv < most ? rv : most;
    if (most < 1) {
        *until = q + 1;
        return 0;
    }
    return (int)most;
}

typedef struct Light {
    v8f r, g, b, t; /* premultiplied colour gathered, transmittance left */
    v8f depth;      /* q of the first visible surface */
} Light;

typedef struct Entry {
    v8i index;          /* of the table; not clamped below */
    v8i ri, gi, bi, ki; /* the table's sums there */
} Entry;

INLINE void look_up(const TiledJob *j, v8f s, Entry *e)
{
    const CtsSlabTable *t = &j->table;
    /* The shift keeps the conversion's truncation away from negative numbers. */
    const v8f x = v8f_max((s - t->grey_low) * t->per_grey, splat8(-1e6f)) + 1e6f;
    e->index = __builtin_convertvector(x + 0.5f, v8i) - 1000000;
    lookup8(t, e->index, &e->ri, &e->gi, &e->bi, &e->ki);
}

/* One slab from entry a to entry b, length mm long for each lane. */
INLINE void add_slab(const TiledJob *j, Light *light, const Entry *a, const Entry *b, v8f length_mm)
{
    const CtsSlabTable *t = &j->table;
    v8i n = b->index - a->index;
    v8i dr = b->ri - a->ri, dg = b->gi - a->gi, db = b->bi - a->bi, dk = b->ki - a->ki;
    const v8i flat = n == 0;
    if (v8_any(flat)) {
        /* The field does not change: the integrand itself, over one step of the table. */
        v8i r1, g1, b1, k1;
        lookup8(t, a->index + 1, &r1, &g1, &b1, &k1);
        n = n - flat; /* 0 - (-1) */
        dr = (flat & (r1 - a->ri)) | (~flat & dr);
        dg = (flat & (g1 - a->gi)) | (~flat & dg);
        db = (flat & (b1 - a->bi)) | (~flat & db);
        dk = (flat & (k1 - a->ki)) | (~flat & dk);
    }
    const v8f per_step = length_mm / __builtin_convertvector(n, v8f);
    const v8f depth = v8f_max(__builtin_convertvector(dk, v8f) * t->depth_scale * per_step, splat8(1e-30f));
    const v8f alpha = one_minus_exp(depth);
    const v8f weight = light->t * (per_step * t->colour_scale) * (alpha / depth);
    light->r += __builtin_convertvector(dr, v8f) * weight;
    light->g += __builtin_convertvector(dg, v8f) * weight;
    light->b += __builtin_convertvector(db, v8f) * weight;
    light->t -= light->t * alpha;
}

INLINE v8f slab_length(const TiledJob *j, const Packet *pk, int q, int part)
{
    const float sheet_mm = j->layer_mm / (float)j->samples;
    if (q >= pk->full_from && q < pk->full_to)
        return splat8(sheet_mm);
    v8f length;
    const double from = q + (double)(part - 1) / j->samples, to = q + (double)part / j->samples;
    for (int l = 0; l < CTS_PACKET; l++) {
        const double a = pk->enter[l] > from ? pk->enter[l] : from, b = pk->leave[l] < to ? pk->leave[l] : to;
        length[l] = b > a ? (float)((b - a) * j->layer_mm) : 0;
    }
    return length;
}

INLINE void march(const TiledJob *j, const Packet *pk, Light *light, TiledCounts *counts)
{
    v8f s0 = splat8(0);
    Entry e0 = {.index = {0}};
    bool have_field = false, have_entry = false;
    int q = pk->first;
    const v8f low = splat8(j->table.quiet_low), high = splat8(j->table.quiet_high);
    while (q < pk->last) {
        int until;
        const int leap = leap_from(j, pk, q, &until);
        if (leap > 0) {
            q += leap;
            have_field = false;
            continue;
        }
        if (until > pk->last)
            until = pk->last;
        if (!have_field) {
            s0 = sample_sheet(j, pk, q, 0);
            have_field = true;
            have_entry = false;
        }
        for (; q < until; q++) {
            for (int part = 1; part <= j->samples; part++) {
                const v8f s1 = part == j->samples ? sample_sheet(j, pk, q + 1, 0) : sample_sheet(j, pk, q, part);
                counts->samples += CTS_PACKET;
                if (v8_all((v8f_max(s0, s1) <= low) | (v8f_min(s0, s1) >= high))) {
                    s0 = s1;
                    have_entry = false;
                    continue;
                }
                counts->slabs += CTS_PACKET;
                Entry e1;
                if (!have_entry)
                    look_up(j, s0, &e0);
                look_up(j, s1, &e1);
                add_slab(j, light, &e0, &e1, slab_length(j, pk, q, part));
                s0 = s1;
                e0 = e1;
                have_entry = true;
            }
            if (v8_all(light->t < j->stop_transmittance))
                return;
        }
    }
}

static void run_row(const TiledJob *j, int y, int x0, int x1, TiledCounts *counts)
{
    for (int x = x0; x < x1; x += CTS_PACKET) {
        Packet pk;
        if (!init_packet(j, &pk, x, y))
            continue;
        counts->packets++;
        Light light = {.t = splat8(1)};
        march(j, &pk, &light, counts);
        float *out = j->rgba + 4 * ((size_t)y * (size_t)j->width + (size_t)x);
        for (int l = 0; l < CTS_PACKET && x + l < x1; l++, out += 4) {
            out[0] = light.r[l];
            out[1] = light.g[l];
            out[2] = light.b[l];
            out[3] = 1 - light.t[l];
        }
    }
}
