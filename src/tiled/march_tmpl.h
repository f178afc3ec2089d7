/* The march of PACKETS packets of 8 pixels, one below the other, in vectors of LANES pixels. Included by march_c.c,
 * march_avx2.c and march_avx512.c, which first define what vec_tmpl.h lists; everything else is element-wise and
 * the same in all. What is decided, is decided for each packet by itself, so that the picture does not depend on how
 * many march together. */
#include "tiled/light_tmpl.h"
#include <string.h>

/* Packets in which nothing shows between a and b, if the field runs straight. */
INLINE unsigned quiet_packets(const CtsSlabTable *t, vf a, vf b)
{
    return all_in(mask_or(vf_le(vf_max(a, b), vf_of(t->quiet_low)), vf_le(vf_of(t->quiet_high), vf_min(a, b))));
}

/* Which packets march through a slab from a to b, a bit each: those that are not opaque and in which something may
 * show. */
INLINE unsigned marching_packets(const TiledJob *j, const Light *light, vf a, vf b)
{
    const vmask quiet = mask_or(vf_le(vf_max(a, b), vf_of(j->quiet_low)), vf_le(vf_of(j->quiet_high), vf_min(a, b)));
    return ~(light->opaque | all_in(quiet)) & ALL_PACKETS;
}

/* The way of the rays from one sheet to another: from `part` of the `samples` to a layer on, over `span` of them. The
 * field runs on it as a parabola: s0 + (rise + bend f) f, f from 0 to 1. */
typedef struct Stretch {
    int q, part, span;
    float from, share; /* the same as fractions of a layer */
    vf s0, end, rise, bend;
} Stretch;

INLINE Stretch stretch_of(const TiledJob *j, int q, int part, int span, vf s0, vf end)
{
    const float samples = (float)j->samples;
    return (Stretch){q, part, span, (float)part / samples, (float)span / samples, s0, end, end - s0, vf_of(0)};
}

/* How it is cut: part p of a lane's `parts` ends at lead + p step, the last one at 1. */
typedef struct Cuts {
    vf parts, lead, step;
    int most;
    bool even; /* lead is 0 */
} Cuts;

INLINE vf field_at(const Stretch *way, vf f)
{
    return vf_fma(vf_fma(way->bend, f, way->rise), f, way->s0);
}

/* Optical depth of a stretch between two entries, times the nf entries between them. */
INLINE vf depth_times(const TiledJob *j, const Entry *e0, const Entry *e1, float length_mm)
{
    return vf_abs(to_float(e1->k - e0->k)) * (j->table.depth_scale * length_mm);
}

/* A slab's integral mixes its colours as if none hid another. What that errs by grows with the light that comes, with
 * the square of the depth, and with how far the field, and so the colour, runs: nf table entries. By how much it
 * exceeds what may stay, times nf. */
INLINE vf self_hiding(const TiledJob *j, vf t, vf nf, const Entry *e0, const Entry *e1, float length_mm)
{
    const vf d = vf_min(depth_times(j, e0, e1, length_mm), nf * j->full_depth);
    return t * d * d * j->hiding;
}

/* Halves the stretch until it is known where the table's sum is `target` away from that of e0. */
OUTLINE void find_depth(const TiledJob *j, const Stretch *way, const Entry *e0, vf target, vf *low, vf *high)
{
    enum { HALVINGS = 6 };
    *low = vf_of(0);
    *high = vf_of(1);
    for (int i = 0; i < HALVINGS; i++) {
        Entry e;
        const vf mid = (*low + *high) * 0.5f;
        look_up(j, field_at(way, mid), &e);
        const vmask short_of = vf_lt(vf_abs(to_float(e.k - e0->k)), target);
        *low = select_f(short_of, mid, *low);
        *high = select_f(short_of, *high, mid);
    }
}

/* The cuts of a stretch that takes much of the light. n parts leave 1 / n^2 of the error; of a stiff stretch, which
 * takes all of the light, only what light reaches is cut finely. */
OUTLINE Cuts cut_finely(const TiledJob *j, const Stretch way, vf nf, vf hiding, vmask stiff, unsigned cut,
                        unsigned bent, const Entry e0)
{
    enum { DOUBLINGS = 4 };
    Cuts c = {.most = 1};
    vf low = vf_of(0), high = vf_of(1);
    const unsigned some_stiff = any_in(stiff);
    if (some_stiff) {
        const vf per_depth = nf * (1 / (j->table.depth_scale * j->layer_mm * way.share));
        vf unused;
        find_depth(j, &way, &e0, per_depth * (0.02f * j->full_depth), &low, &unused);
        find_depth(j, &way, &e0, per_depth * j->full_depth, &unused, &high);
        hiding = select_f(stiff, hiding * (high - low), hiding);
    }
    unsigned doubled[DOUBLINGS];
    for (int i = 0; i < DOUBLINGS; i++)
        doubled[i] = ~all_in(vf_le(hiding, nf * (float)(1 << 2 * i)));
    float parts[PACKETS], shares[PACKETS], inner_shares[PACKETS];
    for (int h = 0; h < PACKETS; h++) {
        int n = !(cut >> h & 1) ? 1 : some_stiff >> h & 1 ? 8 : bent >> h & 1 ? 4 : 2;
        for (int i = 1; i < DOUBLINGS && n > 1; i++)
            n = doubled[i] >> h & 1 && n < 2 << i ? 2 << i : n;
        parts[h] = (float)n;
        shares[h] = 1.0f / (float)n;
        inner_shares[h] = 1.0f / (float)(n > 2 ? n - 2 : 1);
        c.most = n > c.most ? n : c.most;
    }
    /* Of a stiff one the first and the last part are what lies around. */
    const vf inner_step = (high - low) * vf_packets(inner_shares);
    c.parts = vf_packets(parts);
    c.step = select_f(stiff, inner_step, vf_packets(shares));
    c.lead = select_f(stiff, low - inner_step, vf_of(0));
    return c;
}

/* Parts cost table entries, no voxels. hiding: self_hiding of the stretch. */
INLINE Cuts find_cuts(const TiledJob *j, const Stretch *way, vf t, vf nf, vf hiding, unsigned cut, unsigned bent,
                      const Entry *e0, const Entry *e1)
{
    const vf depth = depth_times(j, e0, e1, j->layer_mm * way->share);
    const vmask stiff = vf_lt(nf * j->stiff_depth, depth * t);
    bent &= cut & ~all_in(vf_lt(depth, nf * j->faint_depth)); /* a bend of what hardly shows shows less */
    if (__builtin_expect((cut & (any_in(stiff) | ~all_in(vf_le(hiding, nf * 4.0f)))) != 0, 0))
        return cut_finely(j, *way, nf, hiding, stiff, cut, bent, *e0);
    const vmask in_two = mask_packets(cut), in_four = mask_packets(bent);
    return (Cuts){.parts = select_f(in_four, vf_of(4), select_f(in_two, vf_of(2), vf_of(1))),
                  .step = select_f(in_four, vf_of(0.25f), select_f(in_two, vf_of(0.5f), vf_of(1))),
                  .lead = vf_of(0),
                  .most = bent ? 4 : 2,
                  .even = true};
}

/* The part of a stretch from f0 to f1 that the faces of a slab leave, with the field where they cut it. */
OUTLINE void cut_part(const TiledJob *j, Packet *pk, const Stretch *way, vf f0, vf f1, Entry *before, Entry *after)
{
    if (!pk->clipped)
        clip_packet(j, pk);
    vf in, out;
    for (int l = 0; l < LANES; l++) {
        const double enter = (pk->enter[l] - way->q - (double)way->from) / (double)way->share;
        const double leave = (pk->leave[l] - way->q - (double)way->from) / (double)way->share;
        in[l] = enter > 0 ? (float)enter : 0;
        out[l] = leave < 1 ? (float)leave : 1;
    }
    look_up(j, field_at(way, vf_min(vf_max(f0, in), f1)), before);
    look_up(j, field_at(way, vf_max(vf_min(f1, out), f0)), after);
}

INLINE bool is_cut(const TiledJob *j, const TiledBeam *beam, int q)
{
    return __builtin_expect(j->slab, 0) && (q < beam->full_from || q >= beam->full_to);
}

/* Part by part. even: all of a packet are equally long. */
INLINE void add_cut(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                    const Cuts *cuts, bool even, unsigned marching, const Entry *e0, const Entry *e1, vf *moment)
{
    const vmask marches = mask_packets(marching);
    const float whole_mm = way->share * j->layer_mm;
    const vf even_mm = cuts->step * whole_mm;
    Entry before = *e0;
    vf f0 = vf_of(0);
    for (int p = 1; p <= cuts->most; p++) {
        const vf count = vf_of((float)p);
        const vmask at_end = vf_le(cuts->parts, count);
        vf f1 = even ? count * cuts->step : select_f(at_end, vf_of(1), cuts->lead + count * cuts->step);
        Entry after = *e1;
        if (p < cuts->most)
            look_up(j, select_f(at_end, way->end, field_at(way, f1)), &after);
        const vf t_before = light->t, from = way->from + way->share * f0, to = way->from + way->share * f1;
        const vf length_mm = slab_length(j, beam, pk, way->q, from, to, even ? even_mm : (f1 - f0) * whole_mm);
        Entry first = before, last = after;
        if (is_cut(j, beam, way->q))
            cut_part(j, pk, way, f0, f1, &first, &last);
        add_slab(j, light, mask_and(marches, vf_le(count, cuts->parts)), &first, &last, length_mm);
        if (moment)
            *moment += (t_before - light->t) * (0.5f * (f0 + f1));
        note_depth(j, light, t_before, (float)way->q + from, to - from);
        before = after;
        f0 = f1;
    }
}

INLINE void add_whole(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                      unsigned marching, const Entry *e0, const Entry *e1, vf *moment)
{
    const vf t_before = light->t, from = vf_of(way->from), to = vf_of(way->from + way->share);
    const vf length_mm = slab_length(j, beam, pk, way->q, from, to, vf_of(way->share * j->layer_mm));
    Entry first = *e0, last = *e1;
    if (is_cut(j, beam, way->q))
        cut_part(j, pk, way, vf_of(0), vf_of(1), &first, &last);
    add_slab(j, light, mask_packets(marching), &first, &last, length_mm);
    if (moment)
        *moment += (t_before - light->t) * 0.5f;
    note_depth(j, light, t_before, (float)way->q + from, to - from);
}

/* A stretch from entry e0 to e1, at once or in as many parts as it asks for. What it takes of the light, each time how
 * far on, is added to moment. */
INLINE void add_parts(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                      unsigned looked, unsigned bent, unsigned marching, const Entry *e0, const Entry *e1, vf *moment)
{
    const vf nf = vf_abs(to_float(e1->index - e0->index));
    const vf hiding = self_hiding(j, light->t, nf, e0, e1, j->layer_mm * way->share);
    const unsigned cut = marching & (looked | bent | ~all_in(vf_le(hiding, nf)));
    if (!cut) {
        add_whole(j, beam, pk, light, way, marching, e0, e1, moment);
        return;
    }
    const Cuts cuts = find_cuts(j, way, light->t, nf, hiding, cut, bent, e0, e1);
    if (cuts.even)
        add_cut(j, beam, pk, light, way, &cuts, true, marching, e0, e1, moment);
    else
        add_cut(j, beam, pk, light, way, &cuts, false, marching, e0, e1, moment);
}

/* Gives a stretch the field half way, for the packets in look; returns which of them it bends for. */
INLINE unsigned bend_stretch(const TiledJob *j, Stretch *way, vf mid, vf t, unsigned look)
{
    way->bend = select_f(mask_packets(look), 2 * (way->s0 + way->end) - 4 * mid, vf_of(0));
    way->rise = way->end - way->s0 - way->bend;
    return ~all_in(vf_lt(vf_abs(way->bend) * t, vf_of(j->bend_grey)));
}

/* A stretch that bends much, as two with a sheet half way through each. */
OUTLINE Light add_halves(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light own_light,
                         const Stretch whole, vf mid, vf t, bool inner, unsigned marching, const Entry e0,
                         const Entry e1, vf *moment)
{
    const int span = whole.span / 2;
    Light *light = &own_light;
    Entry half;
    look_up(j, mid, &half);
    for (int side = 0; side < 2; side++) {
        const int part = whole.part + side * span;
        Stretch stretch = stretch_of(j, whole.q, part, span, side ? mid : whole.s0, side ? whole.end : mid);
        const vf quarter = sample_sheet(j, pk, way, whole.q, part + span / 2, inner);
        const unsigned bent = bend_stretch(j, &stretch, quarter, t, ALL_PACKETS);
        const vf t_before = light->t;
        vf own = vf_of(0);
        add_parts(j, beam, pk, light, &stretch, ALL_PACKETS, bent, marching, side ? &half : &e0, side ? &e1 : &half,
                  moment ? &own : NULL);
        if (moment)
            *moment += 0.5f * ((float)side * (t_before - light->t) + own);
    }
    return own_light;
}

/* A stretch from entry e0 to e1 that nothing is known of but its ends. */
INLINE void add_stretch(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, Stretch *stretch,
                        bool inner, unsigned marching, const Entry *e0, const Entry *e1, Lit *lit, Course *course)
{
    const int q = stretch->q, middle = stretch->part + stretch->span / 2;
    const vf s0 = stretch->s0, end = stretch->end;
    unsigned bent = 0, halved = 0, looked = 0;
    vf mid;
    const vf t_before = light->t, t = vf_min(4.0f * t_before, vf_of(1)); /* what gets some light counts as if all */
    if (way != WAY_STRAIGHT) {
        /* Where it runs far, or its rise is not that of the way before, the field bends somewhere; and where it is
         * nearly visible, it may become so. Only a sheet half way tells. */
        const vf rise = end - s0, turn = vf_max(vf_abs(rise), vf_abs(rise - (s0 - course->before)));
        const unsigned quiet = quiet_packets(&j->table, s0, end);
        const unsigned look = marching & (quiet | ~all_in(vf_lt(turn * t, vf_of(j->refine_grey))));
        looked = look;
        if (look) {
            mid = sample_sheet(j, pk, way, q, middle, inner);
            marching &= ~(quiet & quiet_packets(&j->table, mid, mid));
            if (!marching)
                return;
            bent = bend_stretch(j, stretch, mid, t, look);
            halved = look & marching & ~all_in(vf_lt(vf_abs(stretch->bend) * t, vf_of(j->halve_grey)));
        }
    }
    vf moment = vf_of(0);
    if (__builtin_expect(halved != 0, 0)) {
        vf halves = vf_of(0); /* copies: what a function is given the address of, is kept in memory everywhere */
        *light = add_halves(j, beam, pk, way, *light, *stretch, mid, t, inner, halved, *e0, *e1, lit ? &halves : NULL);
        moment = halves;
    }
    if (marching & ~halved)
        add_parts(j, beam, pk, light, stretch, looked, bent, marching & ~halved, e0, e1, lit ? &moment : NULL);
    if (lit)
        light_stretch(j, pk, way, q, stretch->part, stretch->span, inner, t_before - light->t, moment, bent | halved,
                      light, lit, course);
}

/* The slab behind layer q with several sheets in it. */
OUTLINE void add_sheets(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0,
                        vf end, bool inner, Lit *lit, Course *course)
{
    const int span = j->samples / j->sheets;
    Entry e0, e1;
    bool have_entry = false;
    course->before = s0 - (s0 - course->before) * (1 / (float)j->sheets);
    for (int part = 0; part < j->samples; part += span) {
        const vf s1 = part + span == j->samples ? end : sample_sheet(j, pk, way, q, part + span, inner);
        const unsigned marching = marching_packets(j, light, s0, s1);
        if (marching) {
            if (!have_entry)
                look_up(j, s0, &e0);
            look_up(j, s1, &e1);
            Stretch stretch = stretch_of(j, q, part, span, s0, s1);
            add_stretch(j, beam, pk, way, light, &stretch, inner, marching, &e0, &e1, lit, course);
            e0 = e1;
        }
        have_entry = marching != 0;
        course->before = s0;
        s0 = s1;
    }
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
    Lit own_lit = no_light();
    vf s0 = vf_of(0);
    Course course = start_course(counts->marches % TILED_TIMED_MARCHES == 0);
    Entry entry; /* of s0, on layer entry_layer */
    entry.index = entry.r = entry.g = entry.b = entry.k = vi_of(0);
    int entry_layer = -1;
    int reached = -1; /* s0 is the field on this layer */
    uint64_t samples = 0, slabs = 0;
    bool opaque = false;
    const bool timed = course.timed;
    uint64_t start = timed ? cts_tiled_ticks() : 0, composite = 0;
    for (int r = 0; !opaque && (r < beam->n_runs || cts_tiled_beam_extend(j, beam)); r++) {
        const TiledRun run = beam->runs[r];
        if (run.from != reached)
            course.before = s0 = sample_sheet(j, pk, way, run.from, 0, run.inner);
        reached = run.to;
        for (int q = run.from; q < run.to && !opaque; q++) {
            const vf end = sample_sheet(j, pk, way, q + 1, 0, run.inner);
            samples++;
            const unsigned marching = j->sheets == 1 ? marching_packets(j, light, s0, end) : ALL_PACKETS;
            if (marching) {
                const uint64_t before = timed ? cts_tiled_ticks() : 0;
                slabs++;
                if (j->sheets == 1) {
                    Stretch slab = {q, 0, 4, 0, 1, s0, end, end - s0, vf_of(0)};
                    Entry next;
                    if (entry_layer != q)
                        look_up(j, s0, &entry);
                    look_up(j, end, &next);
                    add_stretch(j, beam, pk, way, light, &slab, run.inner, marching, &entry, &next,
                                lit ? &own_lit : NULL, &course);
                    entry = next;
                    entry_layer = q + 1;
                } else {
                    /* Copies: what a function is given the address of, is kept in memory everywhere. */
                    Light sheets = *light;
                    Lit sheets_lit = own_lit;
                    Course sheets_course = course;
                    add_sheets(j, beam, pk, way, &sheets, q, s0, end, run.inner, lit ? &sheets_lit : NULL,
                               &sheets_course);
                    *light = sheets;
                    own_lit = sheets_lit;
                    course = sheets_course;
                }
                opaque = all_opaque(j, light);
                composite += timed ? cts_tiled_ticks() - before : 0;
            }
            course.before = s0;
            s0 = end;
        }
    }
    if (lit)
        light_rest(j, pk, way, light, &own_lit);
    if (timed) {
        counts->composite_ticks += composite - course.ticks;
        counts->shade_ticks += course.ticks;
        counts->splat_ticks += cts_tiled_ticks() - start - composite;
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
MARCH(march_near, WAY_NEAR, false)
MARCH(march_wide, WAY_WIDE, false)
MARCH(march_straight_lit, WAY_STRAIGHT, true)
MARCH(march_oblique_lit, WAY_OBLIQUE, true)
MARCH(march_near_lit, WAY_NEAR, true)
MARCH(march_wide_lit, WAY_WIDE, true)
#undef MARCH

static void march_any(const TiledJob *j, TiledBeam *beam, Packet *pk, Light *light, TiledCounts *counts)
{
    if (!j->windowed)
        (j->shade ? march_wide_lit : march_wide)(j, beam, pk, light, counts);
    else if (j->straight)
        (j->shade ? march_straight_lit : march_straight)(j, beam, pk, light, counts);
    else if (PACKETS > 1 && pk->near)
        (j->shade ? march_near_lit : march_near)(j, beam, pk, light, counts);
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
    Light light;
    light.r = light.g = light.b = light.a = vf_of(0);
    light.t = vf_of(1);
    light.depth = vf_of(-1);
    light.opaque = 0;
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
                j->depth_mm[at + (size_t)i] = cts_tiled_depth_mm(j, x + i, y, depth[from + i]);
    }
}
