/* The march itself; see cells.h, and base/simd.h for the vectors. */
#include "base/invariant.h"
#include "base/mutation.h"
#include "base/simd.h"
#include "base/simd_math_tmpl.h"
#include "engine/tiled/cells.h"
#include "engine/tiled/loads_tmpl.h"
#include <math.h>

#ifdef SIMD_DOUBLE
enum { HALVINGS = 40, ROOT_STEPS = 60 };
#define ROOT_OFF ((real)1e-4)
#define LEAST_STEP ((real)1e-14)
#define LEAST_SHARE ((real)1e-9)
#define LEAST_MM ((real)1e-11)
#define FAR_MM ((real)1e60)
#define NEARLY_1 (1 - 0x1p-52)
/* Between neighbouring levels, or near one, single precision gives the position of a control point to a few digits
 * only; the rest completes it. */
#define FULL(rounded, rest) ((rounded) + (rest))
/* The double-precision march is the reference and resolves grazing contacts itself. */
#define DOUBTED(wrong) vf_of(0)
#define JUDGES true
#else
enum { HALVINGS = 3, ROOT_STEPS = 8 };
#define ROOT_OFF ((real)0.1f)
#define LEAST_STEP ((real)1e-7f)
#define LEAST_SHARE ((real)2e-4)
#define LEAST_MM ((real)6e-5)
#define FAR_MM ((real)1e30)
#define NEARLY_1 ((real)(1 - 0x1p-23))
#define FULL(rounded, rest) (rounded)
#define DOUBTED(wrong) (wrong)
#define JUDGES false
#endif
enum { MOST_CUTS = 12 };
/* Rounding error of levels as a share of job->touch. */
#define ROUNDED_BY ((real)0.003f)

typedef struct Packet {
    vf start[3]; /* of the rays, voxels */
    vf at, end;  /* mm from there: where they are, and where they leave the box */
    vf until;    /* limit of the next segment after halving */
    vf light, sum[4], bound;
    vf surface, first; /* mm to half opacity, and to the first visible point */
    vi cell[3];
    vmask active;
    vmask fresh; /* starts at a control point, where it was just split */
    vi look;     /* appearance at the ray's position; the next one begins at edge, if within the cell */
    vf edge;
    int owned[LANES][3];  /* the cells in which boundaries of labels were computed */
    int last_look[LANES]; /* from the edge on to the end of the cell; -1: edges follow */
    int ray[LANES];
    /* Low-weight segments of each lane, queued until together they are worth a gradient: colour and weight, weighted
     * centre, and in mm the begin of the first and the end of the last of them. */
    vf faint_colour[3], faint_weight, faint_centre, faint_begin, faint_end;
} Packet;

/* Packets alternate: while one waits for voxels the processor works on the other. */
enum { PACKETS = 2 };

typedef struct March {
    const TiledJob *job;
    const TiledPieces *pieces; /* of the lanes that are at work */
    TiledRays *rays;
    TiledCounts *counts;
    int next; /* ray */
    real step[3], inverse[3], far[3], cell_mm, tolerance, dark, touch, least_lit, turn, sharp, kinked, dimmed;
    whole ahead[3], behind[3];
    Packet packet[PACKETS], *p; /* the current packet */
} March;

/* The field along a segment as a cubic, by its Bernstein coefficients. */
typedef struct Cubic {
    vf b[4];
} Cubic;

/* The mean. */
INLINE vf middle_of(const Cubic *c)
{
    return (real)0.25f * (c->b[0] + c->b[1] + c->b[2] + c->b[3]);
}

INLINE int count(unsigned bits)
{
    return __builtin_popcount(bits);
}

/* Distances to the next faces: of the rays' cells, or of the empty space to be skipped. */
typedef struct Faces {
    vmask leaping, shows;
    vi face[3];
    vf t[3], nearest; /* mm */
} Faces;

/* The surroundings of rays: a visible cell, an invisible one, an invisible octant of 2^3 cells, half of a block, or a
 * number of blocks. */
INLINE Faces find_faces(const March *m)
{
    const Packet *const p = m->p;
    Faces f;
    const vi word = load_words(&m->job->mask, p->cell, p->active);
    const vmask tells = vu_lt(vi_of(TILED_FAR), word), far = ~tells & vi_lt(vi_of(0), word);
    const vi corner = (p->cell[0] & 2) | (p->cell[1] & 2) << 2, in_corner = (p->cell[0] & 1) | (p->cell[1] & 1) << 2;
    f.shows = p->active & tells & vi_test(word, vi_of(1) << (corner | in_corner | (p->cell[2] & 1) << 4));
    f.leaping = p->active & ~(tells & vi_test(word, vi_of(0x330033) << corner));
    const vi distance = vi_select(far, word, vi_of(1)) - (CTS_MUTATED(LEAP_FAR) ? -1 : 0);
    const vi across = vi_select(tells, vi_of(1), vi_of(2)), up = vi_select(far, vi_of(2), vi_of(1));
    for (int a = 0; a < 3; a++) {
        const vi size = a < 2 ? across : up, past = ((p->cell[a] >> size) + (m->ahead[a] ? distance : 1 - distance))
                                                    << size;
        f.face[a] = vi_select(f.leaping, past, p->cell[a] + m->ahead[a]);
        f.t[a] = (to_float(f.face[a]) - p->start[a]) * m->inverse[a] + m->far[a];
    }
    f.nearest = vf_max(vf_min(vf_min(f.t[0], f.t[1]), f.t[2]), p->at);
    return f;
}

/* Advances rays to the nearest face, and into the cell behind it. */
INLINE void move(March *m, const Faces *f, vmask moving)
{
    Packet *const p = m->p;
    const bool leaps = mask_any(f->leaping);
    vmask outside = vf_le(p->end, f->nearest);
    for (int a = 0; a < 3; a++) {
        const vi last = vi_of(m->job->n_cells[a] - 1);
        vi cell = p->cell[a];
        if (leaps) {
            const vi there = to_int(p->start[a] + f->nearest * m->step[a]);
            const vi on = m->ahead[a] ? vi_min(vi_max(there, cell), last) : vi_max(vi_min(there, cell), vi_of(0));
            cell = vi_select(f->leaping, on, cell);
        }
        cell = vi_select(moving & vf_le(f->t[a], f->nearest), f->face[a] + m->behind[a], cell);
        outside |= vu_lt(last, cell);
        p->cell[a] = cell;
    }
    p->at = vf_select(moving, f->nearest, p->at);
    p->active &= ~(moving & outside);
}

/* The field from p->at over `length` mm within the cell: F = f + x fx + y fy + z fz + xy fxy + xz fxz + yz fyz + xyz
 * fxyz about the entry point, along the displacement `way`. */
INLINE Cubic load_cubic(const March *m, vmask lanes, vf length)
{
    const Packet *const p = m->p;
    const real third = (real)(1 / 3.0);
    vi pair[4];
    vf at[3], way[3], low[4], rise[4];
    load_pairs(m->job, p->cell, lanes, pair);
    for (int a = 0; a < 3; a++) {
        at[a] = p->start[a] - to_float(p->cell[a]) + p->at * m->step[a];
        way[a] = length * m->step[a];
    }
    for (int i = 0; i < 4; i++) {
        low[i] = to_float(lower_half(pair[i]));
        rise[i] = to_float(upper_half(pair[i])) - low[i];
    }
    /* First about the cell's origin. */
    const vf y = low[1] - low[0], z = low[2] - low[0], xy = rise[1] - rise[0], xz = rise[2] - rise[0];
    const vf yz = low[3] - low[2] - y, xyz = rise[3] - rise[2] - xy;
    const vf fxy = xy + at[2] * xyz, fxz = xz + at[1] * xyz, fyz = yz + at[0] * xyz, fy0 = y + at[0] * xy;
    const vf fx = rise[0] + at[1] * xy + at[2] * fxz, fy = fy0 + at[2] * fyz, fz = z + at[0] * xz + at[1] * fyz;
    const vf first = low[0] + at[0] * rise[0] + at[1] * fy0 + at[2] * fz;
    const vf c1 = third * (way[0] * fx + way[1] * fy + way[2] * fz), way_yz = way[1] * way[2];
    const vf c2 = third * (way[0] * (way[1] * fxy + way[2] * fxz) + way_yz * fyz), c3 = way[0] * way_yz * xyz;
    const vf b1 = first + c1, b2 = b1 + c1 + c2;
    return (Cubic){{first, b1, b2, b2 + c1 + 2 * c2 + c3}};
}

/* The transfer function at a level. */
typedef struct Look {
    vf extinction;          /* per mm, to the base of 2 */
    vf opacity, rise, tint; /* slopes: of opacity, and of the colour that changes most */
    vf rgb[3];
} Look;

INLINE real knot_of(const TiledPieces *t, int k)
{
    return FULL((real)t->end[1][k], (real)t->rest[1][k]);
}

INLINE vf end_of(const TiledPieces *t, int end, vi q)
{
    const int n = t->n_knots + 1;
    return FULL(vf_look_up(t->end[end], n, q), vf_look_up(t->rest[end], n, q));
}

INLINE vi piece_of(const TiledPieces *t, vf level)
{
    vi q = vi_of(0);
    if (t->n_knots <= 16) {
        for (int k = 0; k < t->n_knots; k++)
            q = vi_select(vf_le(vf_of(knot_of(t, k)), level), vi_of(k + 1), q);
        return q;
    }
    int bit = 1;
    while (2 * bit <= t->n_knots)
        bit *= 2;
    for (; bit > 0; bit /= 2) {
        const vi on = vi_min(q + bit, vi_of(t->n_knots));
        q = vi_select(vf_le(end_of(t, 0, on), level), on, q);
    }
    return q;
}

/* At a level in linear segment q of the transfer function, or in the adjacent one if the control point between was not
 * worth a split. */
INLINE Look look_at(const TiledPieces *t, vi q, vf level)
{
    const int n = t->n_knots + 1;
    q = vi_select(vf_lt(level, end_of(t, 0, q)), q - 1, vi_select(vf_le(end_of(t, 1, q), level), q + 1, q));
    const vf above = level - end_of(t, 0, q), opaque = vf_of(NEARLY_1), most = vf_of((real)t->most);
    Look l = {.rise = vf_look_up(t->rise[0], n, q), .tint = vf_look_up(t->tint, n, q)};
    l.opacity = vf_max(vf_look_up(t->at[0], n, q) + l.rise * above, vf_of(0));
    const vf by_log = -(real)t->by_log2 * vf_log2_rest(vf_min(l.opacity, opaque));
    l.extinction = vf_select(vf_lt(opaque, l.opacity), most, vf_min(by_log, most));
    for (int c = 0; c < 3; c++)
        l.rgb[c] = vf_look_up(t->at[c + 1], n, q) + vf_look_up(t->rise[c + 1], n, q) * above;
    return l;
}

/* Control points at which segments are to be split. */
typedef struct Cuts {
    int n;
    vf knot[MOST_CUTS], jump[MOST_CUTS], bend[MOST_CUTS];
    vmask lanes[MOST_CUTS], all;
    vf wrong;    /* error by control points without a split, */
    vf passed;   /* the part of those that the field does cross */
    vmask halve; /* segments that cross too many control points, or with too large an effect */
} Cuts;

/* Adds the last control point of the list as a split candidate: the field overshoots it by `over` in total, and by
 * `inside` without its start. Lanes are split if it is worth it; else its effect counts as error. */
INLINE void weigh_knot(const March *m, Cuts *cuts, vmask lanes, vf over, vf inside, vf weight)
{
    const int i = cuts->n;
    const vf touch = vf_of(m->touch);
    const vmask passes = lanes & vf_lt((real)0.04f * touch, over), near = passes | (lanes & vf_lt(-touch, inside));
    const vf worth = weight * (cuts->jump[i] + (real)0.25f * cuts->bend[i] * vf_max(over, touch));
    const vmask cut = CTS_MUTATED(CUTS) ? mask_of_bits(0) : passes & vf_lt(vf_of(m->tolerance), worth);
    cuts->wrong += vf_select(near & ~cut, worth, vf_of(0));
    cuts->passed += vf_select(passes & ~cut, worth, vf_of(0));
    cuts->lanes[i] = cut;
    cuts->all |= cut;
}

/* Split candidates: the control points at both ends of the linear segment q in which the middle of each lane's field
 * lies, and further ones in reach. */
INLINE Cuts find_cuts(const March *m, const Cubic *c, vi q, vmask lanes, vf length)
{
    const TiledPieces *const t = m->pieces;
    const int n = t->n_knots + 1;
    const vf *const b = c->b, weight = length * m->p->light;
    vf inside[2] = {vf_min(vf_min(b[1], b[2]), b[3]), vf_max(vf_max(b[1], b[2]), b[3])};
    const vf range[2] = {vf_min(inside[0], b[0]), vf_max(inside[1], b[0])};
    /* A segment that starts at a control point touches it there, which does not count. */
    for (int end = 0; end < 2; end++)
        inside[end] = vf_select(m->p->fresh, inside[end], range[end]);
    Cuts cuts = {.n = 0, .wrong = vf_of(0), .passed = vf_of(0), .all = mask_of_bits(0), .halve = mask_of_bits(0)};
    for (int away = 0;; away++) {
        const vi at[2] = {vi_max(q - away, vi_of(0)), vi_min(q + away, vi_of(n - 1))};
        for (int end = 0; end < (CTS_MUTATED(KNOT_OFF) ? 1 : 2); end++, cuts.n++) {
            const vf knot = cuts.knot[cuts.n] = end_of(t, end, at[end]);
            cuts.jump[cuts.n] = vf_look_up(t->jump[end], n, at[end]);
            cuts.bend[cuts.n] = vf_look_up(t->bend[end], n, at[end]);
            weigh_knot(m, &cuts, lanes, end ? range[1] - knot : knot - range[0],
                       end ? inside[1] - knot : knot - inside[0], weight);
        }
        const vmask more = lanes & (vf_lt(range[0] - m->touch, vf_look_up(t->beyond[0], n, at[0])) |
                                    vf_lt(vf_look_up(t->beyond[1], n, at[1]), range[1] + m->touch));
        if (!mask_any(more))
            break;
        if (cuts.n + 2 > MOST_CUTS) {
            cuts.halve = more;
            break;
        }
        lanes = more; /* a lane's result must not depend on the others */
    }
    cuts.halve |= CTS_MUTATED(CUTS) ? mask_of_bits(0) : vf_lt(vf_of(m->tolerance), cuts.passed) & ~cuts.all;
    cuts.wrong = vf_min(2 * cuts.wrong, m->p->light);
    return cuts;
}

INLINE vmask differ(vmask a, vmask b)
{
    return (a & ~b) | (b & ~a);
}

/* Segments that may cross a control point more than once, by the sign changes of their coefficients. */
INLINE vmask passes_again(const Cubic *c, const Cuts *cuts)
{
    vmask again = mask_of_bits(0);
    for (int i = 0; i < cuts->n; i++) {
        vmask below[4], turn[3];
        for (int k = 0; k < 4; k++)
            below[k] = vf_lt(c->b[k], cuts->knot[i]);
        for (int k = 0; k < 3; k++)
            turn[k] = differ(below[k], below[k + 1]);
        again |= cuts->lanes[i] & ((turn[0] & turn[1]) | (turn[1] & turn[2]) | (turn[0] & turn[2]));
    }
    return again;
}

/* The first half of a segment (de Casteljau). */
INLINE void halve(Cubic *c, vf *length, vmask lanes)
{
    vf *const b = c->b;
    const real h = (real)0.5f;
    const vf u0 = h * (b[0] + b[1]), u1 = h * (b[1] + b[2]), u2 = h * (b[2] + b[3]);
    const vf v0 = h * (u0 + u1), v1 = h * (u1 + u2);
    b[1] = vf_select(lanes, u0, b[1]);
    b[2] = vf_select(lanes, v0, b[2]);
    b[3] = vf_select(lanes, h * (v0 + v1), b[3]);
    *length = vf_select(lanes, h * *length, *length);
}

/* Zero of the control polygon's first sign change. */
INLINE vf first_crossing(const vf b[4])
{
    vf from = b[2], to = b[3], side = vf_of(2);
    for (int i = 1; i >= 0; i--) {
        const vmask here = differ(vf_lt(b[i], vf_of(0)), vf_lt(b[i + 1], vf_of(0)));
        from = vf_select(here, b[i], from);
        to = vf_select(here, b[i + 1], to);
        side = vf_select(here, vf_of((real)i), side);
    }
    const vf across = from - to;
    return (side + from / vf_select(vf_lt(vf_of(0), vf_abs(across)), across, vf_of(1))) * (real)(1 / 3.0);
}

/* Root of the cubic c[0] + c[1] s + ..., with Bernstein coefficients b and ends of different sign: Newton steps from
 * the control polygon's zero (an end that nearly touches 0 is no crossing), and bisection where they leave the bracket.
 * *wrong: error estimate, from the last step and the rounding of the cubic, times jump, and bend times the remaining
 * overshoot. */
INLINE vf find_root(const March *m, const vf c[4], const vf b[4], vf jump, vf bend, vmask lanes, vf *wrong)
{
    const vmask below = vf_lt(c[0], vf_of(0));
    vf low = vf_of(0), high = vf_of(1), s = first_crossing(b);
    *wrong = vf_of(0);
    for (int i = 0; i < ROOT_STEPS && mask_any(lanes); i++) {
        const vf f = ((c[3] * s + c[2]) * s + c[1]) * s + c[0], slope = (3 * c[3] * s + 2 * c[2]) * s + c[1];
        const vmask before = ~differ(vf_lt(f, vf_of(0)), below);
        low = vf_select(before, s, low);
        high = vf_select(before, high, s);
        const vf by_slope = 1 / vf_max(vf_abs(slope), vf_of((real)1e-12f)), step = vf_abs(f) * by_slope;
        const vf to = s + vf_select(before, step, -step),
                 off = vf_min(step, high - low) + ROUNDED_BY * m->touch * by_slope;
        const vmask within = vf_le(low, to) & vf_le(to, high);
        s = vf_select(lanes, vf_select(within, to, (real)0.5f * (low + high)), s);
        *wrong = vf_select(lanes, off * (jump + bend * vf_abs(f)), *wrong);
        lanes &= vf_lt(vf_of(ROOT_OFF * m->tolerance), *wrong) & vf_lt(vf_of(LEAST_STEP), step);
    }
    return s;
}

/* Shortens each segment to its first crossing of a control point. Returns the lanes that were shortened. */
OUTLINE vmask cut_at_knots(const March *m, Cubic *c, vf *length, Cuts *cuts, vmask *at_knot)
{
    vmask shorter = mask_of_bits(0);
    for (int i = 0;; i++) {
        const vmask again = passes_again(c, cuts) & vf_lt(vf_of(LEAST_MM), *length);
        if (!mask_any(again))
            break;
        if (i == HALVINGS) { /* it may be a grazing contact only */
            cuts->wrong += vf_select(again, m->p->light, vf_of(0));
            break;
        }
        halve(c, length, again);
        shorter |= again;
    }
    const vf *const b = c->b;
    vf power[4] = {b[0], 3 * (b[1] - b[0]), 3 * (b[0] - 2 * b[1] + b[2]), b[3] - b[0] + 3 * (b[1] - b[2])};
    /* A field meets first, of the levels between its ends, the one nearest to where it starts. */
    vmask crosses = mask_of_bits(0);
    vf knot = vf_of(0), jump = vf_of(0), bend = vf_of(0), away = vf_of(FAR_MM);
    for (int i = 0; i < cuts->n; i++) {
        const vf other = cuts->knot[i], other_away = vf_abs(other - b[0]);
        const vmask between = cuts->lanes[i] & differ(vf_lt(b[0], other), vf_lt(b[3], other));
        const vmask nearer = between & vf_lt(other_away, away);
        knot = vf_select(nearer, other, knot);
        away = vf_select(nearer, other_away, away);
        jump = vf_select(nearer, cuts->jump[i], jump);
        bend = vf_select(nearer, cuts->bend[i], bend);
        crosses |= between;
    }
    vf wrong;
    const vf weight = m->p->light * *length;
    const vf least = vf_max(vf_of(LEAST_SHARE), LEAST_MM / vf_max(*length, vf_of((real)1e-9f)));
    const vf shifted[4] = {power[0] - knot, power[1], power[2], power[3]};
    const vf above[4] = {shifted[0], b[1] - knot, b[2] - knot, b[3] - knot};
    const vf at = find_root(m, shifted, above, weight * jump, weight * bend, crosses, &wrong);
    vf root = vf_select(crosses, vf_min(vf_max(at, least), vf_of(1)), vf_of(1));
    cuts->wrong += vf_min(wrong, m->p->light);
    *at_knot = vf_lt(root, vf_of(1 - LEAST_SHARE));
    root = vf_select(*at_knot, root, vf_of(1));
    const vf p1 = power[1] * root, p2 = power[2] * root * root, p3 = power[3] * root * root * root;
    c->b[1] = vf_select(*at_knot, power[0] + (real)(1 / 3.0) * p1, b[1]);
    c->b[2] = vf_select(*at_knot, power[0] + (real)(2 / 3.0) * p1 + (real)(1 / 3.0) * p2, b[2]);
    c->b[3] = vf_select(*at_knot, power[0] + p1 + p2 + p3, b[3]);
    *length *= root;
    return shorter | *at_knot;
}

#define GAUSS_A ((real)0.490562612)
#define GAUSS_B ((real)0.394337567)
#define GAUSS_C ((real)0.105662433)
#define GAUSS_D ((real)0.009437388)

/* Integral over a segment. */
typedef struct Effect {
    Look at[2];
    vf depth[2], taken[2], wrong; /* taken: absorbed shares of the light before each half */
#ifdef MARCH_TRACED
    vf depth_error, colour_error; /* the terms of wrong */
#endif
} Effect;

INLINE Effect integrate(const March *m, const Cubic *c, vi q, vf length)
{
    const TiledPieces *const t = m->pieces;
    const vf *const b = c->b;
    const vf half = (real)0.5f * length;
    const vf first = GAUSS_A * b[0] + GAUSS_B * b[1] + GAUSS_C * b[2] + GAUSS_D * b[3];
    const vf second = GAUSS_D * b[0] + GAUSS_C * b[1] + GAUSS_B * b[2] + GAUSS_A * b[3];
    Effect e;
    e.at[0] = look_at(t, q, first);
    e.at[1] = CTS_MUTATED(GAUSS) ? e.at[0] : look_at(t, q, second);
    vf apart = vf_of(0);
    for (int i = 0; i < 2; i++) {
        e.depth[i] = e.at[i].extinction * half;
        e.taken[i] = vf_taken(e.depth[i]);
    }
    for (int k = 0; k < 3; k++)
        apart = vf_max(apart, vf_abs(e.at[0].rgb[k] - e.at[1].rgb[k]));
    /* Of a linear field the first term is nearly all; another one may have equal colours at both points, but not at its
     * start, the only visible part of an opaque segment. */
    apart = vf_max((real)1.73f * apart, 4 * e.at[0].tint * vf_abs(first - b[0]));
    const vf depth = (real)M_LN2 * (e.depth[0] + e.depth[1]);
    const real by_log = (real)t->by_log2, unit = (real)M_LN2 / by_log;
    const vf turn = unit * (e.at[0].extinction - e.at[1].extinction), turn2 = turn * turn;
    /* Curvature of the logarithm's argument: effect of its second derivative alone, and combined with the slope. */
    const vf bent = vf_max(vf_abs(b[0] - 2 * b[1] + b[2]), vf_abs(b[1] - 2 * b[2] + b[3]));
    const vf clear = 1 - vf_min(vf_max(e.at[0].opacity, e.at[1].opacity), vf_of((real)0.999f));
    const vf bend = 6 * bent * vf_max(vf_abs(e.at[0].rise), vf_abs(e.at[1].rise)) / clear;
    const vf off = (real)0.0375f * turn2 * turn2 + bend * ((real)(1 / 1440.0) * bend + (real)(1 / 120.0) * turn2);
    e.wrong = m->p->light * (by_log * length * off * (1 - e.taken[0]) +
                             apart * vf_min(vf_of((real)0.25f), (real)0.0112f * depth * depth));
#ifdef MARCH_TRACED
    e.depth_error = m->p->light * by_log * length * off * (1 - e.taken[0]);
    e.colour_error = e.wrong - e.depth_error;
#endif
    return e;
}

#ifdef MARCH_TRACED
/* Reports the segments of these lanes, before their rays advance. */
static void trace_segments(const March *m, const Cubic *c, vi q, vf length, const Effect *e, vf cut_error, vmask lanes,
                           vmask done)
{
    const Packet *const p = m->p;
    for (unsigned left = mask_bits(lanes); left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        const real light = p->light[l], first = light * e->taken[0][l], second = (light - first) * e->taken[1][l];
        TiledSegment s = {.integrated = mask_bits(done) >> l & 1,
                          .t_mm = (double)p->at[l],
                          .length_mm = (double)length[l],
                          .depth = M_LN2 * (double)(e->depth[0][l] + e->depth[1][l]),
                          .transmittance = {(double)light, (double)(light - first - second)},
                          .depth_error = (double)e->depth_error[l],
                          .colour_error = (double)e->colour_error[l],
                          .control_point_error = (double)cut_error[l],
                          .transfer_segment = (int)q[l],
                          .appearance = m->job->looks ? (int)p->look[l] : 0};
        for (int i = 0; i < 4; i++)
            s.level[i] = (double)c->b[i][l];
        for (int a = 0; a < 3; a++) {
            const real all = first + second;
            s.cell[a] = (int)p->cell[a][l];
            s.rgb[a] = (double)(all > 0 ? (first * e->at[0].rgb[a][l] + second * e->at[1].rgb[a][l]) / all
                                        : e->at[0].rgb[a][l]);
        }
        m->job->trace->segment(m->job->trace->context, &s);
    }
}
#endif

/* Position of half opacity, in lanes whose segment contains it. */
OUTLINE void find_surface(Packet *p, const Effect *e, vf length, vmask lanes)
{
    const vf before = p->light, between = before - before * e->taken[0], after = between - between * e->taken[1];
    const vf half = (real)0.5f * length, gone = vf_of((real)0.5f);
    const vmask sees = lanes & vf_lt(after, before);
    p->first = vf_select(sees & vf_le(vf_of(FAR_MM), p->first), p->at, p->first);
    const vmask first = vf_le(between, gone);
    const vf from = vf_select(first, before, between), depth = vf_select(first, e->depth[0], e->depth[1]);
    const vf share = (vf_log2(from) + 1) / vf_max(depth, vf_of((real)1e-9f));
    const vf mm = p->at + half * (vf_min(share, vf_of(1)) + vf_select(first, vf_of(0), vf_of(1)));
    p->surface = vf_select(sees & vf_lt(gone, before) & vf_le(after, gone), mm, p->surface);
}

#include "engine/tiled/light_tmpl.h"

#include "engine/tiled/owned_tmpl.h"

/* Invariants of the lanes that integrate a segment, and of the segment. NaN fails each of them. */
INLINE void check_segment(const March *m, vmask lanes, vf length, vf error)
{
    const Packet *const p = m->p;
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), p->light) & vf_le(p->light, vf_of(1)))));
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), length) & vf_le(p->at, p->end))));
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), error) & vf_le(vf_of(0), p->bound))));
    for (int a = 0; a < 3; a++)
        CTS_INVARIANT(!mask_any(lanes & vu_lt(vi_of(m->job->n_cells[a] - 1), p->cell[a])));
}

/* Integrates a segment of rays in visible cells. Returns the lanes that stay in their cell. */
INLINE vmask take_piece(March *m, Lit *lit, vmask lanes, vf leave)
{
    const TiledJob *const j = m->job;
    Packet *const p = m->p;
    const vf all = vf_min(leave, p->end), to = vf_min(all, vf_min(p->until, p->edge));
    vf length = to - p->at;
    Cubic cubic = load_cubic(m, lanes, length);
    vi q = piece_of(m->pieces, middle_of(&cubic));
    Cuts cuts = find_cuts(m, &cubic, q, lanes, length);
    vmask shorter = vf_lt(to, all), fresh = mask_of_bits(0);
    if (mask_any(cuts.all)) {
        shorter |= cut_at_knots(m, &cubic, &length, &cuts, &fresh);
        q = piece_of(m->pieces, middle_of(&cubic));
    }
    const Effect e = integrate(m, &cubic, q, length);
    if (CTS_INVARIANTS)
        check_segment(m, lanes, length, DOUBTED(cuts.wrong) + e.wrong);
    const vmask wrong = CTS_MUTATED(HALVES) ? mask_of_bits(0) : vf_lt(vf_of(m->tolerance), e.wrong) | cuts.halve;
    const vmask again = lanes & wrong & vf_lt(vf_of(2 * LEAST_MM), length);
    const vmask done = lanes & ~again;
#ifdef MARCH_TRACED
    trace_segments(m, &cubic, q, length, &e, DOUBTED(cuts.wrong), lanes, done);
#endif
    p->until = vf_select(again, p->at + (real)0.5f * length, vf_select(done, vf_of(FAR_MM), p->until));
    if (j->want_depth)
        find_surface(p, &e, length, done);
    const vf first = p->light * e.taken[0], between = p->light - first, second = between * e.taken[1];
    const vf weight[2] = {vf_select(done, first, vf_of(0)), vf_select(done, second, vf_of(0))};
    vf colour[3];
    for (int c = 0; c < 3; c++)
        colour[c] = weight[0] * e.at[0].rgb[c] + weight[1] * e.at[1].rgb[c];
    if (lit)
        await_light(m, lit, &e, q, weight, colour, length, done);
    else
        for (int c = 0; c < 3; c++)
            p->sum[c] += colour[c];
    p->sum[3] += weight[0] + weight[1];
    p->light = CTS_MUTATED(ATTENUATION) ? p->light : p->light - weight[0] - weight[1];
    p->bound += vf_select(done, DOUBTED(cuts.wrong) + e.wrong, vf_of(0));
    p->at = vf_select(done & shorter, p->at + length, p->at);
    p->fresh = (p->fresh & ~done) | (done & fresh);
    p->active &= ~(done & (vf_le(p->end, p->at) | vf_lt(p->light, vf_of(m->dark))));
    return again | (done & shorter);
}

/* The same for each appearance among the lanes, one after the other. */
OUTLINE vmask take_pieces(March *m, Lit *lit, vmask lanes, vf leave)
{
    vmask stay = mask_of_bits(0);
    find_looks(m, lanes);
    for (unsigned left = mask_bits(lanes); left;) {
        const vmask alike = first_alike(m, left);
        m->pieces = &m->job->looks->pieces[m->p->look[__builtin_ctz(left)]];
        stay |= take_piece(m, lit, alike, leave);
        left &= ~mask_bits(alike);
    }
    return stay;
}

/* Evaluating a segment costs several times a step of empty-space skipping, so lanes wait until most of them are in
 * visible cells. */
INLINE void step(March *m, Lit *lit)
{
    const Faces f = find_faces(m);
    const int showing = count(mask_bits(f.shows)), all = count(mask_bits(m->p->active));
    vmask stay = f.shows;
    if (4 * showing >= 3 * all) {
        m->counts->pieces += (uint64_t)showing;
        stay = m->job->looks ? take_pieces(m, lit, f.shows, f.nearest) : take_piece(m, lit, f.shows, f.nearest);
    }
    m->counts->skips += (uint64_t)(all - showing);
    move(m, &f, m->p->active & ~stay);
}

/* Store the result of a finished ray. */
INLINE void end_ray(const March *m, int lane)
{
    const Packet *const p = m->p;
    const int i = p->ray[lane];
    if (i < 0)
        return;
    for (int c = 0; c < 3; c++)
        m->rays->rgba[i][c] += (float)p->sum[c][lane];
    m->rays->rgba[i][3] = (float)p->sum[3][lane];
    m->rays->left[i] = p->light[lane] < m->dark ? (float)p->light[lane] : 0;
    m->rays->bound[i] = (float)p->bound[lane] + m->rays->left[i] * m->job->colours;
    if (m->job->want_depth) {
        const real mm = p->surface[lane] < FAR_MM ? p->surface[lane] : p->first[lane];
        m->rays->depth_mm[i] = mm < FAR_MM ? (float)(m->job->camera_mm + m->rays->start_mm[i] + (double)mm) : INFINITY;
    }
}

static void begin_ray(March *m, int lane, int i)
{
    Packet *const p = m->p;
    const TiledRays *const r = m->rays;
    p->ray[lane] = i;
    for (int a = 0; a < 3; a++) {
        p->start[a][lane] = (real)r->start_vox[a][i];
        p->cell[a][lane] = r->meets[a][i];
    }
    p->at[lane] = (real)r->meets_mm[i];
    p->end[lane] = (real)r->length_mm[i];
    p->until[lane] = p->edge[lane] = p->surface[lane] = p->first[lane] = FAR_MM;
    p->owned[lane][0] = -1;
    p->light[lane] = 1;
    p->sum[0][lane] = p->sum[1][lane] = p->sum[2][lane] = p->sum[3][lane] = p->bound[lane] = 0;
}

/* Advances neighbouring rays together to their first visible cells. */
OUTLINE void approach(March *m)
{
    Packet *const p = m->p = m->packet;
    TiledRays *const r = m->rays;
    r->n_meeting = 0;
    for (int first = 0; first < r->n; first += LANES) {
        const int n = r->n - first < LANES ? r->n - first : LANES;
        for (int l = 0; l < n; l++) {
            for (int a = 0; a < 3; a++) {
                const int last = m->job->n_cells[a] - 1, cell = (int)r->start_vox[a][first + l];
                r->meets[a][first + l] = cell < last ? cell : last;
            }
            r->meets_mm[first + l] = 0;
            begin_ray(m, l, first + l);
        }
        p->active = mask_of_bits((1u << n) - 1);
        for (;;) {
            const Faces f = find_faces(m);
            const vmask moving = p->active & ~f.shows;
            if (!mask_any(moving))
                break;
            m->counts->skips += (uint64_t)count(mask_bits(moving));
            move(m, &f, moving);
        }
        const unsigned active = mask_bits(p->active);
        for (int l = 0; l < n; l++) {
            if (!(active >> l & 1)) {
                end_ray(m, l);
                continue;
            }
            r->meeting[r->n_meeting++] = first + l;
            r->meets_mm[first + l] = (double)p->at[l];
            for (int a = 0; a < 3; a++)
                r->meets[a][first + l] = (int)p->cell[a][l];
        }
    }
    for (int i = 0; i < PACKETS; i++) {
        m->packet[i].active = mask_of_bits(0);
        for (int l = 0; l < LANES; l++)
            m->packet[i].ray[l] = -1;
    }
}

/* Reloads lanes whose rays have ended. */
OUTLINE void refill(March *m, Lit *lit)
{
    Packet *const p = m->p;
    unsigned begun = 0;
    const unsigned active = mask_bits(p->active);
    for (int l = 0; l < LANES; l++) {
        if (active >> l & 1)
            continue;
        if (lit)
            end_pending(m, lit, l);
        end_ray(m, l);
        p->ray[l] = -1;
        if (m->next < m->rays->n_meeting) {
            begin_ray(m, l, m->rays->meeting[m->next++]);
            begun |= 1u << l;
        }
    }
    p->active |= mask_of_bits(begun);
    p->fresh &= ~mask_of_bits(begun);
}

static void march_rays(March *m, Lit *lit)
{
    bool any;
    approach(m);
    do {
        any = false;
        for (m->p = m->packet; m->p < m->packet + PACKETS; m->p++) {
            int active = count(mask_bits(m->p->active));
            if (active <= LANES * 3 / 4 && m->next < m->rays->n_meeting) {
                refill(m, lit);
                active = count(mask_bits(m->p->active));
            }
            if (!active)
                continue;
            step(m, lit);
            any = true;
        }
    } while (any);
    for (m->p = m->packet; m->p < m->packet + PACKETS; m->p++)
        refill(m, lit);
}

INLINE void march(const TiledJob *j, TiledRays *rays, TiledCounts *counts)
{
    const uint64_t begun = cts_tiled_ticks();
    March m = {.job = j, .pieces = &j->pieces, .rays = rays, .counts = counts};
    for (int a = 0; a < 3; a++) {
        const double step = j->step[a];
        m.step[a] = (real)step;
        m.inverse[a] = step != 0 ? (real)(1 / step) : 0;
        m.far[a] = step != 0 ? 0 : FAR_MM;
        m.ahead[a] = step > 0;
        m.behind[a] = m.ahead[a] - 1;
    }
    m.cell_mm = (real)(1 / fmax(fmax(fabs(j->step[0]), fabs(j->step[1])), fabs(j->step[2])));
    m.tolerance = j->tolerance;
    m.dark = j->dark;
    m.touch = j->touch;
    m.least_lit = j->least_lit;
    m.turn = j->turn;
    if (CTS_MUTATED(STOP_EARLY))
        m.dark = (real)0.25f;
    for (int i = 0; i < rays->n; i++)
        rays->rgba[i][0] = rays->rgba[i][1] = rays->rgba[i][2] = rays->lit_bound[i] = 0;
    for (int kind = 0; kind < TILED_TURNING; kind++)
        memset(rays->turned[kind], 0, (size_t)rays->n * sizeof *rays->turned[kind]);
    if (!j->shade) {
        march_rays(&m, NULL);
    } else {
        Lit lit;
        /* Largest curvature of the shading function; the highlight's is its peak times exp(-1/2) on average; the error
         * estimate of a step holds up to 3. */
        m.sharp = (real)fmaxf(1, (j->shade->diffuse + 0.607f * j->shade->specular * j->shade->exponent) / 3);
        /* Factor 4 converts to shading error; powers of 2 and more have no discontinuity of the slope. */
        m.dimmed = (real)(j->shade->occlusion *
                          (j->shade->ambient + j->shade->occlusion * j->shade->diffuse + j->shade->specular));
        m.kinked = 4 * (real)(j->shade->diffuse + j->shade->specular * fmaxf(2 - j->shade->exponent, 0));
        memset(&lit, 0, sizeof lit);
        march_rays(&m, &lit);
        light_up(&m, &lit, true);
    }
    for (int i = 0; i < rays->n; i++) {
        rays->bound[i] += rays->lit_bound[i];
        for (int kind = 0; kind < TILED_TURNING; kind++) {
            for (int c = 0; c < 3; c++)
                rays->rgba[i][c] += rays->turned[kind][i][c];
            rays->bound[i] += rays->turned[kind][i][3];
        }
        /* The remaining transmittance of a ray that ended early gets the ray's own colour. */
        const float all = 1 / (1 - rays->left[i]);
        for (int c = 0; c < 4 && rays->left[i] > 0; c++)
            rays->rgba[i][c] *= all;
    }
    counts->ticks += cts_tiled_ticks() - begun;
}
