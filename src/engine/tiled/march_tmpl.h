/* The march of PACKETS packets of 8 pixels, one below the other, in vectors of LANES pixels. Included by march_c.c,
 * march_avx2.c and march_avx512.c, which first define what vec_tmpl.h lists; everything else is element-wise and
 * the same in all. What is decided, is decided for each packet by itself, so that the picture does not depend on how
 * many march together. */
#include "engine/tiled/light_tmpl.h"
#include <string.h>

/* The way of the rays from one sheet to another: from `part` of the `samples` to a layer on, over `span` of them. The
 * field runs on it as a parabola: s0 + (rise + bend f) f, f from 0 to 1. */
typedef struct Stretch {
    int q, part, span;
    float from, share; /* the same as fractions of a layer */
    vf s0, end, rise, bend;
    TiledBend most; /* of its slab */
    vf known;       /* the field is at most so far off the parabola: what a look at the whole says of its halves */
} Stretch;

INLINE Stretch stretch_of(const TiledJob *j, int q, int part, int span, vf s0, vf end, TiledBend most)
{
    const float samples = (float)j->samples;
    return (Stretch){q,        part,     span, (float)part / samples, (float)span / samples, s0, end,
                     end - s0, vf_of(0), most, vf_of(INFINITY)};
}

/* How it is cut: part p of a lane's `parts` ends at lead + p step, the last one at 1. */
typedef struct Cuts {
    vf parts, lead, step;
    int most;
    bool even; /* lead is 0 */
} Cuts;

/* The parabola, which may overshoot what there is. */
INLINE vf field_at(const TiledJob *j, const Stretch *way, vf f)
{
    const vf x = vf_fma(vf_fma(way->bend, f, way->rise), f, way->s0);
    return vf_min(vf_max(x, vf_of(j->grey_least)), vf_of(j->grey_most));
}

/* How far the field is off the parabola at most, from what the slab's voxels allow. */
INLINE float off_by_bend(const Stretch *way)
{
    const float most = (0.0963f * way->most.kink + 0.0377f * way->most.twist * way->share) * way->share;
    return CTS_MUTATED(HIDDEN) ? 0 : most;
}

/* even_share() of a parabola, which is nowhere flatter than its ends less its bend, and where it turns is soon away. */
INLINE vf worst_share(const Stretch *way, vf off)
{
    const vf bend = vf_abs(way->bend), some = vf_of(1e-6f);
    const vf flattest = vf_max(vf_abs(way->end - way->s0) - bend, some), turning = off / vf_max(bend, some);
    return vf_min(vf_min(2 * off / flattest, 2.83f * (turning * inverse_sqrt(turning))), vf_of(1));
}

/* The way of each lane's ray on a stretch, in 2^-16 voxels. */
typedef struct Line {
    vi u, v;
    vf du, dv;
} Line;

/* How far the field is off the parabola a fraction f of the way on. */
INLINE vf off_at(const TiledJob *j, const Stretch *way, const Line *line, vf f)
{
    const Gather gather = gather_at(j, line->u + to_int(line->du * f), line->v + to_int(line->dv * f));
    const uint16_t *layer = j->layer0 + way->q * j->layer_stride;
    const vf here = load_gather(j, &gather, layer), next = load_gather(j, &gather, layer + j->layer_stride);
    return vf_abs(here + (way->from + way->share * f) * (next - here) - field_at(j, way, f));
}

/* Where the way crosses a voxel face; where it crosses none, its beginning or its end. */
INLINE vf kink_of(vi from, vi by)
{
    const vi face = vi_max(from, from + by) & ~0xffff;
    const vf length = select_f(vi_eq(by, vi_of(0)), vf_of(1), to_float(by));
    return vf_min(vf_max(to_float(face - from) / length, vf_of(0)), vf_of(1));
}

/* Whether lanes' positions fit what off_by_looks() reckons with. */
INLINE bool can_look(const TiledJob *j, Way way)
{
    return way != WAY_STRAIGHT && (way != WAY_WIDE || j->gathers);
}

/* How far the field is off the parabola at most, from a look at its kinks and half way between them. */
OUTLINE vf off_by_looks(const TiledJob *j, const Packet *pk, const Stretch *way)
{
    int32_t pu[PACKETS], pv[PACKETS];
    const int sheet = way->q * j->samples + way->part;
    sheet_start(j, pk, sheet, pu, pv);
    const vi u = lane_positions(pu, j->lane_u), v = lane_positions(pv, j->lane_v);
    sheet_start(j, pk, sheet + way->span, pu, pv);
    const vi du = lane_positions(pu, j->lane_u) - u, dv = lane_positions(pv, j->lane_v) - v;
    const Line line = {u, v, to_float(du), to_float(dv)};
    const vf a = kink_of(u, du), b = kink_of(v, dv), first = vf_min(a, b), last = vf_max(a, b);
    vf most = vf_max(off_at(j, way, &line, first), off_at(j, way, &line, last));
    most = vf_max(most, off_at(j, way, &line, 0.5f * first));
    most = vf_max(most, off_at(j, way, &line, 0.5f * (first + last)));
    most = vf_max(most, off_at(j, way, &line, 0.5f * (1 + last)));
    const vf apart = vf_max(vf_max(first, last - first), 1 - last) * way->share;
    return 1.25f * most + 0.0482f * way->most.cubic * (apart * apart * apart);
}

/* Halves the stretch until it is known where the table's sum is `target` away from that of e0. */
OUTLINE void find_depth(const TiledJob *j, const Stretch *way, vi e0, vf target, vf *low, vf *high)
{
    enum { HALVINGS = 6 };
    *low = vf_of(0);
    *high = vf_of(1);
    for (int i = 0; i < HALVINGS; i++) {
        const vf mid = (*low + *high) * 0.5f;
        vf sum[4];
        look_up_difference(j->table.sum, j->table.n, e0, entry_of(j, field_at(j, way, mid)), sum);
        const vmask short_of = vf_lt(vf_abs(sum[3]), target);
        *low = select_f(short_of, mid, *low);
        *high = select_f(short_of, *high, mid);
    }
}

/* The cuts of a stretch that takes much of the light. n parts leave 1 / n^2 of the error; of a stiff stretch, which
 * takes all of the light, only what light reaches is cut finely. */
OUTLINE Cuts cut_finely(const TiledJob *j, const Stretch way, vf nf, vf hiding, vmask stiff, unsigned cut,
                        unsigned bent, vi e0)
{
    enum { DOUBLINGS = 4 };
    Cuts c = {.most = 1};
    vf low = vf_of(0), high = vf_of(1);
    const unsigned some_stiff = any_in(stiff);
    if (some_stiff) {
        const vf per_depth = nf * (1 / (j->layer_mm * way.share));
        vf unused;
        find_depth(j, &way, e0, per_depth * (0.02f * j->full_depth), &low, &unused);
        find_depth(j, &way, e0, per_depth * j->full_depth, &unused, &high);
        hiding = select_f(stiff, hiding * (high - low), hiding);
    }
    unsigned doubled[DOUBLINGS];
    for (int i = 0; i < DOUBLINGS; i++)
        doubled[i] = ~all_in(vf_le(hiding, vf_of((float)(1 << 2 * i))));
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

/* Parts cost table entries, no voxels. */
INLINE Cuts find_cuts(const TiledJob *j, const Stretch *way, vf t, vf nf, vf depth, vf hiding, unsigned cut,
                      unsigned bent, vi e0)
{
    const vmask stiff = vf_lt(vf_of(j->stiff_depth), depth * t);
    if (__builtin_expect((cut & (any_in(stiff) | ~all_in(vf_le(hiding, vf_of(4))))) != 0, 0))
        return cut_finely(j, *way, nf, hiding, stiff, cut, bent, e0);
    const vmask in_two = mask_packets(cut), in_four = mask_packets(bent);
    return (Cuts){.parts = select_f(in_four, vf_of(4), select_f(in_two, vf_of(2), vf_of(1))),
                  .step = select_f(in_four, vf_of(0.25f), select_f(in_two, vf_of(0.5f), vf_of(1))),
                  .lead = vf_of(0),
                  .most = bent ? 4 : 2,
                  .even = true};
}

/* The part of a stretch from f0 to f1 that the volume's faces, or a slab's, leave, with the field where they cut it. */
OUTLINE void cut_part(const TiledJob *j, Packet *pk, const Stretch *way, vf f0, vf f1, vi *before, vi *after)
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
    *before = entry_of(j, field_at(j, way, vf_min(vf_max(f0, in), f1)));
    *after = entry_of(j, field_at(j, way, vf_max(vf_min(f1, out), f0)));
}

INLINE bool is_cut(const TiledBeam *beam, int q)
{
    return __builtin_expect(q < beam->full_from || q >= beam->full_to, 0);
}

/* Part by part. even: all of a packet are equally long. */
INLINE void add_cut(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                    const Cuts *cuts, bool even, unsigned marching, vi e0, vi e1, vf *moment)
{
    const vmask marches = mask_packets(marching);
    const float whole_mm = way->share * j->layer_mm;
    const vf even_mm = cuts->step * whole_mm;
    vi before = e0;
    vf f0 = vf_of(0);
    for (int p = 1; p <= cuts->most; p++) {
        const vf count = vf_of((float)p);
        const vmask at_end = vf_le(cuts->parts, count);
        vf f1 = even ? count * cuts->step : select_f(at_end, vf_of(1), cuts->lead + count * cuts->step);
        vi after = e1;
        if (p < cuts->most)
            after = entry_of(j, select_f(at_end, way->end, field_at(j, way, f1)));
        const vf t_before = light->t, from = way->from + way->share * f0, to = way->from + way->share * f1;
        const vf length_mm = slab_length(j, beam, pk, way->q, from, to, even ? even_mm : (f1 - f0) * whole_mm);
        vi first = before, last = after;
        if (is_cut(beam, way->q))
            cut_part(j, pk, way, f0, f1, &first, &last);
        const Slab slab = slab_of(j, first, last);
        add_slab(light, mask_and(marches, vf_le(count, cuts->parts)), &slab, length_mm);
        if (moment)
            *moment += (t_before - light->t) * (0.5f * (f0 + f1));
        note_depth(j, light, t_before, (float)way->q + from, to - from);
        before = after;
        f0 = f1;
    }
}

INLINE void add_whole(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                      unsigned marching, const Slab *whole, vf *moment)
{
    const vf t_before = light->t, from = vf_of(way->from), to = vf_of(way->from + way->share);
    const vf length_mm = slab_length(j, beam, pk, way->q, from, to, vf_of(way->share * j->layer_mm));
    Slab slab = *whole;
    if (is_cut(beam, way->q)) {
        vi first, last;
        cut_part(j, pk, way, vf_of(0), vf_of(1), &first, &last);
        slab = slab_of(j, first, last);
    }
    add_slab(light, mask_packets(marching), &slab, length_mm);
    if (moment)
        *moment += (t_before - light->t) * 0.5f;
    note_depth(j, light, t_before, (float)way->q + from, to - from);
}

/* A stretch at once or in as many parts as it asks for: two where its bend may matter, four in `bent`. What it takes of
 * the light, each time how far on, is added to moment. */
INLINE void add_parts(const TiledJob *j, const TiledBeam *beam, Packet *pk, Light *light, const Stretch *way,
                      unsigned matters, unsigned bent, unsigned marching, vi e0, vi e1, vf *moment)
{
    const Slab whole = slab_of(j, e0, e1);
    const vf t = light->t, nf = whole.n, depth = whole.sum[3] * (j->layer_mm * way->share) / nf;
    const vf shown = vf_min(depth, vf_of(j->full_depth));
    /* The slab's integral mixes its colours as if none hid another, which is wrong by a quarter of depth^2 at most and
     * by how far the colours lie apart. */
    const vf apart = vf_min(nf * j->tint, vf_of(j->table.colour_range));
    const vf mixing = t * shown * shown * apart * 0.25f, hiding = mixing * (1 / j->may_mix);
    const unsigned cut = marching & (matters | ~all_in(vf_le(hiding, vf_of(1))));
    const vmask now = mask_packets(marching);
    if (!cut) {
        light->doubt.colour += select_f(now, mixing * mixing, vf_of(0));
        add_whole(j, beam, pk, light, way, marching, &whole, moment);
        return;
    }
    const Cuts cuts = find_cuts(j, way, t, nf, depth, hiding, cut, cut & bent, e0);
    const vf mixed = mixing / (cuts.parts * cuts.parts);
    light->doubt.colour += select_f(now, mixed * mixed, vf_of(0));
    if (cuts.even)
        add_cut(j, beam, pk, light, way, &cuts, true, marching, e0, e1, moment);
    else
        add_cut(j, beam, pk, light, way, &cuts, false, marching, e0, e1, moment);
}

OUTLINE void add_halves(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light,
                        const Stretch *whole, vf mid, bool inner, unsigned marching, Lit *lit, Course *course);

/* What the stretch, of which t_before was left, may be wrong by. */
OUTLINE void note_doubt(const TiledJob *j, Light *light, const Lit *lit, const Colour *colour, vf t_before, vf depth,
                        unsigned packets)
{
    const vmask now = mask_packets(packets);
    depth = select_f(now, depth, vf_of(0));
    Colour c = *colour, sum = {light->r, light->g, light->b};
    if (lit)
        show_lit(lit, &c, &sum);
    note_depth_doubt(&light->doubt, depth, vf_fma(light->t, c.r, sum.r), vf_fma(light->t, c.g, sum.g),
                     vf_fma(light->t, c.b, sum.b));
    const vf stop = vf_of(j->stop_transmittance);
    const vmask ends = mask_and(mask_and(vf_lt(light->t, stop), vf_le(stop, t_before)), vf_lt(vf_of(1e-3f), depth));
    if (any_in(ends)) {
        const vf shown = unknown_behind(t_before, light->t, depth);
        light->doubt.colour += select_f(ends, shown * shown, vf_of(0));
    }
}

/* Makes undone what a stretch did to these packets. */
OUTLINE void take_back(unsigned packets, const Light *light_before, const Lit *lit_before, Light *light, Lit *lit)
{
    const vmask now = mask_packets(packets);
    const Doubt *d = &light_before->doubt;
    light->r = select_f(now, light_before->r, light->r);
    light->g = select_f(now, light_before->g, light->g);
    light->b = select_f(now, light_before->b, light->b);
    light->a = select_f(now, light_before->a, light->a);
    light->t = select_f(now, light_before->t, light->t);
    light->depth = select_f(now, light_before->depth, light->depth);
    light->doubt =
        (Doubt){select_f(now, d->depth, light->doubt.depth),   select_f(now, d->r, light->doubt.r),
                select_f(now, d->g, light->doubt.g),           select_f(now, d->b, light->doubt.b),
                select_f(now, d->square, light->doubt.square), select_f(now, d->colour, light->doubt.colour)};
    lit->r = select_f(now, lit_before->r, lit->r);
    lit->g = select_f(now, lit_before->g, lit->g);
    lit->b = select_f(now, lit_before->b, lit->b);
    lit->due = select_f(now, lit_before->due, lit->due);
    lit->glow.colour = select_f(now, lit_before->glow.colour, lit->glow.colour);
    lit->glow.white = select_f(now, lit_before->glow.white, lit->glow.white);
    lit->last = select_i(now, lit_before->last, lit->last);
    lit->had = (lit->had & ~packets) | (lit_before->had & packets);
}

/* Bounds are at least so much of what a stretch may be wrong by (march.h). */
#define BOUND_SHARE 0.125f

/* A stretch that nothing is known of but its ends, from entry e0 to e1. */
INLINE void add_stretch(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, Stretch *stretch,
                        bool inner, unsigned marching, vi e0, vi e1, Lit *lit, Course *course)
{
    const float length_mm = j->layer_mm * stretch->share;
    const vf s0 = stretch->s0, end = stretch->end;
    vf low = vf_min(s0, end), high = vf_max(s0, end), off = vf_of(j->rounding), far = off, turn = off, mid = s0;
    if (way != WAY_STRAIGHT) {
        mid = sample_sheet(j, pk, way, stretch->q, stretch->part + stretch->span / 2, inner);
        stretch->bend = 2 * (s0 + end) - 4 * mid;
        stretch->rise = end - s0 - stretch->bend;
        low = vf_min(low, mid);
        high = vf_max(high, mid);
        /* Where the parabola turns it is up to a sixteenth of its bend beside all three. */
        turn = vf_abs(stretch->bend) * (1.0f / 16);
        far = off / BOUND_SHARE + vf_min(stretch->known, vf_of(off_by_bend(stretch))) + turn;
        off += 6 * turn;
        far = vf_max(far, off);
    }
    const vmask quiet =
        mask_or(vf_le(high + far, vf_of(j->table.quiet_low)), vf_le(vf_of(j->table.quiet_high), low - far));
    marching &= ~(light->opaque | all_in(quiet));
    if (!marching)
        return;
    vf depth = far * (0.5f * length_mm * j->table.steepest[0]), risk = light->t * depth * j->range;
    vf tint = vf_min(far * (0.5f * j->table.steepest[1]), vf_of(j->table.colour_range));
    const unsigned closely =
        marching & (any_in(vf_lt(vf_of(j->let_pass), risk)) | (j->hard_tint ? any_in(vf_lt(vf_of(0), tint)) : 0));
    unsigned bent = 0;
    if (closely) {
        const vmask now = mask_packets(closely);
        vf found = depth, found_tint = tint;
        vf most = 0.5f * off, share = even_share(low, high, most);
        if (way != WAY_STRAIGHT) {
            most = far;
            share = even_share(low, high, far);
        }
        look_up_doubt(j, low, high, most, share, length_mm, &found, &found_tint);
        unsigned seen = 0;
        if (way != WAY_STRAIGHT) {
            const vf possible = light->t * found * j->range;
            const vmask much = vf_lt(vf_of(j->may_hide), possible);
            const unsigned hides = closely & any_in(much);
            found *= BOUND_SHARE;
            found_tint *= BOUND_SHARE;
            if (hides) {
                vf told = found, told_tint = found_tint;
                most = 0.5f * off;
                look_up_doubt(j, low, high, most, even_share(low, high, most), length_mm, &told, &told_tint);
                const vmask worse = mask_packets(hides);
                seen = hides & any_in(mask_and(much, vf_lt(told, found)));
                found = select_f(worse, vf_max(told, found), found);
                found_tint = select_f(worse, vf_max(told_tint, found_tint), found_tint);
            }
            if (seen) {
                /* Copies: what a function is given the address of, is kept in memory everywhere. */
                const Stretch copy = *stretch;
                const vmask looked = mask_packets(seen);
                vf told, told_tint = tint;
                most = vf_of(off_by_bend(&copy));
                if (can_look(j, way))
                    most = off_by_looks(j, pk, &copy);
                /* A parabola through three places of the half is at most 5/4 of that off the whole's. */
                stretch->known = select_f(looked, 2.25f * most, stretch->known);
                most = j->rounding + vf_max(most, vf_min(0.5f * off, 2 * most));
                most += 1.25f * turn; /* four straight lines stand for the parabola */
                look_up_doubt(j, low, high, most, worst_share(&copy, most), length_mm, &told, &told_tint);
                found = select_f(looked, told, found);
                found_tint = select_f(looked, told_tint, found_tint);
            }
        }
        depth = select_f(now, found, depth);
        tint = select_f(now, found_tint, tint);
        risk = light->t * depth * j->range;
        bent = seen | (closely & any_in(vf_lt(vf_of(j->may_mix), risk)));
        const unsigned deep =
            way != WAY_STRAIGHT && stretch->span > 2 ? closely & any_in(vf_lt(vf_of(j->may_change), risk)) : 0;
        if (__builtin_expect(deep != 0, 0)) {
            /* Copies: what a function is given the address of, is kept in memory everywhere. */
            Light halves = *light;
            Course halves_course = *course;
            Stretch whole = *stretch;
            if (lit) {
                Lit halves_lit = *lit;
                add_halves(j, beam, pk, way, &halves, &whole, mid, inner, deep, &halves_lit, &halves_course);
                *lit = halves_lit;
            } else {
                add_halves(j, beam, pk, way, &halves, &whole, mid, inner, deep, NULL, &halves_course);
            }
            *light = halves;
            *course = halves_course;
            marching &= ~deep;
            if (!marching)
                return;
        }
    }
    const Colour before = {light->r, light->g, light->b};
    const vf t_before = light->t;
    const bool may_redo = lit && stretch->span > 2;
    Light light_before;
    Lit lit_before;
    if (may_redo) {
        light_before = *light;
        lit_before = *lit;
    }
    vf moment = vf_of(0);
    add_parts(j, beam, pk, light, stretch, closely, bent, marching, e0, e1, lit ? &moment : NULL);
    const vf lost = t_before - light->t;
    Colour colour = before;
    if (marching & closely)
        colour = colour_of(j, light, &before, lost);
    if (lit) {
        const unsigned uneven = marching & light_stretch(j, pk, way, false, stretch->q, stretch->part, stretch->span,
                                                         inner, lost, moment, light, lit, course);
        if (may_redo && uneven) {
            Light redone = *light;
            Lit redone_lit = *lit;
            Course redone_course = *course;
            Stretch whole = *stretch;
            take_back(uneven, &light_before, &lit_before, &redone, &redone_lit);
            add_halves(j, beam, pk, way, &redone, &whole, way == WAY_STRAIGHT ? 0.5f * (s0 + end) : mid, inner, uneven,
                       &redone_lit, &redone_course);
            *light = redone;
            *lit = redone_lit;
            *course = redone_course;
            marching &= ~uneven;
        }
    }
    const unsigned noted = marching & closely;
    vf other = lost * tint;
    other *= other;
    if (noted) {
        Light copy = *light;
        if (lit) {
            const Lit lit_copy = *lit;
            note_doubt(j, &copy, &lit_copy, &colour, t_before, depth, noted);
        } else {
            note_doubt(j, &copy, NULL, &colour, t_before, depth, noted);
        }
        *light = copy;
    }
    other += select_f(mask_packets(noted), vf_of(0), risk * risk);
    light->doubt.colour += select_f(mask_packets(marching), other, vf_of(0));
}

/* A stretch whose bend may change the pixel by more than is allowed, as two. */
OUTLINE void add_halves(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light,
                        const Stretch *whole, vf mid, bool inner, unsigned marching, Lit *lit, Course *course)
{
    const int span = whole->span / 2;
    for (int side = 0; side < 2; side++) {
        Stretch half = stretch_of(j, whole->q, whole->part + side * span, span, side ? mid : whole->s0,
                                  side ? whole->end : mid, whole->most);
        half.known = whole->known;
        const vi e0 = entry_of(j, half.s0), e1 = entry_of(j, half.end);
        add_stretch(j, beam, pk, way, light, &half, inner, marching, e0, e1, lit, course);
    }
}

/* The slab behind layer q with several sheets in it. */
OUTLINE void add_sheets(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0,
                        vf end, TiledBend most, bool inner, Lit *lit, Course *course)
{
    const int span = j->samples / j->sheets;
    vi e0 = entry_of(j, s0);
    for (int part = 0; part < j->samples; part += span) {
        const vf s1 = part + span == j->samples ? end : sample_sheet(j, pk, way, q, part + span, inner);
        const vi e1 = entry_of(j, s1);
        Stretch stretch = stretch_of(j, q, part, span, s0, s1, most);
        add_stretch(j, beam, pk, way, light, &stretch, inner, ALL_PACKETS, e0, e1, lit, course);
        s0 = s1;
        e0 = e1;
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
    vi entry = vi_of(0); /* of s0 */
    int reached = -1;    /* s0 is the field on this layer */
    uint64_t samples = 0, slabs = 0;
    bool opaque = false;
    const bool timed = course.timed;
    uint64_t start = timed ? cts_tiled_ticks() : 0, composite = 0;
    for (int r = 0; !opaque && (r < beam->n_runs || cts_tiled_beam_extend(j, beam)); r++) {
        TiledRun *const run = &beam->runs[r];
        const int to = run->to;
        const bool inner = run->inner;
        for (int q = run->from; q < to && !opaque; q++) {
            TiledBend most = {0};
            if (way != WAY_STRAIGHT) {
                most = bend_of(j, beam, run, q);
                if (most.quiet)
                    continue;
            }
            if (reached != q) {
                s0 = sample_sheet(j, pk, way, q, 0, inner);
                entry = entry_of(j, s0);
            }
            reached = q + 1;
            const vf end = sample_sheet(j, pk, way, q + 1, 0, inner);
            const vi next = entry_of(j, end);
            const uint64_t before = timed ? cts_tiled_ticks() : 0;
            samples++;
            slabs++;
            if (j->sheets == 1) {
                Stretch slab = stretch_of(j, q, 0, j->samples, s0, end, most);
                add_stretch(j, beam, pk, way, light, &slab, inner, ALL_PACKETS, entry, next, lit ? &own_lit : NULL,
                            &course);
            } else {
                /* Copies: what a function is given the address of, is kept in memory everywhere. */
                Light sheets = *light;
                Lit sheets_lit = own_lit;
                Course sheets_course = course;
                add_sheets(j, beam, pk, way, &sheets, q, s0, end, most, inner, lit ? &sheets_lit : NULL,
                           &sheets_course);
                *light = sheets;
                own_lit = sheets_lit;
                course = sheets_course;
            }
            opaque = all_opaque(j, light);
            composite += timed ? cts_tiled_ticks() - before : 0;
            s0 = end;
            entry = next;
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

#include "engine/tiled/draft_tmpl.h"

/* Each way of marching is a function of its own: the compiler keeps more of it in registers. */
#define MARCH(name, march, way, lit)                                                                                   \
    OUTLINE void name(const TiledJob *j, TiledBeam *beam, Packet *pk, Light *light, TiledCounts *counts)               \
    {                                                                                                                  \
        march(j, beam, pk, way, lit, light, counts);                                                                   \
    }
#define MARCHES(name, way)                                                                                             \
    MARCH(march_##name, march, way, false)                                                                             \
    MARCH(march_##name##_lit, march, way, true)                                                                        \
    MARCH(draft_##name, march_draft, way, false)                                                                       \
    MARCH(draft_##name##_lit, march_draft, way, true)
MARCHES(straight, WAY_STRAIGHT)
MARCHES(oblique, WAY_OBLIQUE)
MARCHES(near, WAY_NEAR)
MARCHES(wide, WAY_WIDE)
#undef MARCHES
#undef MARCH

static void march_any(const TiledJob *j, TiledBeam *beam, Packet *pk, Light *light, TiledCounts *counts)
{
    typedef void (*march_fn)(const TiledJob *, TiledBeam *, Packet *, Light *, TiledCounts *);
    static const march_fn marches[][2][2] = {
        [WAY_STRAIGHT] = {{march_straight, march_straight_lit}, {draft_straight, draft_straight_lit}},
        [WAY_OBLIQUE] = {{march_oblique, march_oblique_lit}, {draft_oblique, draft_oblique_lit}},
        [WAY_NEAR] = {{march_near, march_near_lit}, {draft_near, draft_near_lit}},
        [WAY_WIDE] = {{march_wide, march_wide_lit}, {draft_wide, draft_wide_lit}},
    };
    const Way way = !j->windowed              ? WAY_WIDE
                    : j->straight             ? WAY_STRAIGHT
                    : PACKETS > 1 && pk->near ? WAY_NEAR
                                              : WAY_OBLIQUE;
    marches[way][j->draft.mean != NULL][j->shade != NULL](j, beam, pk, light, counts);
}

/* What is left of the light in front of an opaque packet is taken to see the same colour as the rest did. */
INLINE void complete(const TiledJob *j, Light *light)
{
    const vmask dark = mask_and(vf_lt(light->t, vf_of(j->stop_transmittance)), mask_packets(light->opaque));
    const vf scale = select_f(dark, 1.0f / light->a, vf_of(1));
    const vf unseen = light->t * j->range;
    light->doubt.colour += select_f(dark, unseen * unseen, vf_of(0));
    light->r *= scale;
    light->g *= scale;
    light->b *= scale;
    light->a = select_f(dark, vf_of(1), light->a);
}

/* The bound that march.h derives, rms over the channels. */
INLINE float bound_of(const TiledJob *j, const Light *light, int l)
{
    const Doubt *d = &light->doubt;
    const float behind = 1 - light->a[l] > 0 ? 1 - light->a[l] : 0;
    const float r = light->r[l] + behind * j->background[0], g = light->g[l] + behind * j->background[1];
    const float b = light->b[l] + behind * j->background[2];
    const float spread =
        d->square[l] - 2 * (d->r[l] * r + d->g[l] * g + d->b[l] * b) + d->depth[l] * (r * r + g * g + b * b);
    const float bound = sqrtf((spread > 0 ? spread : 0) * (1.0f / 3) + d->colour[l]);
    return bound < 1 ? bound : 1;
}

static void run_packets(const TiledJob *j, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    Packet pk;
    Light light;
    light.r = light.g = light.b = light.a = vf_of(0);
    light.t = vf_of(1);
    light.depth = vf_of(-1);
    light.opaque = 0;
    light.doubt = (Doubt){vf_of(0), vf_of(0), vf_of(0), vf_of(0), vf_of(0), vf_of(0)};
    init_packet(j, &pk, spans);
    march_any(j, beam, &pk, &light, counts);
    complete(j, &light);
    float rgba[LANES][4], depth[LANES];
    for (int l = 0; l < LANES; l++) {
        rgba[l][0] = light.r[l];
        rgba[l][1] = light.g[l];
        rgba[l][2] = light.b[l];
        rgba[l][3] = light.a[l];
    }
    memcpy(depth, &light.depth, sizeof depth);
    for (int h = 0; h < PACKETS; h++) {
        const int x = spans[h].x, y = spans[h].y, n = spans[h].n, from = h * CTS_PACKET;
        const size_t at = (size_t)(y - j->first_row) * (size_t)j->width + (size_t)x;
        memcpy(j->rgba + 4 * at, rgba[from], (size_t)n * sizeof rgba[0]);
        for (int i = 0; j->bound && i < n; i++)
            j->bound[at + (size_t)i] = bound_of(j, &light, from + i);
        for (int i = 0; j->depth_mm && i < n; i++)
            if (depth[from + i] >= 0)
                j->depth_mm[at + (size_t)i] = cts_tiled_depth_mm(j, x + i, y, depth[from + i]);
    }
}
