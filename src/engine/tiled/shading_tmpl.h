/* Shading, part of tiled_march_tmpl.h: |n.v| is not polynomial, and varies most where the gradient nearly vanishes. A
 * segment is shaded at three points, both ends and the centre of its absorbed light, between which light is a parabola;
 * where its normal deviates too much for that, in steps, each as long as the deviation allows. */
#include "core/scene/light_tmpl.h"

/* Ray segments, or several low-weight ones together, that wait to be shaded: one a lane. */
typedef struct Entries {
    vf ray, t, length; /* mm from the ray's start */
    vf colour[3];      /* absorbed light, times its weight */
    vf change[3];      /* of the colour over the segment, likewise */
    vf weight;         /* absorbed share of the ray's light */
    vf centre;         /* of the absorbed light, 0..1 of the length */
    vf transmittance;  /* before it */
    vf depth[2];       /* optical depth of both halves, to the base of 2; 0: low-weight segments */
} Entries;
enum { N_FIELDS = sizeof(Entries) / sizeof(vf), QUEUE_SIZE = 8 * LANES };

/* The fields of Entries one after the other. */
typedef struct ShadingQueue {
    real field[N_FIELDS][QUEUE_SIZE];
    int n;
} ShadingQueue;

/* By the probable number of steps; the first is of segments that are not yet known to need any. */
typedef struct ShadingQueues {
    ShadingQueue queue[TILED_SHADING_QUEUES];
    real start[3][TILED_RAYS]; /* of the rays, voxels */
} ShadingQueues;

static void push_entries(ShadingQueue *q, const Entries *w, vmask lanes)
{
    const vf *const field = (const vf *)w;
    for (int f = 0; f < N_FIELDS; f++)
        vf_pack(q->field[f] + q->n, field[f], lanes);
    q->n += count(mask_bits(lanes));
}

INLINE Entries load_entries(const ShadingQueue *q, int first)
{
    Entries w;
    vf *const field = (vf *)&w;
    for (int f = 0; f < N_FIELDS; f++)
        field[f] = vf_load(q->field[f] + first);
    return w;
}

/* The first are done; less than a vector of them is left. */
INLINE void drop_entries(ShadingQueue *q, int done)
{
    q->n -= done;
    for (int f = 0; f < N_FIELDS; f++)
        vf_store(q->field[f], vf_load(q->field[f] + done));
}

/* The way of segments through the cells in which their centres lie. */
typedef struct CellWay {
    vi cell[3];
    vf enter[3], displacement[3]; /* from the cell's origin */
} CellWay;

INLINE CellWay way_of(const March *m, const ShadingQueues *queues, const Entries *w)
{
    CellWay way;
    for (int a = 0; a < 3; a++) {
        const vf begin = load_of_rays(queues->start[a], to_int(w->ray)) + w->t * m->step[a];
        way.displacement[a] = w->length * m->step[a];
        way.cell[a] = vi_min(to_int(begin + w->centre * way.displacement[a]), vi_of(m->job->n_cells[a] - 1));
        way.enter[a] = begin - to_float(way.cell[a]);
    }
    return way;
}

/* Differences of levels at a cell's voxels along its three axes. */
typedef struct Corners {
    vf slope[3][8];
} Corners;

#include "engine/tiled/gradient_tmpl.h"

/* The fields along a segment: the gradient to the right, up and along the viewing direction, and openness as in the
 * cell of blocks at its centre. */
typedef struct FieldPath {
    CellWay way;
    Polynomial gradient[3], open;
} FieldPath;

INLINE Polynomial corners_along(const vf corner[8], const vf at[3], const vf displacement[3])
{
    vf low[4], rise[4];
    for (int i = 0; i < 4; i++) {
        low[i] = corner[2 * i];
        rise[i] = corner[2 * i + 1] - low[i];
    }
    return trilinear_along(low, rise, at, displacement);
}

INLINE void place_on(const CellWay *way, vf s, vf vox[3])
{
    for (int a = 0; a < 3; a++)
        vox[a] = to_float(way->cell[a]) + way->enter[a] + s * way->displacement[a];
}

INLINE Polynomial open_along(const CtsOpenness *o, const CellWay *way, vf centre, vmask lanes)
{
    vf middle[3], front[3], back[3], at[3], displacement[3];
    place_on(way, centre, middle);
    place_on(way, vf_of(0), front);
    place_on(way, vf_of(1), back);
    const OpenCell c = load_open(o, middle, lanes);
    for (int a = 0; a < 3; a++) {
        const vf begin = block_coordinate(o, a, front[a]);
        at[a] = begin - to_float(c.at[a]);
        displacement[a] = block_coordinate(o, a, back[a]) - begin;
    }
    Polynomial open = corners_along(c.corner, at, displacement);
    for (int i = 0; i < 4; i++)
        open.c[i] *= (real)(1 / 255.0);
    return open;
}

INLINE FieldPath load_path(const March *m, const ShadingQueues *queues, const Entries *w, vmask lanes)
{
    const TiledJob *const j = m->job;
    Corners k;
    Polynomial along[3];
    FieldPath path;
    path.way = way_of(m, queues, w);
    load_corners(j, path.way.cell, lanes, &k);
    for (int a = 0; a < 3; a++)
        along[a] = corners_along(k.slope[a], path.way.enter, path.way.displacement);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 4; c++)
            path.gradient[i].c[c] = (real)j->frame[i][0] * along[0].c[c] + (real)j->frame[i][1] * along[1].c[c] +
                                    (real)j->frame[i][2] * along[2].c[c];
    path.open = j->open ? open_along(j->open, &path.way, w->centre, lanes)
                        : (Polynomial){{vf_of(1), vf_of(0), vf_of(0), vf_of(0)}};
    return path;
}

/* Openness at fraction s of a segment. */
INLINE vf openness_at(const TiledJob *j, const FieldPath *path, vf s, vmask lanes)
{
    vf vox[3];
    if (!IS_REFERENCE || !j->open)
        return polynomial_at(&path->open, s);
    place_on(&path->way, s, vox);
    const OpenCell c = load_open(j->open, vox, lanes);
    return open_between(j->open, &c, vox);
}

/* Light at a place: the unit normal to the right, up and along the viewing direction, 0 without a gradient; openness;
 * factor of the colour, and white to be added, for a weight of 1. */
typedef struct LitPoint {
    vf normal[3], open, colour, white;
} LitPoint;

INLINE vf dot(const vf a[3], const vf b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#define MIN_SQUARE ((real)1e-20f)
enum { MAX_POINTS = 3 };
/* Shares of a segment. */
#define SHORTEST_STEP ((real)1 / (sizeof(real) == 4 ? 1 << 9 : 1 << 14))

/* |n.v|^power of n points, side by side, since each is a chain of multiplications. */
INLINE void find_highlights(const CtsShade *s, int n, const vf facing[], vf highlight[])
{
    vf square[MAX_POINTS];
    for (int i = 0; i < n; i++) {
        square[i] = vf_max(facing[i], vf_of((real)s->least_power));
        highlight[i] =
            s->whole_power > 0 ? vf_of(1) : vf_exp2(vf_min((real)s->exponent * vf_log2(square[i]), vf_of(0)));
    }
    for (int power = s->whole_power; power > 0; power >>= 1) {
        for (int i = 0; i < n && power & 1; i++)
            highlight[i] *= square[i];
        for (int i = 0; i < n; i++)
            square[i] *= square[i];
    }
}

/* At fractions s of a segment; not at its very ends, where a gradient may begin from nothing. */
INLINE void find_light(const TiledJob *j, const FieldPath *path, vmask lanes, int n, const vf s[], LitPoint point[])
{
    vf facing[MAX_POINTS], highlight[MAX_POINTS];
    vmask has[MAX_POINTS];
    for (int i = 0; i < n; i++) {
        const vf within = vf_min(vf_max(s[i], vf_of(SHORTEST_STEP / 2)), vf_of(1 - SHORTEST_STEP / 2));
        vf g[3];
        for (int k = 0; k < 3; k++)
            g[k] = polynomial_at(&path->gradient[k], within);
        const vf square = dot(g, g);
        has[i] = vf_lt(vf_of(MIN_SQUARE), square);
        const vf inverse = vf_select(has[i], vf_inverse_root(vf_max(square, vf_of(MIN_SQUARE))), vf_of(0));
        for (int k = 0; k < 3; k++)
            point[i].normal[k] = g[k] * inverse;
        const vf towards = point[i].normal[2];
        facing[i] = vf_min(CTS_MUTATED(ONE_SIDED_LIGHT) ? vf_max(towards, vf_of(0)) : vf_abs(towards), vf_of(1));
    }
    find_highlights(j->shade, n, facing, highlight);
    for (int i = 0; i < n; i++) {
        point[i].open = openness_at(j, path, s[i], lanes);
        light_terms(j->shade, facing[i], vf_select(has[i], highlight[i], vf_of(0)), point[i].open, &point[i].colour,
                    &point[i].white);
    }
}

/* Squared difference of the normals, scaled by the curvature of the highlight. */
INLINE vf normal_deviation(const March *m, const LitPoint *a, const LitPoint *b)
{
    vf difference[3];
    for (int i = 0; i < 3; i++)
        difference[i] = a->normal[i] - b->normal[i];
    return vf_min(m->highlight_curvature * dot(difference, difference), vf_of(4));
}

/* Error by normals that pass the perpendicular, in units of normal deviation: |n.v| has a discontinuity of the slope
 * there. Of numbers x from -a to b the mean of |x| exceeds |mean of x| by 2 a b / (a + b) at most. */
INLINE vf perpendicular_error(const March *m, const LitPoint p[3])
{
    vf low = vf_of(0), high = vf_of(0);
    for (int i = 0; i < 3; i++) {
        low = vf_min(low, p[i].normal[2]);
        high = vf_max(high, p[i].normal[2]);
    }
    return m->slope_discontinuity * 2 * high * -low / vf_max(high - low, vf_of((real)1e-6f));
}

/* Part of a segment: its absorbed light as colour and weight, change of the colour, the share of the light before it,
 * and the centre of its absorption, 0..1; ends: weight of the light at its ends. */
typedef struct SegmentPart {
    vf colour[3], change[3], weight, share, centre, ends;
} SegmentPart;

/* Light is a parabola through both ends and the centre c. The variance of absorption is 4/3 (c (1 - c))^2, exactly 1/12
 * of a clear part, and of all depths within 0.02 of c (1 - c). */
INLINE vf weight_of_ends(vf centre)
{
    return (real)(4 / 3.0) * centre * (1 - centre);
}

/* A part's light, and its error: by smooth changes, and all. */
typedef struct LitPart {
    vf rgb[3], smooth, error;
} LitPart;

INLINE LitPart shade_part(const March *m, const SegmentPart *part, const LitPoint p[3])
{
    const vf last = part->ends * part->centre, first = part->ends - last, middle = 1 - part->ends;
    const vf colour = first * p[0].colour + middle * p[1].colour + last * p[2].colour;
    const vf white = part->weight * (first * p[0].white + middle * p[1].white + last * p[2].white);
    const vf deviation = normal_deviation(m, &p[0], &p[1]) + normal_deviation(m, &p[1], &p[2]);
    const vf change = vf_abs(p[2].open - p[0].open);
    const vf tilt = last * (1 - part->centre) * (p[2].colour - p[0].colour);
    LitPart lit;
    for (int c = 0; c < 3; c++)
        lit.rgb[c] = part->colour[c] * colour + part->change[c] * tilt + white;
    lit.smooth = part->weight * (deviation * ((real)0.25f * part->share + (real)0.1f * deviation) +
                                 4 * m->occlusion_sensitivity * change * part->share *
                                     ((real)0.011f * part->share + (real)0.125f * change));
    lit.error = lit.smooth + (real)0.5f * part->weight * perpendicular_error(m, p);
    return lit;
}

/* Parts that are to be shaded in shorter ones. Discontinuities of the slope are rare, and worth steps only for
 * reference samples. */
INLINE vmask is_coarse(const March *m, const LitPart *lit)
{
    return vf_lt(vf_of(m->shading_tolerance), IS_REFERENCE ? lit->error : lit->smooth);
}

INLINE void add_light(const March *m, int queue, int n, vf ray, const LitPart *lit, vmask lanes)
{
    const vi to = to_int(ray);
    const unsigned bits = mask_bits(lanes);
    for (int l = 0; l < n; l++) {
        if (!(bits >> l & 1))
            continue;
        float *const sum = m->rays->light[queue][to[l]];
        for (int c = 0; c < 3; c++)
            sum[c] += (float)lit->rgb[c][l];
        sum[3] += (float)((real)0.25f * lit->error[l]);
    }
}

/* Centroid, 0..1, of the light absorbed along a part of this depth, to the base of 2: c = 1 / d - 1 / (e^d - 1) of an
 * even extinction, with an error below 0.008. One that changes by `slope` over the part displaces it by about slope / d
 * c (1 - c) / 3, which of a clear part is exact. */
INLINE vf centre_of(vf depth, vf slope)
{
    const vf d = (real)M_LN2 * depth;
    const vf even = ((real)0.5f + (real)0.0738f * d) / (1 + ((real)0.3143f + (real)0.0738f * d) * d);
    const vf least = vf_max(vf_max(depth, (real)0.5f * vf_abs(slope)), vf_of((real)1e-30f));
    return even + (real)(1 / 3.0) * slope / least * even * (1 - even);
}

/* Change of the extinction over a segment, by the depths of its halves, which are those at the Gauss points. */
INLINE vf slope_of(const vf depth[2])
{
    return (real)3.46410162f * (depth[1] - depth[0]);
}

/* Shades segments in steps of small normal deviation. Extinction and colour change linearly along them. */
OUTLINE LitPart shade_in_steps(const March *m, const Entries *w, const FieldPath *path, vmask lanes)
{
    const TiledJob *const j = m->job;
    const real least = (real)1e-9f;
    const vf slope = slope_of(w->depth), first = w->depth[0] + w->depth[1] - (real)0.5f * slope,
             by_weight = 1 / w->weight;
    vf s = vf_of(0), step = vf_of((real)0.5f), transmittance = w->transmittance;
    LitPoint point[3];
    find_light(j, path, lanes, 1, &s, point);
    LitPart sum = {{vf_of(0), vf_of(0), vf_of(0)}, vf_of(0), vf_of(0)};
    for (vmask on = lanes; mask_any(on);) {
        const vf to = vf_min(s + step, vf_of(1)), length = to - s, half = (real)0.5f * length;
        const vf extinction = vf_max(first + slope * (s + half), vf_of(least)), depth = length * extinction;
        SegmentPart part = {.share = vf_opacity(depth)};
        part.weight = transmittance * part.share;
        part.centre = centre_of(depth, length * length * slope);
        part.ends = weight_of_ends(part.centre);
        const vf centre = s + part.centre * length;
        const vf of_all = part.weight * by_weight;
        for (int c = 0; c < 3; c++) {
            part.colour[c] = of_all * (w->colour[c] + (centre - w->centre) * w->change[c]);
            part.change[c] = of_all * length * w->change[c];
        }
        find_light(j, path, lanes, 2, (const vf[]){centre, to}, point + 1);
        const LitPart lit = shade_part(m, &part, point);
        const vmask done = on & (~is_coarse(m, &lit) | vf_le(length, vf_of(SHORTEST_STEP)));
        for (int c = 0; c < 3; c++)
            sum.rgb[c] += vf_select(done, lit.rgb[c], vf_of(0));
        sum.error += vf_select(done, lit.error, vf_of(0));
        transmittance = vf_select(done, transmittance - part.weight, transmittance);
        step = vf_select(done, 2 * length, half);
        for (int i = 0; i < 3; i++)
            point[0].normal[i] = vf_select(done, point[2].normal[i], point[0].normal[i]);
        point[0].open = vf_select(done, point[2].open, point[0].open);
        point[0].colour = vf_select(done, point[2].colour, point[0].colour);
        point[0].white = vf_select(done, point[2].white, point[0].white);
        s = vf_select(done, to, s);
        on &= vf_lt(s, vf_of(1)) & vf_lt(vf_of(least), transmittance);
    }
    return sum;
}

/* Shades the first n entries of a queue in steps. */
OUTLINE void shade_stepped(const March *m, ShadingQueues *queues, int queue, int n)
{
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const Entries w = load_entries(&queues->queue[queue], 0);
    const FieldPath path = load_path(m, queues, &w, lanes);
    const LitPart lit = shade_in_steps(m, &w, &path, lanes);
    add_light(m, queue, n, w.ray, &lit, lanes);
    drop_entries(&queues->queue[queue], n);
}

/* Segments go where others need about as many steps. */
INLINE void queue_for_steps(const March *m, ShadingQueues *queues, const Entries *w, vf error, vmask lanes)
{
    real most = 8 * m->shading_tolerance;
    for (int i = 1; i < TILED_SHADING_QUEUES && mask_any(lanes); i++, most *= 8) {
        const vmask here = i + 1 < TILED_SHADING_QUEUES ? lanes & vf_le(error, vf_of(most)) : lanes;
        lanes &= ~here;
        if (!mask_any(here))
            continue;
        push_entries(&queues->queue[i], w, here);
        if (queues->queue[i].n >= LANES)
            shade_stepped(m, queues, i, LANES);
    }
}

OUTLINE void shade_entries(const March *m, ShadingQueues *queues, int first, int n)
{
    const vmask lanes = mask_of_bits((1u << n) - 1);
    const Entries w = load_entries(&queues->queue[0], first);
    const FieldPath path = load_path(m, queues, &w, lanes);
    LitPoint point[3];
    find_light(m->job, &path, lanes, 3, (const vf[]){vf_of(0), w.centre, vf_of(1)}, point);
    const vf share = w.weight / vf_max(vf_max(w.transmittance, w.weight), vf_of((real)1e-30f));
    /* Low-weight segments may lie in several cells, whose gradients only the centre's field is not. */
    const vmask is_segment = lanes & vf_lt(vf_of(0), w.depth[0] + w.depth[1]);
    const SegmentPart all = {
        {w.colour[0], w.colour[1], w.colour[2]},
        {w.change[0], w.change[1], w.change[2]},
        w.weight,
        share,
        w.centre,
        vf_select(vf_lt(w.length, vf_of((real)1.01f * m->cell_mm)), weight_of_ends(w.centre), vf_of(0))};
    const LitPart lit = shade_part(m, &all, point);
    const vmask in_steps = CTS_MUTATED(LIT_STEPS) ? mask_of_bits(0) : is_segment & is_coarse(m, &lit);
    add_light(m, 0, n, w.ray, &lit, lanes & ~in_steps);
    queue_for_steps(m, queues, &w, lit.smooth, in_steps);
}

/* Shades queued entries as far as they fill vectors; all of them at the end. */
OUTLINE void shade_queued(March *m, ShadingQueues *queues, bool all)
{
    const uint64_t begun = cts_tiled_ticks();
    ShadingQueue *const queue = &queues->queue[0];
    int done = 0;
    for (; done + LANES <= queue->n; done += LANES)
        shade_entries(m, queues, done, LANES);
    if (all && done < queue->n) {
        shade_entries(m, queues, done, queue->n - done);
        done = queue->n;
    }
    for (int i = 1; i < TILED_SHADING_QUEUES && all; i++)
        if (queues->queue[i].n > 0)
            shade_stepped(m, queues, i, queues->queue[i].n);
    m->counts->queues += (uint64_t)done;
    drop_entries(queue, done);
    m->counts->shade_ticks += cts_tiled_ticks() - begun;
}

/* Queues the lanes' low-weight segments to be shaded together. */
OUTLINE void flush_deferred(March *m, ShadingQueues *queues, vmask lanes)
{
    Packet *const p = m->p;
    const vf zero = vf_of(0), length = p->deferred_end - p->deferred_begin;
    lanes &= vf_lt(zero, p->deferred_weight);
    const vf centre = (p->deferred_centre / vf_select(lanes, p->deferred_weight, vf_of(1)) - p->deferred_begin) /
                      vf_select(lanes, length, vf_of(1));
    const Entries w = {.ray = to_float(vi_load(p->ray)),
                       .t = p->deferred_begin,
                       .length = length,
                       .colour = {p->deferred_colour[0], p->deferred_colour[1], p->deferred_colour[2]},
                       .weight = p->deferred_weight,
                       .centre = centre};
    push_entries(&queues->queue[0], &w, lanes);
    for (int c = 0; c < 3; c++)
        p->deferred_colour[c] = vf_select(lanes, zero, p->deferred_colour[c]);
    p->deferred_weight = vf_select(lanes, zero, p->deferred_weight);
    p->deferred_centre = vf_select(lanes, zero, p->deferred_centre);
    if (queues->queue[0].n > QUEUE_SIZE - 3 * LANES)
        shade_queued(m, queues, false);
}

/* Queues segments for shading, with their absorbed light. */
INLINE void queue_for_shading(March *m, ShadingQueues *queues, const SegmentIntegral *e, const vf weight[2],
                              const vf colour[3], vf length, vmask lanes)
{
    Packet *const p = m->p;
    const vf all = weight[0] + weight[1];
    const vf centre = centre_of(e->depth[0] + e->depth[1], slope_of(e->depth));
    const vmask bright = lanes & vf_le(vf_of(m->min_shaded_weight), all),
                low_weight = CTS_MUTATED(LOW_WEIGHT) ? mask_of_bits(0) : lanes & ~bright;
    /* Segments far from each other are not combined: there may be no gradient between them. */
    const vmask takes = low_weight & vf_lt(vf_of(0), all);
    const vmask apart = takes & vf_lt(vf_of(0), p->deferred_weight) & vf_lt(p->deferred_end + m->cell_mm, p->t);
    if (mask_any(apart))
        flush_deferred(m, queues, apart);
    for (int c = 0; c < 3; c++)
        p->deferred_colour[c] += vf_select(low_weight, colour[c], vf_of(0));
    p->deferred_begin = vf_select(takes & ~vf_lt(vf_of(0), p->deferred_weight), p->t, p->deferred_begin);
    p->deferred_end = vf_select(takes, p->t + length, p->deferred_end);
    p->deferred_weight += vf_select(low_weight, all, vf_of(0));
    p->deferred_centre += vf_select(low_weight, all * (p->t + centre * length), vf_of(0));
    const vmask due = bright | (low_weight & vf_le(vf_of(m->min_shaded_weight), p->deferred_weight));
    if (!mask_any(due))
        return;
    if (mask_any(due & vf_lt(vf_of(0), p->deferred_weight)))
        flush_deferred(m, queues, due);
    Entries w = {.ray = to_float(vi_load(p->ray)),
                 .t = p->t,
                 .length = length,
                 .weight = all,
                 .centre = centre,
                 .transmittance = p->transmittance,
                 .depth = {e->depth[0], e->depth[1]}};
    for (int c = 0; c < 3; c++) {
        w.colour[c] = colour[c];
        w.change[c] = all * (real)1.73205081f * (e->at[1].rgb[c] - e->at[0].rgb[c]);
    }
    push_entries(&queues->queue[0], &w, bright);
    if (queues->queue[0].n > QUEUE_SIZE - 3 * LANES)
        shade_queued(m, queues, false);
}
