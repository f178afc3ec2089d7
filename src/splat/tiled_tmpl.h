/* The march of PACKETS packets of 8 pixels, one below the other, in vectors of LANES pixels. Included by tiled_c.c,
 * tiled_avx2.c and tiled_avx512.c, which first define what tiled_vec_tmpl.h lists; everything else is element-wise and
 * the same in all. What is decided, is decided for each packet by itself, so that the picture does not depend on how
 * many march together. */
#include "splat/tiled_field_tmpl.h"
#include "splat/tiled_slab_tmpl.h"
#include <string.h>

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
        note_depth(j, light, t_before, vf_of((float)q + ((float)part - 1) / (float)j->samples),
                   vf_of(1 / (float)j->samples));
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
        note_depth(j, light, t_before, (float)q + f - share, share);
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
    const vmask faint = vf_lt(depth, nf * j->faint_depth);
    vf limit = select_f(stiff, vf_of(j->stiff_grey), vf_of(j->refine_grey));
    /* Where little is lost order matters little, but a bend does. */
    if (way == WAY_STRAIGHT)
        limit = select_f(faint, vf_of(INFINITY), limit);
    const unsigned cut = marching & ~all_in(vf_lt(vf_abs(end - s0) * seen, limit));
    if (cut) {
        add_parts(j, beam, pk, way, light, q, s0, end, inner, lit, marching, cut, any_in(stiff),
                  select_f(faint, vf_of(0), seen), e0, e1, &slope0, &slope1, course);
        return;
    }
    Glow glow;
    if (lit)
        glow = glow_between(j, &slope0, &slope1, vf_of(0.5f));
    const vf t_before = light->t;
    add_slab(j, light, mask_packets(marching), e0, e1, slab_length(j, beam, pk, q, vf_of(j->layer_mm), 1, whole),
             lit ? &glow : NULL);
    note_depth(j, light, t_before, vf_of((float)q), vf_of(1));
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

static void run_packets(const TiledJob *j, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    Packet pk;
    Light light = {.t = vf_of(1), .depth = vf_of(-1)};
    init_packet(j, &pk, spans);
    march_any(j, beam, &pk, &light, counts);
    complete(j, &light);
    float lanes[4][LANES], depth[LANES];
    memcpy(lanes[0], &light.r, sizeof light.r);
    memcpy(lanes[1], &light.g, sizeof light.g);
    memcpy(lanes[2], &light.b, sizeof light.b);
    memcpy(lanes[3], &light.a, sizeof light.a);
    memcpy(depth, &light.depth, sizeof depth);
    for (int h = 0; h < PACKETS; h++) {
        const int x = spans[h].x, y = spans[h].y, n = spans[h].n, from = h * CTS_PACKET;
        const size_t at = (size_t)(y - j->first_row) * (size_t)j->width + (size_t)x;
        for (int i = 0; i < n; i++)
            for (int c = 0; c < 4; c++)
                j->rgba[4 * (at + (size_t)i) + (size_t)c] = lanes[c][from + i];
        for (int i = 0; j->depth_mm && i < n; i++)
            if (depth[from + i] >= 0)
                j->depth_mm[at + (size_t)i] = tiled_depth_mm(j, x + i, y, depth[from + i]);
    }
}
