/* The march of a draft, part of march_tmpl.h: layer by layer, slabs from a table of means, the field straight in
 * between or, where it changes much, in two straight pieces. What it errs by is not derived but guessed, from how
 * unevenly the light falls: rays that are cast judge it (render/bound.h). */

/* The number of a grey level in the draft's table. */
INLINE vi draft_level(const TiledJob *j, vf s)
{
    const CtsDraftTable *d = &j->draft;
    vf level = vf_of(0.5f);
    for (int i = 0; i < CTS_DRAFT_RANGES; i++)
        level = vf_fma(vf_min(vf_max(s - d->start[i], vf_of(0)), vf_of(d->length[i])), vf_of(d->per_grey[i]), level);
    return to_int(level);
}

/* What a slab takes of the light it gets may be off by this much of how far that is from what the slab before took:
 * three standard deviations in pictures of real CT. */
#define DRAFT_DOUBT 0.1f

/* Where the field runs over more than so many of the draft's levels from layer to layer, it is looked at half way. */
enum { DRAFT_LEVELS_APART = 4 };

/* What a march of a draft carries from slab to slab. */
typedef struct Draft {
    vf alpha;  /* opacity of the slab before */
    vf moment; /* of what a slab takes of the light, each time how far on */
} Draft;

/* What lies between two levels of these packets, from `at` on over `share` of the slab behind layer q. */
INLINE void add_draft_part(const TiledJob *j, Light *light, const Lit *lit, int q, float at, float share,
                           unsigned packets, vi from, vi to, Draft *draft)
{
    vf mean[4];
    look_up_rows(j->draft.mean, CTS_DRAFT_LEVELS * CTS_DRAFT_LEVELS - 1, from * CTS_DRAFT_LEVELS + to, mean);
    const vmask now = mask_packets(packets);
    const vf t_before = light->t;
    vf alpha = one_minus_exp2(mean[3] * ((float)M_LOG2E * share * j->layer_mm));
    if (PACKETS > 1)
        alpha = select_f(now, alpha, vf_of(0));
    const vf lost = t_before * alpha;
    light->r = vf_fma(mean[0], lost, light->r);
    light->g = vf_fma(mean[1], lost, light->g);
    light->b = vf_fma(mean[2], lost, light->b);
    light->a += lost;
    light->t -= lost;
    /* What this changes, march.h derives. */
    const vf off = select_f(now, DRAFT_DOUBT * (alpha - draft->alpha), vf_of(0));
    Colour c = {mean[0], mean[1], mean[2]}, sum = {light->r, light->g, light->b};
    if (lit)
        show_lit(lit, &c, &sum);
    note_depth_doubt(&light->doubt, off, vf_fma(light->t, c.r, sum.r), vf_fma(light->t, c.g, sum.g),
                     vf_fma(light->t, c.b, sum.b));
    draft->alpha = select_f(now, alpha, draft->alpha);
    draft->moment += lost * (at + 0.5f * share);
    note_depth(j, light, t_before, vf_of((float)q + at), vf_of(share));
}

/* A slab that the box does not cut. */
INLINE void add_draft_slab(const TiledJob *j, const Packet *pk, Way way, Light *light, const Lit *lit, int q,
                           bool inner, unsigned marching, vi from, vi to, Draft *draft)
{
    unsigned bent = 0;
    if (way != WAY_STRAIGHT)
        bent = marching & any_in(vf_lt(vf_of(DRAFT_LEVELS_APART), vf_abs(to_float(to - from))));
    if (bent) {
        const vi mid = draft_level(j, sample_sheet(j, pk, way, q, j->samples / 2, inner));
        add_draft_part(j, light, lit, q, 0, 0.5f, bent, from, mid, draft);
        add_draft_part(j, light, lit, q, 0.5f, 0.5f, bent, mid, to, draft);
    }
    if (marching & ~bent)
        add_draft_part(j, light, lit, q, 0, 1, marching & ~bent, from, to, draft);
}

/* A slab that the volume's faces, or those of the slab that is asked for, cut. */
OUTLINE void add_cut_slab(const TiledJob *j, const TiledBeam *beam, Packet *pk, Way way, Light *light, int q, vf s0,
                          vf end, bool inner, unsigned marching, Lit *lit, Course *course)
{
    Stretch slab = stretch_of(j, q, 0, j->samples, s0, end, (TiledBend){0});
    const vi e0 = entry_of(j, s0), e1 = entry_of(j, end);
    add_stretch(j, beam, pk, way, light, &slab, inner, marching, e0, e1, lit, course);
}

INLINE void march_draft(const TiledJob *j, TiledBeam *beam, Packet *pk, Way way, bool lit, Light *result,
                        TiledCounts *counts)
{
    Light own = *result, *light = &own; /* in registers */
    Lit own_lit = no_light();
    Course course = start_course(counts->marches % TILED_TIMED_MARCHES == 0);
    vf s0 = vf_of(0);
    Draft draft = {vf_of(0), vf_of(0)};
    vi from = vi_of(0); /* of s0 */
    int reached = -1;   /* s0 is the field on this layer */
    uint64_t samples = 0;
    bool opaque = false;
    const uint64_t start = course.timed ? cts_tiled_ticks() : 0;
    for (int r = 0; !opaque && (r < beam->n_runs || cts_tiled_beam_extend(j, beam)); r++) {
        const TiledRun *const run = &beam->runs[r];
        const int last = run->to;
        const bool inner = run->inner;
        if (run->from != reached) {
            s0 = sample_sheet(j, pk, way, run->from, 0, inner);
            from = draft_level(j, s0);
            draft.alpha = vf_of(0);
        }
        reached = last;
        for (int q = run->from; q < last && !opaque; q++) {
            const vf end = sample_sheet(j, pk, way, q + 1, 0, inner);
            const vi to = draft_level(j, end);
            const vmask quiet = mask_or(vf_le(vf_max(s0, end), vf_of(j->table.quiet_low)),
                                        vf_le(vf_of(j->table.quiet_high), vf_min(s0, end)));
            const unsigned marching = ALL_PACKETS & ~(light->opaque | all_in(quiet));
            samples++;
            if (marching && is_cut(beam, q)) {
                Light cut = *light;
                Lit cut_lit = own_lit;
                Course cut_course = course;
                add_cut_slab(j, beam, pk, way, &cut, q, s0, end, inner, marching, lit ? &cut_lit : NULL, &cut_course);
                *light = cut;
                own_lit = cut_lit;
                course = cut_course;
            } else if (marching) {
                const vf t_before = light->t;
                draft.moment = vf_of(0);
                add_draft_slab(j, pk, way, light, lit ? &own_lit : NULL, q, inner, marching, from, to, &draft);
                if (lit)
                    light_stretch(j, pk, way, true, q, 0, j->samples, inner, t_before - light->t, draft.moment, light,
                                  &own_lit, &course);
            }
            opaque = all_opaque(j, light);
            s0 = end;
            from = to;
        }
    }
    if (lit)
        light_rest(j, pk, way, light, &own_lit);
    if (course.timed) {
        const uint64_t all = cts_tiled_ticks() - start - course.ticks;
        counts->shade_ticks += course.ticks;
        counts->composite_ticks += all / 2; /* sampling and compositing are of one piece here */
        counts->splat_ticks += all - all / 2;
    }
    counts->marches++;
    counts->samples += samples * LANES;
    counts->slabs += samples * LANES;
    *result = own;
}
