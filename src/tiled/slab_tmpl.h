/* One slab of the march, part of march_tmpl.h: the table's sums, lighting, and what is added to the pixels. */
#include "tiled/samples_tmpl.h"

/* 1 - 2^-d for d >= 0, relative error below 1e-6 down to d = 0: with d = n + f it is (1 - 2^-n) + 2^-n (1 - 2^-f). */
INLINE vf one_minus_exp2(vf d)
{
    d = vf_min(d, vf_of(115.0f));
    const vi n = to_int(d + 0.5f);
    const vf f = d - to_float(n);
    vf p = vf_fma(f, vf_of(-1.54035304e-4f), vf_of(1.33335581e-3f)); /* the series of 1 - 2^-f */
    p = vf_fma(p, f, vf_of(-9.61812911e-3f));
    p = vf_fma(p, f, vf_of(5.55041087e-2f));
    p = vf_fma(p, f, vf_of(-2.40226507e-1f));
    p = vf_fma(p, f, vf_of(6.93147181e-1f));
    const vf power = (vf)((127 - n) << 23);
    return vf_fma(power, p * f, 1.0f - power);
}

typedef struct Light {
    vf r, g, b, a, t; /* premultiplied colour and opacity gathered, transmittance left: 1 - a loses small a */
    vf depth;         /* q of the first visible surface, -1: none */
    unsigned opaque;  /* bit h: packet h */
} Light;

/* The first visible surface: where half of the light is lost, or the middle of the first slab that is seen at all. The
 * slab runs from layer position `from` over `length` layers, and the light falls along it in a straight line. */
INLINE void note_depth(const TiledJob *j, Light *light, vf t_before, vf from, vf length)
{
    if (!j->depth_mm)
        return;
    const vmask first = mask_and(vf_lt(light->depth, vf_of(0)), vf_lt(light->t, t_before));
    const vmask half = mask_and(vf_lt(vf_of(0.5f), t_before), vf_le(light->t, vf_of(0.5f)));
    const vf fall = select_f(half, t_before - light->t, vf_of(1));
    const vf part = select_f(half, (t_before - 0.5f) / fall, vf_of(0.5f));
    light->depth = select_f(mask_or(first, half), from + part * length, light->depth);
}

typedef struct Entry {
    vi index;      /* of the table; not clamped below */
    vi r, g, b, k; /* the table's sums there */
} Entry;

enum { SHIFT = 1 << 20 /* more than any index is below 0 */ };

INLINE void look_up(const TiledJob *j, vf s, Entry *e)
{
    const CtsSlabTable *t = &j->table;
    /* The shift keeps the conversion's truncation away from negative numbers. */
    const vf x = vf_fma(s - t->grey_low, vf_of(t->per_grey), vf_of(SHIFT + 0.5f));
    e->index = to_int(x) - SHIFT;
    look_up_entries(t->sum, t->n, e->index, &e->r, &e->g, &e->b, &e->k);
}

/* One slab from entry a to entry b, length_mm long for each lane, for the packets in `marching`. With d levels between
 * the entries and an integral of k over them, depth = length * k / d, and the colour integral weighs alpha / depth: one
 * division serves both. */
INLINE void add_slab(const TiledJob *j, Light *light, vmask marching, const Entry *a, const Entry *b, vf length_mm)
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
    const vf halvings = (k * kf) * inverse * (t->halving_scale * length_mm);
    vf alpha = CTS_MUTATED(ATTENUATION) ? vf_min(halvings, vf_of(1)) : one_minus_exp2(halvings);
    if (PACKETS > 1)
        alpha = select_f(marching, alpha, vf_of(0));
    const vf lost = light->t * alpha;
    const vf weight = lost * (nf * inverse) * t->colour_per_depth;
    light->r = vf_fma(r, weight, light->r);
    light->g = vf_fma(g, weight, light->g);
    light->b = vf_fma(b8, weight, light->b);
    light->a += lost;
    light->t -= lost;
}

/* Length inside the box of each lane's way from `from` to `to`, in layers behind layer q; whole_mm where the box does
 * not cut it. */
INLINE vf slab_length(const TiledJob *j, const TiledBeam *beam, Packet *pk, int q, vf from, vf to, vf whole_mm)
{
    if (q >= beam->full_from && q < beam->full_to)
        return whole_mm;
    if (!pk->clipped)
        clip_packet(j, pk);
    vf length;
    for (int l = 0; l < LANES; l++) {
        const double first = q + (double)from[l], last = q + (double)to[l];
        const double a = pk->enter[l] > first ? pk->enter[l] : first, b = pk->leave[l] < last ? pk->leave[l] : last;
        length[l] = b > a ? (float)((b - a) * j->layer_mm) : 0;
    }
    return length;
}
