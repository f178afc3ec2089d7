/* The march of a draft, part of march_tmpl.h: layer by layer, slabs from a table of means, the field straight in
 * between or, where it changes much, in two straight pieces. What it errs by is not derived: pieces of the picture that
 * are marched without a draft tell it (render/draft/draft.h). */

/* The number of a grey level in the draft's table. */
INLINE vi draft_level(const TiledJob *j, vf s)
{
    const CtsDraftTable *d = &j->draft;
    vf level = vf_of(0.5f);
    for (int i = 0; i < CTS_DRAFT_RANGES; i++)
        level = vf_fma(vf_min(vf_max(s - d->start[i], vf_of(0)), vf_of(d->length[i])), vf_of(d->per_grey[i]), level);
    return to_int(level);
}

/* Where the field runs over more than so many of the draft's levels from layer to layer, it is looked at half way. */
enum { DRAFT_LEVELS_APART = 4 };

/* What lies between two levels of these packets, from `at` on over `share` of the slab behind layer q. What it takes of
 * the light, times how far on, is added to moment. */
INLINE void add_draft_part(const TiledJob *j, Light *light, int q, vf at, vf share, unsigned packets, vi from, vi to,
                           vf *moment)
{
    vf mean[4];
    look_up_rows(j->draft.mean, CTS_DRAFT_LEVELS * CTS_DRAFT_LEVELS - 1, from * CTS_DRAFT_LEVELS + to, mean);
    const vf t_before = light->t;
    vf alpha = one_minus_exp2(mean[3] * (share * ((float)M_LOG2E * j->layer_mm)));
    if (PACKETS > 1)
        alpha = select_f(mask_packets(packets), alpha, vf_of(0));
    const vf lost = t_before * alpha;
    light->r = vf_fma(mean[0], lost, light->r);
    light->g = vf_fma(mean[1], lost, light->g);
    light->b = vf_fma(mean[2], lost, light->b);
    light->a += lost;
    light->t -= lost;
    *moment += lost * (at + 0.5f * share);
    note_depth(j, light, t_before, (float)q + at, share);
}

/* A slab that the box does not cut. */
INLINE void add_draft_slab(const TiledJob *j, const Packet *pk, Way way, Light *light, int q, bool inner,
                           unsigned marching, vi from, vi to, vf *moment)
{
    unsigned bent = 0;
    if (way != WAY_STRAIGHT)
        bent = marching & any_in(vf_lt(vf_of(DRAFT_LEVELS_APART), vf_abs(to_float(to - from))));
    if (bent) {
        const vi mid = draft_level(j, sample_sheet(j, pk, way, q, j->samples / 2, inner));
        add_draft_part(j, light, q, vf_of(0), vf_of(0.5f), bent, from, mid, moment);
        add_draft_part(j, light, q, vf_of(0.5f), vf_of(0.5f), bent, mid, to, moment);
    }
    if (marching & ~bent)
        add_draft_part(j, light, q, vf_of(0), vf_of(1), marching & ~bent, from, to, moment);
}

/* A slab that the volume's faces, or those of the slab that is asked for, cut: levels run evenly through it. */
INLINE void add_cut_draft_slab(const TiledJob *j, Light *light, int q, const vf inside[2], unsigned marching, vi from,
                               vi to, vf *moment)
{
    const vf at = vf_min(vf_max(inside[0] - (float)q, vf_of(0)), vf_of(1));
    const vf end = vf_max(vf_min(inside[1] - (float)q, vf_of(1)), at);
    const vf start = to_float(from) + 0.5f, rise = to_float(to - from);
    add_draft_part(j, light, q, at, end - at, marching, to_int(start + rise * at), to_int(start + rise * end), moment);
}

/* q from which, and up to which, each ray is inside the box. */
OUTLINE void clip_draft(const TiledJob *j, Packet *pk, vf inside[2])
{
    clip_packet(j, pk);
    for (int l = 0; l < LANES; l++) {
        inside[0][l] = (float)pk->enter[l];
        inside[1][l] = (float)pk->leave[l];
    }
}

INLINE void march_draft(const TiledJob *j, TiledBeam *beam, Packet *pk, Way way, bool lit, Light *result,
                        TiledCounts *counts)
{
    Light own = *result, *light = &own; /* in registers */
    Lit own_lit = no_light();
    Course course = start_course(counts->marches % TILED_TIMED_MARCHES == 0);
    vf s0 = vf_of(0);
    vf inside[2] = {vf_of(0), vf_of(0)};
    vi from = vi_of(0); /* of s0 */
    int reached = -1;   /* s0 is the field on this layer */
    uint64_t samples = 0, slabs = 0;
    bool opaque = false;
    const uint64_t start = course.timed ? cts_tiled_ticks() : 0;
    for (int r = 0; !opaque && (r < beam->n_runs || cts_tiled_beam_extend(j, beam)); r++) {
        const TiledRun *const run = &beam->runs[r];
        const int last = run->to;
        const bool inner = run->inner;
        if (run->from != reached) {
            s0 = sample_sheet(j, pk, way, run->from, 0, inner);
            from = draft_level(j, s0);
        }
        reached = last;
        /* Each layer is sampled a slab before it is needed, so that what is decided there is known when it is. */
        vf end = sample_sheet(j, pk, way, run->from + 1, 0, inner);
        vi to = draft_level(j, end);
        for (int q = run->from; q < last && !opaque; q++) {
            const vf ahead = q + 1 < last ? sample_sheet(j, pk, way, q + 2, 0, inner) : end;
            const vi after = draft_level(j, ahead);
            const vmask quiet = mask_or(vf_le(vf_max(s0, end), vf_of(j->table.quiet_low)),
                                        vf_le(vf_of(j->table.quiet_high), vf_min(s0, end)));
            const unsigned marching = ALL_PACKETS & ~(light->opaque | all_in(quiet));
            samples++;
            if (marching) {
                slabs++;
                const vf t_before = light->t;
                vf moment = vf_of(0);
                if (is_cut(beam, q)) {
                    if (!pk->clipped)
                        clip_draft(j, pk, inside);
                    add_cut_draft_slab(j, light, q, inside, marching, from, to, &moment);
                } else {
                    add_draft_slab(j, pk, way, light, q, inner, marching, from, to, &moment);
                }
                if (lit)
                    light_stretch(j, pk, way, true, q, 0, j->samples, inner, t_before - light->t, moment, light,
                                  &own_lit, &course);
            }
            opaque = all_opaque(j, light);
            s0 = end;
            end = ahead;
            from = to;
            to = after;
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
    counts->slabs += slabs * LANES;
    *result = own;
}
