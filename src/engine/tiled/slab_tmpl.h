/* One slab of the march, part of march_tmpl.h: the table's sums, lighting, and what is added to the pixels. */
#include "engine/tiled/bend_tmpl.h"

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

/* What a ray's colour may be off by; march.h derives it. */
typedef struct Doubt {
    vf depth;   /* the sum of what optical depths may be off by, */
    vf r, g, b; /* each times the colour the pixel had if all the rest of the light ended there, */
    vf square;  /* and times its squares */
    vf colour;  /* what colours themselves may be off by, times the light they get */
} Doubt;

typedef struct Light {
    vf r, g, b, a, t; /* premultiplied colour and opacity gathered, transmittance left: 1 - a loses small a */
    vf depth;         /* q of the first visible surface, -1: none */
    Doubt doubt;
    unsigned opaque; /* bit h: packet h */
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

enum { SHIFT = 1 << 20 /* more than any entry is below 0 */ };

/* The table's entry of a grey level, not clamped to those there are. */
INLINE vi entry_of(const TiledJob *j, vf s)
{
    const CtsSlabTable *t = &j->table;
    /* The shift keeps the conversion's truncation away from negative numbers. */
    const vf x = vf_fma(s - t->grey_low, vf_of(t->per_grey), vf_of(SHIFT + 0.5f));
    return to_int(x) - SHIFT;
}

/* What the table knows of a slab: so many entries lie between its ends, with such an integral over them. */
typedef struct Slab {
    vf n, sum[4];
} Slab;

INLINE Slab slab_of(const TiledJob *j, vi a, vi b)
{
    const CtsSlabTable *t = &j->table;
    const vi n = b - a;
    const vmask flat = vi_eq(n, vi_of(0));
    Slab slab;
    slab.n = vf_abs(to_float(n));
    look_up_difference(t->sum, t->n, a, b, slab.sum);
    for (int c = 0; c < 4; c++)
        slab.sum[c] = vf_abs(slab.sum[c]); /* all have the sign of the field's change */
    if (__builtin_expect(any_in(flat) != 0, 0)) {
        /* The field does not change: the integrand itself. */
        vf here[4];
        look_up_rows(t->here, t->n, a, here);
        slab.n = select_f(flat, vf_of(1), slab.n);
        for (int c = 0; c < 4; c++)
            slab.sum[c] = select_f(flat, here[c], slab.sum[c]);
    }
    return slab;
}

/* A slab that is length_mm long in each lane, for the packets in `marching`. With an integral of k over n entries depth
 * = length * k / n, and the colour integral weighs alpha / k: one division serves both. */
INLINE void add_slab(Light *light, vmask marching, const Slab *slab, vf length_mm)
{
    /* Without depth there is no colour either. */
    const vf k = slab->sum[3], kf = vf_max(k, vf_of(1e-25f));
    const vf inverse = 1.0f / (slab->n * kf);
    const vf halvings = (k * kf) * inverse * ((float)M_LOG2E * length_mm);
    vf alpha = CTS_MUTATED(ATTENUATION) ? vf_min(halvings, vf_of(1)) : one_minus_exp2(halvings);
    if (PACKETS > 1)
        alpha = select_f(marching, alpha, vf_of(0));
    const vf lost = light->t * alpha;
    const vf weight = lost * (slab->n * inverse);
    light->r = vf_fma(slab->sum[0], weight, light->r);
    light->g = vf_fma(slab->sum[1], weight, light->g);
    light->b = vf_fma(slab->sum[2], weight, light->b);
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
