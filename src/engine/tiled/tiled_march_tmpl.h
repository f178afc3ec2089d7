/* The march itself; see tiled_march.h, and base/simd.h for the vectors. */
#include "base/clamp.h"
#include "base/invariant.h"
#include "base/mutation.h"
#include "base/simd.h"
#include "base/simd_math_tmpl.h"
#include "engine/tiled/tiled_march.h"
#include "engine/tiled/voxel_loads_tmpl.h"
#include <math.h>

#ifdef SIMD_DOUBLE
enum { HALVINGS = 40, ROOT_STEPS = 60 };
#define ROOT_OFF ((real)1e-4)
#define MIN_STEP ((real)1e-14)
#define MIN_SHARE ((real)1e-9)
#define MIN_MM ((real)1e-11)
#define FAR_MM ((real)1e60)
#define NEARLY_1 (1 - 0x1p-52)
/* In single precision the distance of a control point from a grey level next to it has a few digits only; `rest` has
 * the others. */
#define FULL(rounded, rest) ((rounded) + (rest))
/* The double-precision march is the reference and resolves grazing contacts itself. */
#define GRAZING_ERROR(wrong) vf_of(0)
#define IS_REFERENCE true
#else
enum { HALVINGS = 3, ROOT_STEPS = 8 };
#define ROOT_OFF ((real)0.1f)
#define MIN_STEP ((real)1e-7f)
#define MIN_SHARE ((real)2e-4)
#define MIN_MM ((real)6e-5)
#define FAR_MM ((real)1e30)
#define NEARLY_1 ((real)(1 - 0x1p-23))
#define FULL(rounded, rest) (rounded)
#define GRAZING_ERROR(wrong) (wrong)
#define IS_REFERENCE false
#endif
enum { MAX_SPLITS = 12 };
/* Rounding error of levels as a share of job->grazing_tolerance. */
#define ROUNDED_BY ((real)0.003f)

typedef struct Packet {
    vf start[3];  /* of the rays, voxels */
    vf t, t_exit; /* mm from there: where they are, and where they leave the box */
    vf t_split;   /* limit of the next segment after halving */
    vf transmittance, sum[4], bound;
    vf t_half_opacity, t_first_visible; /* mm to half opacity, and to the first visible point */
    vi cell[3];
    vmask active;
    vmask after_split; /* starts at a control point, where it was just split */
    vi appearance;     /* appearance at the ray's position; the next one begins at t_label_edge, if within the cell */
    vf t_label_edge;
    int label_cell[LANES][3];   /* the cells in which boundaries of labels were computed */
    int last_appearance[LANES]; /* from t_label_edge on to the end of the cell; -1: further edges follow */
    whole ray[LANES];
    /* Low-weight segments of each lane, queued until together they are worth a gradient: colour and weight, weighted
     * centre, and in mm the begin of the first and the end of the last of them. */
    vf deferred_colour[3], deferred_weight, deferred_centre, deferred_begin, deferred_end;
} Packet;

/* Packets alternate: while one waits for voxels the processor works on the other. */
enum { PACKETS = 2 };

typedef struct March {
    const TiledJob *job;
    const TiledTransfer *transfer; /* of the lanes that are at work */
    TiledRays *rays;
    TiledCounts *counts;
    int next; /* ray */
    real step[3], inverse[3], far[3], cell_mm, tolerance, min_transmittance, grazing_tolerance, min_shaded_weight,
        shading_tolerance, highlight_curvature, slope_discontinuity, occlusion_sensitivity;
    whole ahead[3], behind[3];
    Packet packet[PACKETS], *p; /* the current packet */
} March;

/* The field along a segment as a cubic, by its Bernstein coefficients. */
typedef struct Cubic {
    vf b[4];
} Cubic;

/* Mean of the field over the segment. */
INLINE vf mean_of_cubic(const Cubic *c)
{
    return (real)0.25f * (c->b[0] + c->b[1] + c->b[2] + c->b[3]);
}

INLINE int count(unsigned bits)
{
    return __builtin_popcount(bits);
}

/* Distances to the next faces: of the rays' cells, or of the empty space to be skipped. */
typedef struct Faces {
    vmask skipping, visible;
    vi face[3];
    vf t[3], nearest; /* mm */
} Faces;

/* The surroundings of rays: a visible cell, an invisible one, an invisible octant of 2^3 cells, half of a block, or a
 * number of blocks. */
INLINE Faces find_faces(const March *m)
{
    const Packet *const p = m->p;
    Faces f;
    const vi found = load_words(&m->job->mask, p->cell, p->active);
    const vmask in_visible_block = vi_eq(found, vi_of(0)) | vu_lt(vi_of(TILED_FAR), found);
    const vi word = m->job->whole_blocks ? vi_select(in_visible_block, vi_of(-1), found) : found;
    const vmask has_mask = vu_lt(vi_of(TILED_FAR), word), far = ~has_mask & vi_lt(vi_of(0), word);
    const vi octant = (p->cell[0] & 2) | (p->cell[1] & 2) << 2, in_octant = (p->cell[0] & 1) | (p->cell[1] & 1) << 2;
    f.visible = p->active & has_mask & vi_test(word, vi_of(1) << (octant | in_octant | (p->cell[2] & 1) << 4));
    f.skipping = p->active & ~(has_mask & vi_test(word, vi_of(0x330033) << octant));
    const vi distance = vi_select(far, word, vi_of(1)) - (CTS_MUTATED(SKIP_TOO_FAR) ? -1 : 0);
    const vi across = vi_select(has_mask, vi_of(1), vi_of(2)), up = vi_select(far, vi_of(2), vi_of(1));
    for (int a = 0; a < 3; a++) {
        const vi size = a < 2 ? across : up, past = ((p->cell[a] >> size) + (m->ahead[a] ? distance : 1 - distance))
                                                    << size;
        f.face[a] = vi_select(f.skipping, past, p->cell[a] + m->ahead[a]);
        f.t[a] = (to_float(f.face[a]) - p->start[a]) * m->inverse[a] + m->far[a];
    }
    f.nearest = vf_max(vf_min(vf_min(f.t[0], f.t[1]), f.t[2]), p->t);
    return f;
}

/* Advances rays to the nearest face, and into the cell behind it. */
INLINE void advance(March *m, const Faces *f, vmask moving)
{
    Packet *const p = m->p;
    const bool skips = mask_any(f->skipping);
    vmask outside = vf_le(p->t_exit, f->nearest);
    for (int a = 0; a < 3; a++) {
        const vi last = vi_of(m->job->n_cells[a] - 1);
        vi cell = p->cell[a];
        if (skips) {
            const vi there = to_int(p->start[a] + f->nearest * m->step[a]);
            const vi on = m->ahead[a] ? vi_min(vi_max(there, cell), last) : vi_max(vi_min(there, cell), vi_of(0));
            cell = vi_select(f->skipping, on, cell);
        }
        cell = vi_select(moving & vf_le(f->t[a], f->nearest), f->face[a] + m->behind[a], cell);
        outside |= vu_lt(last, cell);
        p->cell[a] = cell;
    }
    p->t = vf_select(moving, f->nearest, p->t);
    p->active &= ~(moving & outside);
}

/* c[0] + c[1] s + c[2] s^2 + c[3] s^3 */
typedef struct Polynomial {
    vf c[4];
} Polynomial;

/* A trilinear field along a ray through its cell, from `at` over `displacement`: F = f + x fx + y fy + z fz + xy fxy +
 * xz fxz + yz fyz + xyz fxyz about the entry point. low, rise: at the corners of x = 0, and to x = 1. */
INLINE Polynomial trilinear_along(const vf low[4], const vf rise[4], const vf at[3], const vf displacement[3])
{
    /* First about the cell's origin. */
    const vf y = low[1] - low[0], z = low[2] - low[0], xy = rise[1] - rise[0], xz = rise[2] - rise[0];
    const vf yz = low[3] - low[2] - y, xyz = rise[3] - rise[2] - xy;
    const vf fxy = xy + at[2] * xyz, fxz = xz + at[1] * xyz, fyz = yz + at[0] * xyz, fy0 = y + at[0] * xy;
    const vf fx = rise[0] + at[1] * xy + at[2] * fxz, fy = fy0 + at[2] * fyz, fz = z + at[0] * xz + at[1] * fyz;
    const vf displacement_yz = displacement[1] * displacement[2];
    return (Polynomial){{low[0] + at[0] * rise[0] + at[1] * fy0 + at[2] * fz,
                         displacement[0] * fx + displacement[1] * fy + displacement[2] * fz,
                         displacement[0] * (displacement[1] * fxy + displacement[2] * fxz) + displacement_yz * fyz,
                         displacement[0] * displacement_yz * xyz}};
}

INLINE vf polynomial_at(const Polynomial *p, vf s)
{
    return ((p->c[3] * s + p->c[2]) * s + p->c[1]) * s + p->c[0];
}

/* The field from p->t over `length` mm within the cell. */
INLINE Cubic load_cubic(const March *m, vmask lanes, vf length)
{
    const Packet *const p = m->p;
    const real third = (real)(1 / 3.0);
    vi pair[4];
    vf at[3], displacement[3], low[4], rise[4];
    load_pairs(m->job, p->cell, lanes, pair);
    for (int a = 0; a < 3; a++) {
        at[a] = p->start[a] - to_float(p->cell[a]) + p->t * m->step[a];
        displacement[a] = length * m->step[a];
    }
    for (int i = 0; i < 4; i++) {
        low[i] = to_float(lower_half(pair[i]));
        rise[i] = to_float(upper_half(pair[i])) - low[i];
    }
    const Polynomial f = trilinear_along(low, rise, at, displacement);
    const vf c1 = third * f.c[1], c2 = third * f.c[2];
    const vf b1 = f.c[0] + c1, b2 = b1 + c1 + c2;
    return (Cubic){{f.c[0], b1, b2, b2 + c1 + 2 * c2 + f.c[3]}};
}

/* The transfer function at a level. */
typedef struct TransferSample {
    vf extinction;                       /* per mm, to the base of 2 */
    vf opacity, slope, max_colour_slope; /* slopes: of opacity, and of the colour that changes most */
    vf rgb[3];
} TransferSample;

INLINE real control_point_of(const TiledTransfer *t, int k)
{
    return FULL((real)t->end[1][k], (real)t->remainder[1][k]);
}

INLINE vf end_of(const TiledTransfer *t, int end, vi q)
{
    const int n = t->n_control_points + 1;
    return FULL(vf_look_up(t->end[end], n, q), vf_look_up(t->remainder[end], n, q));
}

INLINE vi find_transfer_segment(const TiledTransfer *t, vf level)
{
    vi q = vi_of(0);
    if (t->n_control_points <= 16) {
        for (int k = 0; k < t->n_control_points; k++)
            q = vi_select(vf_le(vf_of(control_point_of(t, k)), level), vi_of(k + 1), q);
        return q;
    }
    int bit = 1;
    while (2 * bit <= t->n_control_points)
        bit *= 2;
    for (; bit > 0; bit /= 2) {
        const vi on = vi_min(q + bit, vi_of(t->n_control_points));
        q = vi_select(vf_le(end_of(t, 0, on), level), on, q);
    }
    return q;
}

/* At a level in linear segment q of the transfer function, or in the adjacent one if the control point between was not
 * worth a split. */
INLINE TransferSample evaluate_transfer(const TiledTransfer *t, vi q, vf level)
{
    const int n = t->n_control_points + 1;
    q = vi_select(vf_lt(level, end_of(t, 0, q)), q - 1, vi_select(vf_le(end_of(t, 1, q), level), q + 1, q));
    const vf above = level - end_of(t, 0, q), opaque = vf_of(NEARLY_1), most = vf_of((real)t->max_extinction);
    TransferSample l = {.slope = vf_look_up(t->slope[0], n, q),
                        .max_colour_slope = vf_look_up(t->max_colour_slope, n, q)};
    l.opacity = vf_max(vf_look_up(t->value[0], n, q) + l.slope * above, vf_of(0));
    const vf by_log = -(real)t->by_log2 * vf_log2_transmittance(vf_min(l.opacity, opaque));
    l.extinction = vf_select(vf_lt(opaque, l.opacity), most, vf_min(by_log, most));
    for (int c = 0; c < 3; c++)
        l.rgb[c] = vf_look_up(t->value[c + 1], n, q) + vf_look_up(t->slope[c + 1], n, q) * above;
    return l;
}

/* Control points at which segments are to be split. */
typedef struct Splits {
    int n;
    vf control_point[MAX_SPLITS], discontinuity[MAX_SPLITS], slope_change[MAX_SPLITS];
    vmask lanes[MAX_SPLITS], all;
    vf wrong;    /* error by control points without a split, */
    vf passed;   /* the part of those that the field does cross */
    vmask halve; /* segments that cross too many control points, or with too large an effect */
} Splits;

/* Overshoot from which a field crosses a control point, as a share of the grazing tolerance: three times the rounding
 * error of its control values. */
#define CROSSES_FROM ((real)0.04f)
/* Of each of the four polynomials of a cubic, over the segment. */
#define BERNSTEIN_INTEGRAL ((real)0.25f)

/* Adds the last control point of the list as a split candidate: the field overshoots it by `over` in total, and by
 * `inside` without its start. Lanes are split if it is worth it; else its effect counts as error. */
INLINE void add_split_candidate(const March *m, Splits *splits, vmask lanes, vf over, vf inside, vf weight)
{
    const int i = splits->n;
    const vf tolerance = vf_of(m->grazing_tolerance);
    const vmask passes = lanes & vf_lt(CROSSES_FROM * tolerance, over),
                near = passes | (lanes & vf_lt(-tolerance, inside));
    const vf worth =
        weight * (splits->discontinuity[i] + BERNSTEIN_INTEGRAL * splits->slope_change[i] * vf_max(over, tolerance));
    const vmask split = CTS_MUTATED(SPLITS) ? mask_of_bits(0) : passes & vf_lt(vf_of(m->tolerance), worth);
    splits->wrong += vf_select(near & ~split, worth, vf_of(0));
    splits->passed += vf_select(passes & ~split, worth, vf_of(0));
    splits->lanes[i] = split;
    splits->all |= split;
}

/* Split candidates: the control points at both ends of the linear segment q in which the middle of each lane's field
 * lies, and further ones in reach. */
INLINE Splits find_splits(const March *m, const Cubic *c, vi q, vmask lanes, vf length)
{
    const TiledTransfer *const t = m->transfer;
    const int n = t->n_control_points + 1;
    const vf *const b = c->b, weight = length * m->p->transmittance;
    vf inside[2] = {vf_min(vf_min(b[1], b[2]), b[3]), vf_max(vf_max(b[1], b[2]), b[3])};
    const vf range[2] = {vf_min(inside[0], b[0]), vf_max(inside[1], b[0])};
    /* A segment that starts at a control point touches it there, which does not count. */
    for (int end = 0; end < 2; end++)
        inside[end] = vf_select(m->p->after_split, inside[end], range[end]);
    Splits splits = {.n = 0, .wrong = vf_of(0), .passed = vf_of(0), .all = mask_of_bits(0), .halve = mask_of_bits(0)};
    for (int away = 0;; away++) {
        const vi at[2] = {vi_max(q - away, vi_of(0)), vi_min(q + away, vi_of(n - 1))};
        for (int end = 0; end < (CTS_MUTATED(CONTROL_POINT_OFF) ? 1 : 2); end++, splits.n++) {
            const vf control_point = splits.control_point[splits.n] = end_of(t, end, at[end]);
            splits.discontinuity[splits.n] = vf_look_up(t->discontinuity[end], n, at[end]);
            splits.slope_change[splits.n] = vf_look_up(t->slope_change[end], n, at[end]);
            add_split_candidate(m, &splits, lanes, end ? range[1] - control_point : control_point - range[0],
                                end ? inside[1] - control_point : control_point - inside[0], weight);
        }
        const vmask more = lanes & (vf_lt(range[0] - m->grazing_tolerance, vf_look_up(t->beyond[0], n, at[0])) |
                                    vf_lt(vf_look_up(t->beyond[1], n, at[1]), range[1] + m->grazing_tolerance));
        if (!mask_any(more))
            break;
        if (splits.n + 2 > MAX_SPLITS) {
            splits.halve = more;
            break;
        }
        lanes = more; /* a lane's result must not depend on the others */
    }
    splits.halve |= CTS_MUTATED(SPLITS) ? mask_of_bits(0) : vf_lt(vf_of(m->tolerance), splits.passed) & ~splits.all;
    splits.wrong = vf_min(2 * splits.wrong, m->p->transmittance);
    return splits;
}

INLINE vmask differ(vmask a, vmask b)
{
    return (a & ~b) | (b & ~a);
}

/* Segments that may cross a control point more than once, by the sign changes of their coefficients. */
INLINE vmask crosses_again(const Cubic *c, const Splits *splits)
{
    vmask again = mask_of_bits(0);
    for (int i = 0; i < splits->n; i++) {
        vmask below[4], change[3];
        for (int k = 0; k < 4; k++)
            below[k] = vf_lt(c->b[k], splits->control_point[i]);
        for (int k = 0; k < 3; k++)
            change[k] = differ(below[k], below[k + 1]);
        again |= splits->lanes[i] & ((change[0] & change[1]) | (change[1] & change[2]) | (change[0] & change[2]));
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
 * *wrong: error estimate, from the last step and the rounding of the cubic, times discontinuity, and slope_change times
 * the remaining overshoot. */
INLINE vf find_root(const March *m, const vf c[4], const vf b[4], vf discontinuity, vf slope_change, vmask lanes,
                    vf *wrong)
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
                 off = vf_min(step, high - low) + ROUNDED_BY * m->grazing_tolerance * by_slope;
        const vmask within = vf_le(low, to) & vf_le(to, high);
        s = vf_select(lanes, vf_select(within, to, (real)0.5f * (low + high)), s);
        *wrong = vf_select(lanes, off * (discontinuity + slope_change * vf_abs(f)), *wrong);
        lanes &= vf_lt(vf_of(ROOT_OFF * m->tolerance), *wrong) & vf_lt(vf_of(MIN_STEP), step);
    }
    return s;
}

/* Shortens each segment to its first crossing of a control point. Returns the lanes that were shortened. */
OUTLINE vmask split_at_control_points(const March *m, Cubic *c, vf *length, Splits *splits, vmask *at_control_point)
{
    vmask shorter = mask_of_bits(0);
    for (int i = 0;; i++) {
        const vmask again = crosses_again(c, splits) & vf_lt(vf_of(MIN_MM), *length);
        if (!mask_any(again))
            break;
        if (i == HALVINGS) { /* it may be a grazing contact only */
            splits->wrong += vf_select(again, m->p->transmittance, vf_of(0));
            break;
        }
        halve(c, length, again);
        shorter |= again;
    }
    const vf *const b = c->b;
    vf power[4] = {b[0], 3 * (b[1] - b[0]), 3 * (b[0] - 2 * b[1] + b[2]), b[3] - b[0] + 3 * (b[1] - b[2])};
    /* A field meets first, of the levels between its ends, the one nearest to where it starts. */
    vmask crosses = mask_of_bits(0);
    vf control_point = vf_of(0), discontinuity = vf_of(0), slope_change = vf_of(0), away = vf_of(FAR_MM);
    for (int i = 0; i < splits->n; i++) {
        const vf other = splits->control_point[i], other_away = vf_abs(other - b[0]);
        const vmask between = splits->lanes[i] & differ(vf_lt(b[0], other), vf_lt(b[3], other));
        const vmask nearer = between & vf_lt(other_away, away);
        control_point = vf_select(nearer, other, control_point);
        away = vf_select(nearer, other_away, away);
        discontinuity = vf_select(nearer, splits->discontinuity[i], discontinuity);
        slope_change = vf_select(nearer, splits->slope_change[i], slope_change);
        crosses |= between;
    }
    vf wrong;
    const vf weight = m->p->transmittance * *length;
    const vf least = vf_max(vf_of(MIN_SHARE), MIN_MM / vf_max(*length, vf_of((real)1e-9f)));
    const vf shifted[4] = {power[0] - control_point, power[1], power[2], power[3]};
    const vf above[4] = {shifted[0], b[1] - control_point, b[2] - control_point, b[3] - control_point};
    const vf at = find_root(m, shifted, above, weight * discontinuity, weight * slope_change, crosses, &wrong);
    vf root = vf_select(crosses, vf_min(vf_max(at, least), vf_of(1)), vf_of(1));
    splits->wrong += vf_min(wrong, m->p->transmittance);
    *at_control_point = vf_lt(root, vf_of(1 - MIN_SHARE));
    root = vf_select(*at_control_point, root, vf_of(1));
    const vf p1 = power[1] * root, p2 = power[2] * root * root, p3 = power[3] * root * root * root;
    c->b[1] = vf_select(*at_control_point, power[0] + (real)(1 / 3.0) * p1, b[1]);
    c->b[2] = vf_select(*at_control_point, power[0] + (real)(2 / 3.0) * p1 + (real)(1 / 3.0) * p2, b[2]);
    c->b[3] = vf_select(*at_control_point, power[0] + p1 + p2 + p3, b[3]);
    *length *= root;
    return shorter | *at_control_point;
}

#define GAUSS_A ((real)0.490562612)
#define GAUSS_B ((real)0.394337567)
#define GAUSS_C ((real)0.105662433)
#define GAUSS_D ((real)0.009437388)

/* Integral over a segment. */
typedef struct SegmentIntegral {
    TransferSample at[2];
    vf depth[2], opacity[2], wrong; /* opacity: of each half */
} SegmentIntegral;

INLINE SegmentIntegral integrate(const March *m, const Cubic *c, vi q, vf length)
{
    const TiledTransfer *const t = m->transfer;
    const vf *const b = c->b;
    const vf half = (real)0.5f * length;
    const vf first = GAUSS_A * b[0] + GAUSS_B * b[1] + GAUSS_C * b[2] + GAUSS_D * b[3];
    const vf second = GAUSS_D * b[0] + GAUSS_C * b[1] + GAUSS_B * b[2] + GAUSS_A * b[3];
    SegmentIntegral e;
    e.at[0] = evaluate_transfer(t, q, first);
    e.at[1] = CTS_MUTATED(GAUSS) ? e.at[0] : evaluate_transfer(t, q, second);
    vf apart = vf_of(0);
    for (int i = 0; i < 2; i++) {
        e.depth[i] = e.at[i].extinction * half;
        e.opacity[i] = vf_opacity(e.depth[i]);
    }
    for (int k = 0; k < 3; k++)
        apart = vf_max(apart, vf_abs(e.at[0].rgb[k] - e.at[1].rgb[k]));
    /* Of a linear field the first term is nearly all; another one may have equal colours at both points, but not at its
     * start, the only visible part of an opaque segment. */
    apart = vf_max((real)1.73f * apart, 4 * e.at[0].max_colour_slope * vf_abs(first - b[0]));
    const vf depth = (real)M_LN2 * (e.depth[0] + e.depth[1]);
    const real by_log = (real)t->by_log2, unit = (real)M_LN2 / by_log;
    const vf change = unit * (e.at[0].extinction - e.at[1].extinction), change2 = change * change;
    /* Curvature of the logarithm's argument: effect of its second derivative alone, and combined with the slope. */
    const vf bent = vf_max(vf_abs(b[0] - 2 * b[1] + b[2]), vf_abs(b[1] - 2 * b[2] + b[3]));
    const vf clear = 1 - vf_min(vf_max(e.at[0].opacity, e.at[1].opacity), vf_of((real)0.999f));
    const vf slope_change = 6 * bent * vf_max(vf_abs(e.at[0].slope), vf_abs(e.at[1].slope)) / clear;
    /* Error of the mean extinction, relative to by_log2. */
    const vf off = (real)0.0375f * change2 * change2 +
                   slope_change * ((real)(1 / 1440.0) * slope_change + (real)(1 / 120.0) * change2);
    e.wrong = m->p->transmittance * (by_log * length * off * (1 - e.opacity[0]) +
                                     apart * vf_min(vf_of((real)0.25f), (real)0.0112f * depth * depth));
    return e;
}

/* Position of half opacity, in lanes whose segment contains it. */
OUTLINE void find_surface(Packet *p, const SegmentIntegral *e, vf length, vmask lanes)
{
    const vf before = p->transmittance, between = before - before * e->opacity[0],
             after = between - between * e->opacity[1];
    const vf half = (real)0.5f * length, gone = vf_of((real)0.5f);
    const vmask absorbs = lanes & vf_lt(after, before);
    p->t_first_visible = vf_select(absorbs & vf_le(vf_of(FAR_MM), p->t_first_visible), p->t, p->t_first_visible);
    const vmask first = vf_le(between, gone);
    const vf from = vf_select(first, before, between), depth = vf_select(first, e->depth[0], e->depth[1]);
    const vf share = (vf_log2(from) + 1) / vf_max(depth, vf_of((real)1e-9f));
    const vf mm = p->t + half * (vf_min(share, vf_of(1)) + vf_select(first, vf_of(0), vf_of(1)));
    p->t_half_opacity = vf_select(absorbs & vf_lt(gone, before) & vf_le(after, gone), mm, p->t_half_opacity);
}

#include "engine/tiled/shading_tmpl.h"

#include "engine/tiled/label_edges_tmpl.h"

/* Invariants of the lanes that integrate a segment, and of the segment. NaN fails each of them. */
INLINE void check_segment(const March *m, vmask lanes, vf length, vf error)
{
    const Packet *const p = m->p;
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), p->transmittance) & vf_le(p->transmittance, vf_of(1)))));
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), length) & vf_le(p->t, p->t_exit))));
    CTS_INVARIANT(!mask_any(lanes & ~(vf_le(vf_of(0), error) & vf_le(vf_of(0), p->bound))));
    for (int a = 0; a < 3; a++)
        CTS_INVARIANT(!mask_any(lanes & vu_lt(vi_of(m->job->n_cells[a] - 1), p->cell[a])));
}

/* Integrates a segment of rays in visible cells. Returns the lanes that stay in their cell. */
INLINE vmask integrate_segment(March *m, ShadingQueues *queues, vmask lanes, vf leave)
{
    const TiledJob *const j = m->job;
    Packet *const p = m->p;
    const vf all = vf_min(leave, p->t_exit), to = vf_min(all, vf_min(p->t_split, p->t_label_edge));
    vf length = to - p->t;
    Cubic cubic = load_cubic(m, lanes, length);
    vi q = find_transfer_segment(m->transfer, mean_of_cubic(&cubic));
    Splits splits = find_splits(m, &cubic, q, lanes, length);
    vmask shorter = vf_lt(to, all), after_split = mask_of_bits(0);
    if (mask_any(splits.all)) {
        shorter |= split_at_control_points(m, &cubic, &length, &splits, &after_split);
        q = find_transfer_segment(m->transfer, mean_of_cubic(&cubic));
    }
    const SegmentIntegral e = integrate(m, &cubic, q, length);
    if (CTS_INVARIANTS)
        check_segment(m, lanes, length, GRAZING_ERROR(splits.wrong) + e.wrong);
    const vmask wrong = CTS_MUTATED(HALVES) ? mask_of_bits(0) : vf_lt(vf_of(m->tolerance), e.wrong) | splits.halve;
    const vmask again = lanes & wrong & vf_lt(vf_of(2 * MIN_MM), length);
    const vmask done = lanes & ~again;
    p->t_split = vf_select(again, p->t + (real)0.5f * length, vf_select(done, vf_of(FAR_MM), p->t_split));
    if (j->want_depth)
        find_surface(p, &e, length, done);
    const vf first = p->transmittance * e.opacity[0], between = p->transmittance - first,
             second = between * e.opacity[1];
    const vf weight[2] = {vf_select(done, first, vf_of(0)), vf_select(done, second, vf_of(0))};
    vf colour[3];
    for (int c = 0; c < 3; c++)
        colour[c] = weight[0] * e.at[0].rgb[c] + weight[1] * e.at[1].rgb[c];
    if (queues)
        queue_for_shading(m, queues, &e, weight, colour, length, done);
    else
        for (int c = 0; c < 3; c++)
            p->sum[c] += colour[c];
    p->sum[3] += weight[0] + weight[1];
    p->transmittance = CTS_MUTATED(ATTENUATION) ? p->transmittance : p->transmittance - weight[0] - weight[1];
    p->bound += vf_select(done, GRAZING_ERROR(splits.wrong) + e.wrong, vf_of(0));
    p->t = vf_select(done & shorter, p->t + length, p->t);
    p->after_split = (p->after_split & ~done) | (done & after_split);
    p->active &= ~(done & (vf_le(p->t_exit, p->t) | vf_lt(p->transmittance, vf_of(m->min_transmittance))));
    return again | (done & shorter);
}

/* The same for each appearance among the lanes, one after the other. */
OUTLINE vmask integrate_segments(March *m, ShadingQueues *queues, vmask lanes, vf leave)
{
    vmask stay = mask_of_bits(0);
    find_appearances(m, lanes);
    for (unsigned left = mask_bits(lanes); left;) {
        const vmask alike = same_appearance_as_first(m, left);
        m->transfer = &m->job->appearances->transfer[m->p->appearance[__builtin_ctz(left)]];
        stay |= integrate_segment(m, queues, alike, leave);
        left &= ~mask_bits(alike);
    }
    return stay;
}

/* Evaluating a segment costs several times a step of empty-space skipping, so lanes wait until most of them are in
 * visible cells. */
INLINE void step(March *m, ShadingQueues *queues)
{
    const Faces f = find_faces(m);
    const int showing = count(mask_bits(f.visible)), all = count(mask_bits(m->p->active));
    vmask stay = f.visible;
    if (4 * showing >= 3 * all) {
        m->counts->segments += (uint64_t)showing;
        stay = m->job->appearances ? integrate_segments(m, queues, f.visible, f.nearest)
                                   : integrate_segment(m, queues, f.visible, f.nearest);
    }
    m->counts->skips += (uint64_t)(all - showing);
    advance(m, &f, m->p->active & ~stay);
}

/* Store the result of a finished ray. */
INLINE void end_ray(const March *m, int lane)
{
    const Packet *const p = m->p;
    const int i = (int)p->ray[lane];
    if (i < 0)
        return;
    for (int c = 0; c < 3; c++)
        m->rays->rgba[i][c] = (float)p->sum[c][lane];
    m->rays->rgba[i][3] = (float)p->sum[3][lane];
    m->rays->left[i] = p->transmittance[lane] < m->min_transmittance ? (float)p->transmittance[lane] : 0;
    m->rays->bound[i] = (float)p->bound[lane] + m->rays->left[i] * m->job->max_colour_difference;
    if (m->job->want_depth) {
        const real mm = p->t_half_opacity[lane] < FAR_MM ? p->t_half_opacity[lane] : p->t_first_visible[lane];
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
        p->cell[a][lane] = r->hit_cell[a][i];
    }
    p->t[lane] = (real)r->hit_mm[i];
    p->t_exit[lane] = (real)r->length_mm[i];
    p->t_split[lane] = p->t_label_edge[lane] = p->t_half_opacity[lane] = p->t_first_visible[lane] = FAR_MM;
    p->label_cell[lane][0] = -1;
    p->transmittance[lane] = 1;
    p->sum[0][lane] = p->sum[1][lane] = p->sum[2][lane] = p->sum[3][lane] = p->bound[lane] = 0;
}

/* Advances neighbouring rays together to their first visible cells. */
OUTLINE void skip_to_first_hit(March *m)
{
    Packet *const p = m->p = m->packet;
    TiledRays *const r = m->rays;
    r->n_hits = 0;
    for (int first = 0; first < r->n; first += LANES) {
        const int n = r->n - first < LANES ? r->n - first : LANES;
        for (int l = 0; l < n; l++) {
            for (int a = 0; a < 3; a++) {
                const int last = m->job->n_cells[a] - 1, cell = (int)r->start_vox[a][first + l];
                r->hit_cell[a][first + l] = cell < last ? cell : last;
            }
            r->hit_mm[first + l] = 0;
            begin_ray(m, l, first + l);
        }
        p->active = mask_of_bits((1u << n) - 1);
        for (;;) {
            const Faces f = find_faces(m);
            const vmask moving = p->active & ~f.visible;
            if (!mask_any(moving))
                break;
            m->counts->skips += (uint64_t)count(mask_bits(moving));
            advance(m, &f, moving);
        }
        const unsigned active = mask_bits(p->active);
        for (int l = 0; l < n; l++) {
            if (!(active >> l & 1)) {
                end_ray(m, l);
                continue;
            }
            r->hits[r->n_hits++] = first + l;
            r->hit_mm[first + l] = (double)p->t[l];
            for (int a = 0; a < 3; a++)
                r->hit_cell[a][first + l] = (int)p->cell[a][l];
        }
    }
    for (int i = 0; i < PACKETS; i++) {
        m->packet[i].active = mask_of_bits(0);
        for (int l = 0; l < LANES; l++)
            m->packet[i].ray[l] = -1;
    }
}

/* Reloads lanes whose rays have ended. */
OUTLINE void reload_lanes(March *m, ShadingQueues *queues)
{
    Packet *const p = m->p;
    unsigned begun = 0;
    const unsigned active = mask_bits(p->active);
    if (queues)
        flush_deferred(m, queues, ~p->active);
    for (int l = 0; l < LANES; l++) {
        if (active >> l & 1)
            continue;
        end_ray(m, l);
        p->ray[l] = -1;
        if (m->next < m->rays->n_hits) {
            begin_ray(m, l, m->rays->hits[m->next++]);
            begun |= 1u << l;
        }
    }
    p->active |= mask_of_bits(begun);
    p->after_split &= ~mask_of_bits(begun);
}

static void march_rays(March *m, ShadingQueues *queues)
{
    bool any;
    skip_to_first_hit(m);
    do {
        any = false;
        for (m->p = m->packet; m->p < m->packet + PACKETS; m->p++) {
            int active = count(mask_bits(m->p->active));
            if (active <= LANES * 3 / 4 && m->next < m->rays->n_hits) {
                reload_lanes(m, queues);
                active = count(mask_bits(m->p->active));
            }
            if (!active)
                continue;
            step(m, queues);
            any = true;
        }
    } while (any);
    for (m->p = m->packet; m->p < m->packet + PACKETS; m->p++)
        reload_lanes(m, queues);
}

INLINE void march(const TiledJob *j, TiledRays *rays, TiledCounts *counts)
{
    const uint64_t begun = cts_tiled_ticks();
    March m = {.job = j, .transfer = &j->transfer, .rays = rays, .counts = counts};
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
    m.min_transmittance = j->min_transmittance;
    m.grazing_tolerance = j->grazing_tolerance;
    m.min_shaded_weight = j->min_shaded_weight;
    m.shading_tolerance = j->shading_tolerance;
    if (CTS_MUTATED(STOP_EARLY))
        m.min_transmittance = (real)0.25f;
    if (!j->shade) {
        march_rays(&m, NULL);
    } else {
        ShadingQueues queues;
        /* Largest curvature of the shading function; the highlight's is its peak times exp(-1/2) on average; the error
         * estimate of a step holds up to 3. */
        m.highlight_curvature =
            (real)fmaxf(1, (j->shade->diffuse + 0.607f * j->shade->specular * j->shade->exponent) / 3);
        /* Factor 4 converts to shading error; powers of 2 and more have no discontinuity of the slope. */
        m.occlusion_sensitivity =
            (real)(j->shade->occlusion *
                   (j->shade->ambient + j->shade->occlusion * j->shade->diffuse + j->shade->specular));
        m.slope_discontinuity = 4 * (real)(j->shade->diffuse + j->shade->specular * fmaxf(2 - j->shade->exponent, 0));
        memset(&queues, 0, sizeof queues);
        for (int i = 0; i < rays->n; i++)
            for (int a = 0; a < 3; a++)
                queues.start[a][i] = (real)rays->start_vox[a][i];
        for (int i = 0; i < TILED_SHADING_QUEUES; i++)
            memset(rays->light[i], 0, (size_t)rays->n * sizeof *rays->light[i]);
        march_rays(&m, &queues);
        shade_queued(&m, &queues, true);
    }
    for (int i = 0; i < rays->n; i++) {
        for (int queue = 0; j->shade && queue < TILED_SHADING_QUEUES; queue++) {
            for (int c = 0; c < 3; c++)
                rays->rgba[i][c] += rays->light[queue][i][c];
            rays->bound[i] += rays->light[queue][i][3];
        }
        /* The remaining transmittance of a ray that ended early gets the ray's own colour. */
        const float all = 1 / (1 - rays->left[i]);
        for (int c = 0; c < 4 && rays->left[i] > 0; c++)
            rays->rgba[i][c] *= all;
    }
    counts->ticks += cts_tiled_ticks() - begun;
}
