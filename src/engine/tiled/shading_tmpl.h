/* Shading, part of tiled_march_tmpl.h: |n.v| is not polynomial, and varies most where the gradient nearly vanishes. A
 * segment is shaded with the gradient at its weighted centre, unless its normal deviation times its weight is too
 * large; then it is shaded in steps, each as long as the normal deviation allows. */

/* An entry of the shading queues: a ray segment, or the weighted centre of several low-weight ones. */
enum {
    ENTRY_CELL,
    ENTRY_ENTER = 3, /* position in the cell, each axis 0..1 */
    ENTRY_LEAVE = 6,
    ENTRY_COLOUR = 9,       /* times its weight */
    ENTRY_WEIGHT = 12,      /* absorbed share of the ray's light */
    ENTRY_CENTRE,           /* of that, 0..1 */
    ENTRY_TRANSMITTANCE,    /* transmittance before it */
    ENTRY_LENGTH,           /* mm; 0: it is a point */
    ENTRY_TRANSFER_SEGMENT, /* of the transfer function */
    ENTRY_FIELDS
};
enum { QUEUE_SIZE = 8 * LANES };

typedef struct ShadingQueue {
    real field[ENTRY_FIELDS][QUEUE_SIZE];
    int ray[QUEUE_SIZE], n;
    whole appearance[QUEUE_SIZE];
} ShadingQueue;

typedef struct ShadingQueues {
    ShadingQueue queue,
        stepped[TILED_STEP_QUEUES]; /* segments to be shaded in steps, by the probable number of steps */
} ShadingQueues;

typedef struct Direction {
    vf right, up, along;
} Direction;

/* Differences of levels at a cell's voxels along its three axes, and the levels themselves. */
typedef struct Corners {
    vf slope[3][8], level[8];
} Corners;

#include "core/scene/light_tmpl.h"
#include "engine/tiled/gradient_tmpl.h"

/* The gradient at fraction s of the segment through the cell. */
INLINE Direction gradient_at(const TiledJob *j, const Corners *k, const vf enter[3], const vf displacement[3], vf s)
{
    vf at[3], g[3], in_view[3];
    for (int a = 0; a < 3; a++)
        at[a] = enter[a] + s * displacement[a];
    for (int a = 0; a < 3; a++)
        g[a] = between(k->slope[a], at);
    for (int i = 0; i < 3; i++)
        in_view[i] = (real)j->frame[i][0] * g[0] + (real)j->frame[i][1] * g[1] + (real)j->frame[i][2] * g[2];
    return (Direction){in_view[0], in_view[1], in_view[2]};
}

INLINE vf dot(const Direction *a, const Direction *b)
{
    return a->right * b->right + a->up * b->up + a->along * b->along;
}

#define MIN_SQUARE ((real)1e-20f)

/* Squared difference of the unit vectors, scaled by the curvature of the highlight; without a gradient at either, both
 * are shaded alike: 0. */
INLINE vf normal_deviation(const March *m, const Direction *a, const Direction *b)
{
    const vf aa = dot(a, a), bb = dot(b, b);
    const vf squares = vf_max(aa * bb, vf_of(MIN_SQUARE * MIN_SQUARE + (real)1e-37f));
    const vf square = vf_max(2 - 2 * dot(a, b) * vf_inverse_root(squares), vf_of(0));
    return vf_select(vf_lt(vf_of(MIN_SQUARE), vf_max(aa, bb)), vf_min(m->highlight_curvature * square, vf_of(4)),
                     vf_of(0));
}

/* Error by normals that pass the perpendicular, in units of normal deviation: |n.v| has a discontinuity of the slope
 * there. Of numbers x from -a to b the mean of |x| exceeds |mean of x| by 2 a b / (a + b) at most. */
INLINE vf perpendicular_error(const March *m, const Direction *const *normals, int n)
{
    vf low = vf_of(0), high = vf_of(0);
    vmask pass = mask_of_bits(0);
    for (int i = 1; i < n; i++)
        pass |= differ(vf_lt(normals[i - 1]->along, vf_of(0)), vf_lt(normals[i]->along, vf_of(0)));
    if (!mask_any(pass))
        return vf_of(0);
    for (int i = 0; i < n; i++) {
        const vf facing = normals[i]->along * vf_inverse_root(vf_max(dot(normals[i], normals[i]), vf_of(MIN_SQUARE)));
        low = vf_min(low, facing);
        high = vf_max(high, facing);
    }
    return m->slope_discontinuity * 2 * high * -low / vf_max(high - low, vf_of((real)1e-6f));
}

/* Factor of the colour, and white to be added, for a weight of 1. */
typedef struct PhongTerms {
    vf colour, white;
} PhongTerms;

INLINE PhongTerms phong_terms(const TiledJob *j, const Direction *g, vf open)
{
    const CtsShade *const s = j->shade;
    const vf square = dot(g, g), size = CTS_MUTATED(ONE_SIDED_LIGHT) ? vf_max(g->along, vf_of(0)) : vf_abs(g->along);
    const vmask has = vf_lt(vf_of(MIN_SQUARE), square);
    const vf facing =
        vf_select(has, vf_min(size * vf_inverse_root(vf_max(square, vf_of(MIN_SQUARE))), vf_of(1)), vf_of(0));
    const vf power = vf_exp2(vf_min((real)s->exponent * vf_log2(vf_max(facing, vf_of((real)1e-30f))), vf_of(0)));
    PhongTerms phong;
    light_terms(s, facing, vf_select(has, power, vf_of(0)), open, &phong.colour, &phong.white);
    return phong;
}

/* The first are done. */
static void drop_entries(ShadingQueue *all, int done)
{
    all->n -= done;
    for (int f = 0; f < ENTRY_FIELDS && done > 0; f++)
        memmove(all->field[f], all->field[f] + done, (size_t)all->n * sizeof(real));
    memmove(all->ray, all->ray + done, (size_t)all->n * sizeof *all->ray);
    memmove(all->appearance, all->appearance + done, (size_t)all->n * sizeof *all->appearance);
}

/* LANES entries of a queue from entry `first` on. */
typedef struct QueueEntries {
    vi cell[3], transfer_segment;
    vf enter[3], displacement[3], colour[3], weight, centre, transmittance, length;
} QueueEntries;

INLINE QueueEntries load_entries(const ShadingQueue *all, int first)
{
    QueueEntries w;
    for (int a = 0; a < 3; a++) {
        w.cell[a] = to_int(vf_load(all->field[ENTRY_CELL + a] + first));
        w.enter[a] = vf_load(all->field[ENTRY_ENTER + a] + first);
        w.displacement[a] = vf_load(all->field[ENTRY_LEAVE + a] + first) - w.enter[a];
        w.colour[a] = vf_load(all->field[ENTRY_COLOUR + a] + first);
    }
    w.weight = vf_load(all->field[ENTRY_WEIGHT] + first);
    w.centre = vf_load(all->field[ENTRY_CENTRE] + first);
    w.transmittance = vf_load(all->field[ENTRY_TRANSMITTANCE] + first);
    w.length = vf_load(all->field[ENTRY_LENGTH] + first);
    w.transfer_segment = to_int(vf_load(all->field[ENTRY_TRANSFER_SEGMENT] + first));
    return w;
}

#include "engine/tiled/ray_openness_tmpl.h"

/* Centroid, 0..1, of the light absorbed along a segment of this depth: 1 / d - 1 / (e^d - 1), with an error below
 * 0.008. */
INLINE vf centre_of(vf depth)
{
    return ((real)0.5f + (real)0.0738f * depth) / (1 + ((real)0.3143f + (real)0.0738f * depth) * depth);
}

enum { STEP_HALVINGS = sizeof(real) == 4 ? 9 : 14 };

/* Error of shading at two points, given that at one point: the fourth power of the normal deviation for even
 * absorption, and a quarter of the square for the share that an opaque medium absorbs before its points. */
INLINE vf error_of_two_points(vf deviation, vf share)
{
    return deviation * ((real)0.25f * share + (real)0.1f * deviation);
}

/* Shades segments in steps of small normal deviation, two points each; sum[3] is the error estimate. */
OUTLINE void shade_in_steps(const March *m, const TiledTransfer *transfer, const QueueEntries *w, const Corners *k,
                            vmask lanes, vf sum[4])
{
    const TiledJob *const j = m->job;
    vf s = vf_of(0), step = vf_of((real)0.5f), transmittance = w->transmittance;
    const real shortest = (real)1 / (1 << STEP_HALVINGS);
    Direction before = gradient_at(j, k, w->enter, w->displacement, s);
    vmask on = lanes;
    while (mask_any(on)) {
        const vf to = vf_min(s + step, vf_of(1)), part = to - s, half = (real)0.5f * part;
        vf weight[2], shown[3] = {vf_of(0), vf_of(0), vf_of(0)}, left = transmittance;
        Direction at_point[2];
        vf open[2] = {vf_of(1), vf_of(1)};
        for (int i = 0; i < 2; i++) {
            const vf point = s + part * (i ? (real)0.788675135 : (real)0.211324865);
            vf at[3];
            for (int a = 0; a < 3; a++)
                at[a] = w->enter[a] + point * w->displacement[a];
            const TransferSample sample = evaluate_transfer(transfer, w->transfer_segment, between(k->level, at));
            const vf depth = sample.extinction * half * w->length, share = vf_opacity(depth);
            weight[i] = left * share;
            left -= weight[i];
            /* Gauss points for low opacity, the centroids of the halves for high opacity. */
            const vf gauss = (i ? (real)0.077350269 : -(real)0.077350269) * (1 - share);
            const vf shaded_at = s + half * ((real)i + centre_of((real)M_LN2 * depth) + gauss);
            at_point[i] = gradient_at(j, k, w->enter, w->displacement, shaded_at);
            if (j->open)
                open[i] = openness_at(j, w, shaded_at, lanes);
            const PhongTerms phong = phong_terms(j, &at_point[i], open[i]);
            for (int c = 0; c < 3; c++)
                shown[c] += weight[i] * (sample.rgb[c] * phong.colour + phong.white);
        }
        const Direction after = gradient_at(j, k, w->enter, w->displacement, to);
        const vf all = weight[0] + weight[1];
        const vf deviation = normal_deviation(m, &before, &at_point[0]) +
                             normal_deviation(m, &at_point[0], &at_point[1]) +
                             normal_deviation(m, &at_point[1], &after);
        const vf smooth =
            all * (error_of_two_points(deviation, all / transmittance) +
                   (j->open ? 4 * m->occlusion_sensitivity * open_error_of_two(open, all / transmittance) : vf_of(0)));
        const vf off =
            smooth + (real)0.5f * all *
                         perpendicular_error(m, (const Direction *const[]){&before, at_point, at_point + 1, &after}, 4);
        const vmask taken =
            on & (vf_le(IS_REFERENCE ? off : smooth, vf_of(m->shading_tolerance)) | vf_le(part, vf_of(shortest)));
        for (int c = 0; c < 3; c++)
            sum[c] += vf_select(taken, shown[c], vf_of(0));
        sum[3] += vf_select(taken, (real)0.25f * off, vf_of(0));
        transmittance = vf_select(taken, left, transmittance);
        step = vf_select(taken, 2 * part, half);
        before.right = vf_select(taken, after.right, before.right);
        before.up = vf_select(taken, after.up, before.up);
        before.along = vf_select(taken, after.along, before.along);
        s = vf_select(taken, to, s);
        on &= vf_lt(s, vf_of(1)) & vf_lt(vf_of((real)1e-9f), transmittance);
    }
}

/* The lanes with the same appearance as the first of them. */
INLINE vmask same_appearance(const ShadingQueue *all, int first, unsigned lanes)
{
    unsigned alike = 0;
    for (unsigned left = lanes; left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        alike |= (unsigned)(all->appearance[first + l] == all->appearance[first + __builtin_ctz(lanes)]) << l;
    }
    return mask_of_bits(alike);
}

/* Shades the first n entries of a queue in steps. */
OUTLINE void shade_stepped(const March *m, ShadingQueues *queues, int kind, int n)
{
    const TiledJob *const j = m->job;
    ShadingQueue *const stepped = &queues->stepped[kind];
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const QueueEntries w = load_entries(stepped, 0);
    Corners k;
    vf sum[4] = {vf_of(0), vf_of(0), vf_of(0), vf_of(0)};
    load_corners(j, w.cell, lanes, &k);
    for (unsigned left = mask_bits(lanes); left;) {
        const vmask alike = j->appearances ? same_appearance(stepped, 0, left) : lanes;
        const TiledTransfer *const transfer =
            j->appearances ? &j->appearances->transfer[stepped->appearance[__builtin_ctz(left)]] : &j->transfer;
        shade_in_steps(m, transfer, &w, &k, alike, sum);
        left &= ~mask_bits(alike);
    }
    for (int l = 0; l < n; l++)
        for (int c = 0; c < 4; c++)
            m->rays->stepped[kind][stepped->ray[l]][c] += (float)sum[c][l];
    drop_entries(stepped, n);
}

/* Queue index by normal deviation: segments are shaded together with others that need about as many steps. */
INLINE int queue_of_deviation(const March *m, real deviation)
{
    int kind = 0;
    for (real most = 8 * m->shading_tolerance; kind + 1 < TILED_STEP_QUEUES && deviation > most; most *= 8)
        kind++;
    return kind;
}

static void move_entry(ShadingQueue *to, const ShadingQueue *from, int i)
{
    const int n = to->n++;
    for (int f = 0; f < ENTRY_FIELDS; f++)
        to->field[f][n] = from->field[f][i];
    to->ray[n] = from->ray[i];
    to->appearance[n] = from->appearance[i];
}

OUTLINE void shade_entries(const March *m, ShadingQueues *queues, int first, int n)
{
    const TiledJob *const j = m->job;
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const QueueEntries w = load_entries(&queues->queue, first);
    Corners k;
    load_corners(j, w.cell, lanes, &k);
    const Direction centre = gradient_at(j, &k, w.enter, w.displacement, w.centre),
                    front = gradient_at(j, &k, w.enter, w.displacement, vf_of(0)),
                    back = gradient_at(j, &k, w.enter, w.displacement, vf_of(1));
    const Open open = j->open ? open_along(j, &w, lanes) : (Open){vf_of(1), vf_of(0)};
    const vf smooth = w.weight * (normal_deviation(m, &front, &centre) + normal_deviation(m, &centre, &back) +
                                  4 * m->occlusion_sensitivity * open.error),
             deviation =
                 smooth + w.weight * perpendicular_error(m, (const Direction *const[]){&front, &centre, &back}, 3);
    /* Discontinuities of the slope are rare, and worth steps only for reference samples. */
    const vmask is_segment = lanes & vf_lt(vf_of(0), w.length),
                in_steps = CTS_MUTATED(LIT_STEPS)
                               ? mask_of_bits(0)
                               : is_segment & vf_lt(vf_of(m->shading_tolerance), IS_REFERENCE ? deviation : smooth);
    const PhongTerms phong = phong_terms(j, &centre, open.at_centre);
    for (int l = 0; l < n; l++) {
        const int ray = queues->queue.ray[first + l];
        if (mask_bits(in_steps) >> l & 1) {
            move_entry(&queues->stepped[queue_of_deviation(m, deviation[l])], &queues->queue, first + l);
            continue;
        }
        for (int c = 0; c < 3; c++)
            m->rays->rgba[ray][c] += (float)(w.colour[c][l] * phong.colour[l] + w.weight[l] * phong.white[l]);
        m->rays->shading_bound[ray] += (float)((real)0.25f * deviation[l]);
    }
    for (int kind = 0; kind < TILED_STEP_QUEUES; kind++)
        if (queues->stepped[kind].n >= LANES)
            shade_stepped(m, queues, kind, LANES);
}

/* Shades queued entries as far as they fill vectors; all of them at the end. */
OUTLINE void shade_queued(March *m, ShadingQueues *queues, bool all)
{
    const uint64_t begun = cts_tiled_ticks();
    int done = 0;
    for (; done + LANES <= queues->queue.n; done += LANES)
        shade_entries(m, queues, done, LANES);
    if (all && done < queues->queue.n) {
        shade_entries(m, queues, done, queues->queue.n - done);
        done = queues->queue.n;
    }
    for (int kind = 0; kind < TILED_STEP_QUEUES && all; kind++)
        if (queues->stepped[kind].n > 0)
            shade_stepped(m, queues, kind, queues->stepped[kind].n);
    m->counts->queues += (uint64_t)done;
    drop_entries(&queues->queue, done);
    m->counts->shade_ticks += cts_tiled_ticks() - begun;
}

/* Queues the lane's low-weight segments to be shaded at their common centre; the gradient field of that cell gives
 * their normal deviation. */
OUTLINE void flush_deferred(March *m, ShadingQueues *queues, int lane)
{
    Packet *const p = m->p;
    if (p->ray[lane] < 0 || !(p->deferred_weight[lane] > 0))
        return;
    const int i = queues->queue.n++;
    const real begin = p->deferred_begin[lane], mm = p->deferred_centre[lane] / p->deferred_weight[lane],
               length = p->deferred_end[lane] - begin;
    queues->queue.ray[i] = p->ray[lane];
    queues->queue.appearance[i] = CTS_APPEARANCE_PRESET; /* a point needs no steps */
    for (int a = 0; a < 3; a++) {
        const real vox = p->start[a][lane] + mm * m->step[a];
        const int last = m->job->n_cells[a] - 1, cell = vox < 0 ? 0 : vox < (real)last ? (int)vox : last;
        queues->queue.field[ENTRY_CELL + a][i] = (real)cell;
        queues->queue.field[ENTRY_ENTER + a][i] = vox - (real)cell + (begin - mm) * m->step[a];
        queues->queue.field[ENTRY_LEAVE + a][i] = vox - (real)cell + (begin + length - mm) * m->step[a];
        queues->queue.field[ENTRY_COLOUR + a][i] = p->deferred_colour[a][lane];
        p->deferred_colour[a][lane] = 0;
    }
    queues->queue.field[ENTRY_WEIGHT][i] = p->deferred_weight[lane];
    queues->queue.field[ENTRY_CENTRE][i] = (mm - begin) / length;
    queues->queue.field[ENTRY_TRANSMITTANCE][i] = queues->queue.field[ENTRY_LENGTH][i] =
        queues->queue.field[ENTRY_TRANSFER_SEGMENT][i] = 0;
    p->deferred_weight[lane] = p->deferred_centre[lane] = 0;
    if (queues->queue.n > QUEUE_SIZE - 2 * LANES)
        shade_queued(m, queues, false);
}

/* Queues segments for shading, with their absorbed light. */
INLINE void queue_for_shading(March *m, ShadingQueues *queues, const SegmentIntegral *e, vi q, const vf weight[2],
                              const vf colour[3], vf length, vmask lanes)
{
    Packet *const p = m->p;
    const vf all = weight[0] + weight[1], second = weight[1] / vf_max(all, vf_of((real)1e-30f));
    const vf first_half = centre_of((real)M_LN2 * e->depth[0]), second_half = centre_of((real)M_LN2 * e->depth[1]);
    const vf centre = (real)0.5f * (first_half + second * (1 + second_half - first_half));
    const vmask bright = lanes & vf_le(vf_of(m->min_shaded_weight), all),
                low_weight = CTS_MUTATED(LOW_WEIGHT) ? mask_of_bits(0) : lanes & ~bright;
    /* Segments far from each other are not combined: there may be no gradient between them. */
    const vmask takes = low_weight & vf_lt(vf_of(0), all);
    const vmask apart = takes & vf_lt(vf_of(0), p->deferred_weight) & vf_lt(p->deferred_end + m->cell_mm, p->t);
    for (unsigned left = mask_bits(apart); left; left &= left - 1)
        flush_deferred(m, queues, __builtin_ctz(left));
    for (int c = 0; c < 3; c++)
        p->deferred_colour[c] += vf_select(low_weight, colour[c], vf_of(0));
    p->deferred_begin = vf_select(takes & ~vf_lt(vf_of(0), p->deferred_weight), p->t, p->deferred_begin);
    p->deferred_end = vf_select(takes, p->t + length, p->deferred_end);
    p->deferred_weight += vf_select(low_weight, all, vf_of(0));
    p->deferred_centre += vf_select(low_weight, all * (p->t + centre * length), vf_of(0));
    unsigned due = mask_bits(bright | (low_weight & vf_le(vf_of(m->min_shaded_weight), p->deferred_weight)));
    if (!due)
        return;
    const unsigned now = mask_bits(bright);
    vf enter[3], leave[3];
    for (int a = 0; a < 3; a++) {
        const vf within = p->start[a] - to_float(p->cell[a]);
        enter[a] = within + p->t * m->step[a];
        leave[a] = within + (p->t + length) * m->step[a];
    }
    for (; due; due &= due - 1) {
        const int l = __builtin_ctz(due);
        flush_deferred(m, queues, l);
        if (!(now >> l & 1))
            continue;
        const int i = queues->queue.n++;
        queues->queue.ray[i] = p->ray[l];
        queues->queue.appearance[i] = p->appearance[l];
        for (int a = 0; a < 3; a++) {
            queues->queue.field[ENTRY_CELL + a][i] = (real)p->cell[a][l];
            queues->queue.field[ENTRY_ENTER + a][i] = enter[a][l];
            queues->queue.field[ENTRY_LEAVE + a][i] = leave[a][l];
            queues->queue.field[ENTRY_COLOUR + a][i] = colour[a][l];
        }
        queues->queue.field[ENTRY_WEIGHT][i] = all[l];
        queues->queue.field[ENTRY_CENTRE][i] = centre[l];
        queues->queue.field[ENTRY_TRANSMITTANCE][i] = p->transmittance[l];
        queues->queue.field[ENTRY_LENGTH][i] = length[l];
        queues->queue.field[ENTRY_TRANSFER_SEGMENT][i] = (real)q[l];
    }
    if (queues->queue.n > QUEUE_SIZE - 2 * LANES)
        shade_queued(m, queues, false);
}
