/* Shading, part of cells_tmpl.h: |n.v| is not polynomial, and varies most where the gradient nearly vanishes. A segment
 * is shaded with the gradient at its weighted centre, unless its normal deviation times its weight is too large; then
 * it is shaded in steps, each as long as the normal deviation allows. */

/* An entry of the shading queues: a ray segment, or the weighted centre of several low-weight ones. */
enum {
    WAIT_CELL,
    WAIT_ENTER = 3, /* position in the cell, each axis 0..1 */
    WAIT_LEAVE = 6,
    WAIT_COLOUR = 9,  /* times its weight */
    WAIT_WEIGHT = 12, /* absorbed share of the ray's light */
    WAIT_CENTRE,      /* of that, 0..1 */
    WAIT_LIGHT,       /* transmittance before it */
    WAIT_LENGTH,      /* mm; 0: it is a point */
    WAIT_PIECE,       /* of the transfer function */
    WAIT_FIELDS
};
enum { WAITING = 8 * LANES };

typedef struct Waiting {
    real field[WAIT_FIELDS][WAITING];
    int ray[WAITING], n;
    whole look[WAITING];
} Waiting;

typedef struct Lit {
    Waiting wait, turning[TILED_TURNING]; /* turning: segments to be shaded in steps, by the probable number of steps */
} Lit;

typedef struct Direction {
    vf right, up, along;
} Direction;

/* Differences of levels at a cell's voxels along its three axes, and the levels themselves. */
typedef struct Corners {
    vf rise[3][8], level[8];
} Corners;

#include "engine/tiled/stencil_tmpl.h"

INLINE vf between(const vf v[8], const vf at[3])
{
    const vf a = v[0] + at[0] * (v[1] - v[0]), b = v[2] + at[0] * (v[3] - v[2]);
    const vf c = v[4] + at[0] * (v[5] - v[4]), d = v[6] + at[0] * (v[7] - v[6]);
    const vf low = a + at[1] * (b - a), high = c + at[1] * (d - c);
    return low + at[2] * (high - low);
}

/* The gradient at fraction s of the segment through the cell. */
INLINE Direction gradient_at(const TiledJob *j, const Corners *k, const vf enter[3], const vf way[3], vf s)
{
    vf at[3], g[3], in_view[3];
    for (int a = 0; a < 3; a++)
        at[a] = enter[a] + s * way[a];
    for (int a = 0; a < 3; a++)
        g[a] = between(k->rise[a], at);
    for (int i = 0; i < 3; i++)
        in_view[i] = (real)j->frame[i][0] * g[0] + (real)j->frame[i][1] * g[1] + (real)j->frame[i][2] * g[2];
    return (Direction){in_view[0], in_view[1], in_view[2]};
}

INLINE vf dot(const Direction *a, const Direction *b)
{
    return a->right * b->right + a->up * b->up + a->along * b->along;
}

#define LEAST_SQUARE ((real)1e-20f)

/* Squared difference of the unit vectors, scaled by the curvature of the highlight; without a gradient at either, both
 * are shaded alike: 0. */
INLINE vf turning(const March *m, const Direction *a, const Direction *b)
{
    const vf aa = dot(a, a), bb = dot(b, b);
    const vf squares = vf_max(aa * bb, vf_of(LEAST_SQUARE * LEAST_SQUARE + (real)1e-37f));
    const vf square = vf_max(2 - 2 * dot(a, b) * vf_inverse_root(squares), vf_of(0));
    return vf_select(vf_lt(vf_of(LEAST_SQUARE), vf_max(aa, bb)), vf_min(m->sharp * square, vf_of(4)), vf_of(0));
}

/* Error by normals that pass the perpendicular, in units of normal deviation: |n.v| has a discontinuity of the slope
 * there. Of numbers x from -a to b the mean of |x| exceeds |mean of x| by 2 a b / (a + b) at most. */
INLINE vf passing(const March *m, const Direction *const *way, int n)
{
    vf low = vf_of(0), high = vf_of(0);
    vmask pass = mask_of_bits(0);
    for (int i = 1; i < n; i++)
        pass |= differ(vf_lt(way[i - 1]->along, vf_of(0)), vf_lt(way[i]->along, vf_of(0)));
    if (!mask_any(pass))
        return vf_of(0);
    for (int i = 0; i < n; i++) {
        const vf facing = way[i]->along * vf_inverse_root(vf_max(dot(way[i], way[i]), vf_of(LEAST_SQUARE)));
        low = vf_min(low, facing);
        high = vf_max(high, facing);
    }
    return m->kinked * 2 * high * -low / vf_max(high - low, vf_of((real)1e-6f));
}

/* Factor of the colour, and white to be added, for a weight of 1. */
typedef struct Glow {
    vf colour, white;
} Glow;

/* open: how far light arrives, where it counts. */
INLINE Glow glow_of(const TiledJob *j, const Direction *g, vf open)
{
    const CtsShade *const s = j->shade;
    const vf square = dot(g, g), size = CTS_MUTATED(ONE_SIDED_LIGHT) ? vf_max(g->along, vf_of(0)) : vf_abs(g->along);
    const vmask has = vf_lt(vf_of(LEAST_SQUARE), square);
    const vf facing = vf_min(size * vf_inverse_root(vf_max(square, vf_of(LEAST_SQUARE))), vf_of(1));
    const vf power = vf_exp2(vf_min((real)s->exponent * vf_log2(vf_max(facing, vf_of((real)1e-30f))), vf_of(0)));
    Glow glow = {(real)s->ambient + vf_select(has, (real)s->diffuse * facing, vf_of(0)),
                 vf_select(has, (real)s->specular * power, vf_of(0))};
    if (j->open) {
        const vf dark = (real)s->occlusion * (1 - open);
        const vf dimmed = (real)s->ambient + (real)s->occlusion * vf_select(has, (real)s->diffuse * facing, vf_of(0));
        glow.colour -= dark * dimmed;
        glow.white -= dark * glow.white;
    }
    return glow;
}

/* The first are done. */
static void leave_waiting(Waiting *all, int done)
{
    all->n -= done;
    for (int f = 0; f < WAIT_FIELDS && done > 0; f++)
        memmove(all->field[f], all->field[f] + done, (size_t)all->n * sizeof(real));
    memmove(all->ray, all->ray + done, (size_t)all->n * sizeof *all->ray);
    memmove(all->look, all->look + done, (size_t)all->n * sizeof *all->look);
}

/* LANES entries of a queue from entry `first` on. */
typedef struct Wait {
    vi cell[3], piece;
    vf enter[3], way[3], colour[3], weight, centre, light, length;
} Wait;

INLINE vf wait_field(const Waiting *all, int field, int first)
{
    vf v;
    memcpy(&v, &all->field[field][first], sizeof v);
    return v;
}

INLINE Wait load_wait(const Waiting *all, int first)
{
    Wait w;
    for (int a = 0; a < 3; a++) {
        w.cell[a] = to_int(wait_field(all, WAIT_CELL + a, first));
        w.enter[a] = wait_field(all, WAIT_ENTER + a, first);
        w.way[a] = wait_field(all, WAIT_LEAVE + a, first) - w.enter[a];
        w.colour[a] = wait_field(all, WAIT_COLOUR + a, first);
    }
    w.weight = wait_field(all, WAIT_WEIGHT, first);
    w.centre = wait_field(all, WAIT_CENTRE, first);
    w.light = wait_field(all, WAIT_LIGHT, first);
    w.length = wait_field(all, WAIT_LENGTH, first);
    w.piece = to_int(wait_field(all, WAIT_PIECE, first));
    return w;
}

#include "engine/tiled/open_tmpl.h"

/* Centroid, 0..1, of the light absorbed along a segment of this depth: 1 / d - 1 / (e^d - 1), with an error below
 * 0.008. */
INLINE vf centre_of(vf depth)
{
    return ((real)0.5f + (real)0.0738f * depth) / (1 + ((real)0.3143f + (real)0.0738f * depth) * depth);
}

enum { LIGHT_HALVINGS = sizeof(real) == 4 ? 9 : 14 };

/* Error of shading at two points, given that at one point: the fourth power of the normal deviation for even
 * absorption, and a quarter of the square for the share that an opaque medium absorbs before its points. */
INLINE vf left_by_two(vf turn, vf share)
{
    return turn * ((real)0.25f * share + (real)0.1f * turn);
}

/* Shades segments in steps of small normal deviation, two points each; sum[3] is the error estimate. */
OUTLINE void light_in_steps(const March *m, const TiledPieces *pieces, const Wait *w, const Corners *k, vmask lanes,
                            vf sum[4])
{
    const TiledJob *const j = m->job;
    vf s = vf_of(0), step = vf_of((real)0.5f), light = w->light;
    const real shortest = (real)1 / (1 << LIGHT_HALVINGS);
    Direction before = gradient_at(j, k, w->enter, w->way, s);
    vmask on = lanes;
    while (mask_any(on)) {
        const vf to = vf_min(s + step, vf_of(1)), part = to - s, half = (real)0.5f * part;
        vf weight[2], shown[3] = {vf_of(0), vf_of(0), vf_of(0)}, left = light;
        Direction at_point[2];
        vf open[2] = {vf_of(1), vf_of(1)};
        for (int i = 0; i < 2; i++) {
            const vf point = s + part * (i ? (real)0.788675135 : (real)0.211324865);
            vf at[3];
            for (int a = 0; a < 3; a++)
                at[a] = w->enter[a] + point * w->way[a];
            const Look look = look_at(pieces, w->piece, between(k->level, at));
            const vf depth = look.extinction * half * w->length, share = vf_taken(depth);
            weight[i] = left * share;
            left -= weight[i];
            /* Gauss points for low opacity, the centroids of the halves for high opacity. */
            const vf gauss = (i ? (real)0.077350269 : -(real)0.077350269) * (1 - share);
            const vf lit_at = s + half * ((real)i + centre_of((real)M_LN2 * depth) + gauss);
            at_point[i] = gradient_at(j, k, w->enter, w->way, lit_at);
            if (j->open)
                open[i] = openness_at(j, w, lit_at, lanes);
            const Glow glow = glow_of(j, &at_point[i], open[i]);
            for (int c = 0; c < 3; c++)
                shown[c] += weight[i] * (look.rgb[c] * glow.colour + glow.white);
        }
        const Direction after = gradient_at(j, k, w->enter, w->way, to);
        const vf all = weight[0] + weight[1];
        const vf turn = turning(m, &before, &at_point[0]) + turning(m, &at_point[0], &at_point[1]) +
                        turning(m, &at_point[1], &after);
        const vf smooth = all * (left_by_two(turn, all / light) +
                                 (j->open ? 4 * m->dimmed * open_error_of_two(open, all / light) : vf_of(0)));
        const vf off = smooth + (real)0.5f * all *
                                    passing(m, (const Direction *const[]){&before, at_point, at_point + 1, &after}, 4);
        const vmask taken = on & (vf_le(JUDGES ? off : smooth, vf_of(m->turn)) | vf_le(part, vf_of(shortest)));
        for (int c = 0; c < 3; c++)
            sum[c] += vf_select(taken, shown[c], vf_of(0));
        sum[3] += vf_select(taken, (real)0.25f * off, vf_of(0));
        light = vf_select(taken, left, light);
        step = vf_select(taken, 2 * part, half);
        before.right = vf_select(taken, after.right, before.right);
        before.up = vf_select(taken, after.up, before.up);
        before.along = vf_select(taken, after.along, before.along);
        s = vf_select(taken, to, s);
        on &= vf_lt(s, vf_of(1)) & vf_lt(vf_of((real)1e-9f), light);
    }
}

/* The lanes with the same appearance as the first of them. */
INLINE vmask waits_alike(const Waiting *all, int first, unsigned lanes)
{
    unsigned alike = 0;
    for (unsigned left = lanes; left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        alike |= (unsigned)(all->look[first + l] == all->look[first + __builtin_ctz(lanes)]) << l;
    }
    return mask_of_bits(alike);
}

/* Shades the first n entries of a queue in steps. */
OUTLINE void light_turning(const March *m, Lit *lit, int kind, int n)
{
    const TiledJob *const j = m->job;
    Waiting *const turning = &lit->turning[kind];
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const Wait w = load_wait(turning, 0);
    Corners k;
    vf sum[4] = {vf_of(0), vf_of(0), vf_of(0), vf_of(0)};
    load_corners(j, w.cell, lanes, &k);
    for (unsigned left = mask_bits(lanes); left;) {
        const vmask alike = j->looks ? waits_alike(turning, 0, left) : lanes;
        const TiledPieces *const pieces = j->looks ? &j->looks->pieces[turning->look[__builtin_ctz(left)]] : &j->pieces;
        light_in_steps(m, pieces, &w, &k, alike, sum);
        left &= ~mask_bits(alike);
    }
    for (int l = 0; l < n; l++)
        for (int c = 0; c < 4; c++)
            m->rays->turned[kind][turning->ray[l]][c] += (float)sum[c][l];
    leave_waiting(turning, n);
}

/* Queue index by normal deviation: segments are shaded together with others that need about as many steps. */
INLINE int kind_of_turning(const March *m, real turn)
{
    int kind = 0;
    for (real most = 8 * m->turn; kind + 1 < TILED_TURNING && turn > most; most *= 8)
        kind++;
    return kind;
}

static void move_waiting(Waiting *to, const Waiting *from, int i)
{
    const int n = to->n++;
    for (int f = 0; f < WAIT_FIELDS; f++)
        to->field[f][n] = from->field[f][i];
    to->ray[n] = from->ray[i];
    to->look[n] = from->look[i];
}

OUTLINE void light_some(const March *m, Lit *lit, int first, int n)
{
    const TiledJob *const j = m->job;
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const Wait w = load_wait(&lit->wait, first);
    Corners k;
    load_corners(j, w.cell, lanes, &k);
    const Direction centre = gradient_at(j, &k, w.enter, w.way, w.centre),
                    front = gradient_at(j, &k, w.enter, w.way, vf_of(0)),
                    back = gradient_at(j, &k, w.enter, w.way, vf_of(1));
    const Open open = j->open ? open_along(j, &w, lanes) : (Open){vf_of(1), vf_of(0)};
    const vf smooth =
                 w.weight * (turning(m, &front, &centre) + turning(m, &centre, &back) + 4 * m->dimmed * open.error),
             turn = smooth + w.weight * passing(m, (const Direction *const[]){&front, &centre, &back}, 3);
    /* Discontinuities of the slope are rare, and worth steps only for reference samples. */
    const vmask stretch = lanes & vf_lt(vf_of(0), w.length),
                turns =
                    CTS_MUTATED(LIT_STEPS) ? mask_of_bits(0) : stretch & vf_lt(vf_of(m->turn), JUDGES ? turn : smooth);
    const Glow glow = glow_of(j, &centre, open.at_centre);
    for (int l = 0; l < n; l++) {
        const int ray = lit->wait.ray[first + l];
        if (mask_bits(turns) >> l & 1) {
            move_waiting(&lit->turning[kind_of_turning(m, turn[l])], &lit->wait, first + l);
            continue;
        }
        for (int c = 0; c < 3; c++)
            m->rays->rgba[ray][c] += (float)(w.colour[c][l] * glow.colour[l] + w.weight[l] * glow.white[l]);
        m->rays->lit_bound[ray] += (float)((real)0.25f * turn[l]);
    }
    for (int kind = 0; kind < TILED_TURNING; kind++)
        if (lit->turning[kind].n >= LANES)
            light_turning(m, lit, kind, LANES);
}

/* Shades queued entries as far as they fill vectors; all of them at the end. */
OUTLINE void light_up(March *m, Lit *lit, bool all)
{
    const uint64_t begun = cts_tiled_ticks();
    int done = 0;
    for (; done + LANES <= lit->wait.n; done += LANES)
        light_some(m, lit, done, LANES);
    if (all && done < lit->wait.n) {
        light_some(m, lit, done, lit->wait.n - done);
        done = lit->wait.n;
    }
    for (int kind = 0; kind < TILED_TURNING && all; kind++)
        if (lit->turning[kind].n > 0)
            light_turning(m, lit, kind, lit->turning[kind].n);
    m->counts->lit += (uint64_t)done;
    leave_waiting(&lit->wait, done);
    m->counts->shade_ticks += cts_tiled_ticks() - begun;
}

/* Queues the lane's low-weight segments to be shaded at their common centre; the gradient field of that cell gives
 * their normal deviation. */
OUTLINE void end_pending(March *m, Lit *lit, int lane)
{
    Packet *const p = m->p;
    if (p->ray[lane] < 0 || !(p->faint_weight[lane] > 0))
        return;
    const int i = lit->wait.n++;
    const real begin = p->faint_begin[lane], mm = p->faint_centre[lane] / p->faint_weight[lane],
               length = p->faint_end[lane] - begin;
    lit->wait.ray[i] = p->ray[lane];
    lit->wait.look[i] = CTS_LOOK_PRESET; /* a point needs no steps */
    for (int a = 0; a < 3; a++) {
        const real vox = p->start[a][lane] + mm * m->step[a];
        const int last = m->job->n_cells[a] - 1, cell = vox < 0 ? 0 : vox < (real)last ? (int)vox : last;
        lit->wait.field[WAIT_CELL + a][i] = (real)cell;
        lit->wait.field[WAIT_ENTER + a][i] = vox - (real)cell + (begin - mm) * m->step[a];
        lit->wait.field[WAIT_LEAVE + a][i] = vox - (real)cell + (begin + length - mm) * m->step[a];
        lit->wait.field[WAIT_COLOUR + a][i] = p->faint_colour[a][lane];
        p->faint_colour[a][lane] = 0;
    }
    lit->wait.field[WAIT_WEIGHT][i] = p->faint_weight[lane];
    lit->wait.field[WAIT_CENTRE][i] = (mm - begin) / length;
    lit->wait.field[WAIT_LIGHT][i] = lit->wait.field[WAIT_LENGTH][i] = lit->wait.field[WAIT_PIECE][i] = 0;
    p->faint_weight[lane] = p->faint_centre[lane] = 0;
    if (lit->wait.n > WAITING - 2 * LANES)
        light_up(m, lit, false);
}

/* Queues segments for shading, with their absorbed light. */
INLINE void await_light(March *m, Lit *lit, const Effect *e, vi q, const vf weight[2], const vf colour[3], vf length,
                        vmask lanes)
{
    Packet *const p = m->p;
    const vf all = weight[0] + weight[1], second = weight[1] / vf_max(all, vf_of((real)1e-30f));
    const vf first_half = centre_of((real)M_LN2 * e->depth[0]), second_half = centre_of((real)M_LN2 * e->depth[1]);
    const vf centre = (real)0.5f * (first_half + second * (1 + second_half - first_half));
    const vmask bright = lanes & vf_le(vf_of(m->least_lit), all),
                faint = CTS_MUTATED(FAINT) ? mask_of_bits(0) : lanes & ~bright;
    /* Segments far from each other are not combined: there may be no gradient between them. */
    const vmask takes = faint & vf_lt(vf_of(0), all);
    const vmask apart = takes & vf_lt(vf_of(0), p->faint_weight) & vf_lt(p->faint_end + m->cell_mm, p->at);
    for (unsigned left = mask_bits(apart); left; left &= left - 1)
        end_pending(m, lit, __builtin_ctz(left));
    for (int c = 0; c < 3; c++)
        p->faint_colour[c] += vf_select(faint, colour[c], vf_of(0));
    p->faint_begin = vf_select(takes & ~vf_lt(vf_of(0), p->faint_weight), p->at, p->faint_begin);
    p->faint_end = vf_select(takes, p->at + length, p->faint_end);
    p->faint_weight += vf_select(faint, all, vf_of(0));
    p->faint_centre += vf_select(faint, all * (p->at + centre * length), vf_of(0));
    unsigned due = mask_bits(bright | (faint & vf_le(vf_of(m->least_lit), p->faint_weight)));
    if (!due)
        return;
    const unsigned now = mask_bits(bright);
    vf enter[3], leave[3];
    for (int a = 0; a < 3; a++) {
        const vf within = p->start[a] - to_float(p->cell[a]);
        enter[a] = within + p->at * m->step[a];
        leave[a] = within + (p->at + length) * m->step[a];
    }
    for (; due; due &= due - 1) {
        const int l = __builtin_ctz(due);
        end_pending(m, lit, l);
        if (!(now >> l & 1))
            continue;
        const int i = lit->wait.n++;
        lit->wait.ray[i] = p->ray[l];
        lit->wait.look[i] = p->look[l];
        for (int a = 0; a < 3; a++) {
            lit->wait.field[WAIT_CELL + a][i] = (real)p->cell[a][l];
            lit->wait.field[WAIT_ENTER + a][i] = enter[a][l];
            lit->wait.field[WAIT_LEAVE + a][i] = leave[a][l];
            lit->wait.field[WAIT_COLOUR + a][i] = colour[a][l];
        }
        lit->wait.field[WAIT_WEIGHT][i] = all[l];
        lit->wait.field[WAIT_CENTRE][i] = centre[l];
        lit->wait.field[WAIT_LIGHT][i] = p->light[l];
        lit->wait.field[WAIT_LENGTH][i] = length[l];
        lit->wait.field[WAIT_PIECE][i] = (real)q[l];
    }
    if (lit->wait.n > WAITING - 2 * LANES)
        light_up(m, lit, false);
}
