/* Beams: which slabs a bundle of rays must march through. */
#include "engine/tiled/march.h"

#include "base/mutation.h"
#include <math.h>

enum { MOST_AT_ONCE = 3 };
_Static_assert((1 + MOST_AT_ONCE) * CTS_FINE_MACROCELL <= CTS_RUN_SLABS, "a run holds that many slabs");

static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

static double slab_face(const double at[3], double u, double v)
{
    return at[0] + at[1] * u + at[2] * v;
}

void cts_tiled_clip(const TiledJob *j, double u, double v, double *enter, double *leave)
{
    const double at[2] = {u, v}, step[2] = {j->u_at[3], j->v_at[3]}, size[2] = {j->nu - 1, j->nv - 1};
    *enter = larger(0, slab_face(j->near_at, u, v));
    *leave = smaller(j->nk - 1, slab_face(j->far_at, u, v));
    for (int c = 0; c < 2; c++) {
        if (step[c] == 0) {
            /* A hair's breadth of rounding must not lose a face that a ray runs along. */
            const double hair = 1e-9 * (1 + size[c]);
            if (at[c] < -hair || at[c] > size[c] + hair)
                *leave = -1;
            continue;
        }
        const double a = (0 - at[c]) / step[c], b = (size[c] - at[c]) / step[c];
        *enter = larger(*enter, smaller(a, b));
        *leave = smaller(*leave, larger(a, b));
    }
}

/* Layers for which [low, high] + step * q, one coordinate of a beam, stays inside the macro-cells b0 - (n - 1) to
 * b1 + (n - 1); beyond the volume's ends there is nothing to stay inside of. */
static double room(const double at[2], double step, int b0, int b1, int n, int n_macrocells)
{
    if (step > 0)
        return b1 + n >= n_macrocells ? INFINITY : ((b1 + n) * CTS_MACROCELL - at[1]) / step;
    if (step < 0)
        return b0 - (n - 1) <= 0 ? INFINITY : (at[0] - (b0 - (n - 1)) * CTS_MACROCELL) / -step;
    return INFINITY;
}

static int macrocell_of(double at, int n_macrocells)
{
    const int b = at > 0 ? (int)(at * (1.0 / CTS_MACROCELL)) : 0;
    return b < n_macrocells ? b : n_macrocells - 1;
}

/* How many layers rays that meet layer q between (u[0], v[0]) and (u[1], v[1]) may skip. 0: something may be visible,
 * or the next macro-cell is too near; *until is then the layer up to which to march before asking again. */
static int skip_from(const TiledJob *j, const double u[2], const double v[2], int q, int *until)
{
    const CtsEmptySpace *empty = &j->empty;
    const int bu0 = macrocell_of(u[0], empty->nu), bu1 = macrocell_of(u[1], empty->nu);
    const int bv0 = macrocell_of(v[0], empty->nv), bv1 = macrocell_of(v[1], empty->nv);
    const unsigned cell = (unsigned)(j->rising ? q : j->nk - 2 - q);
    const int rest = (int)(j->rising ? CTS_MACROCELL - cell % CTS_MACROCELL : cell % CTS_MACROCELL + 1);
    const uint8_t *d = empty->distance + (ptrdiff_t)(cell / CTS_MACROCELL) * empty->nu * empty->nv;
    int n = 255;
    for (int bv = bv0; bv <= bv1; bv++)
        for (int bu = bu0; bu <= bu1; bu++) {
            const int here = d[bv * empty->nu + bu];
            n = here < n ? here : n;
        }
    *until = q + rest;
    if (n == 0)
        return 0;
    const double most =
        smaller(rest + CTS_MACROCELL * (n - !CTS_MUTATED(LEAP_FAR)),
                smaller(room(u, j->u_at[3], bu0, bu1, n, empty->nu), room(v, j->v_at[3], bv0, bv1, n, empty->nv)));
    if (most < 1) {
        *until = q + 1;
        return 0;
    }
    return (int)most;
}

/* One coordinate's part of the bounds: each face's entry is linear in x and y, so its extremes are at the corners. */
static bool bound(const TiledJob *j, const double at[4], double size, const int corner[4][2], double range[2],
                  double in_out[4])
{
    double in_min = INFINITY, out_max = -INFINITY;
    range[0] = INFINITY;
    range[1] = -INFINITY;
    (void)j;
    for (int i = 0; i < 4; i++) {
        const double here = at[0] + at[1] * corner[i][0] + at[2] * corner[i][1];
        range[0] = smaller(range[0], here);
        range[1] = larger(range[1], here);
        if (at[3] == 0)
            continue;
        const double a = (0 - here) / at[3], b = (size - here) / at[3];
        in_min = smaller(in_min, smaller(a, b));
        out_max = larger(out_max, larger(a, b));
        in_out[2] = larger(in_out[2], smaller(a, b));
        in_out[3] = smaller(in_out[3], larger(a, b));
    }
    if (at[3] != 0) {
        in_out[0] = larger(in_out[0], in_min);
        in_out[1] = smaller(in_out[1], out_max);
        return true;
    }
    const double hair = 1e-9 * (1 + size);
    if (range[0] < 0 || range[1] > size)
        in_out[3] = -1;
    return range[1] >= -hair && range[0] <= size + hair;
}

/* The slab's part of the bounds. */
static void bound_slab(const TiledJob *j, const int corner[4][2], double in_out[4])
{
    double in_min = INFINITY, out_max = -INFINITY;
    for (int i = 0; i < 4; i++) {
        const double u = j->u_at[0] + j->u_at[1] * corner[i][0] + j->u_at[2] * corner[i][1];
        const double v = j->v_at[0] + j->v_at[1] * corner[i][0] + j->v_at[2] * corner[i][1];
        const double in = slab_face(j->near_at, u, v), out = slab_face(j->far_at, u, v);
        in_min = smaller(in_min, in);
        out_max = larger(out_max, out);
        in_out[2] = larger(in_out[2], in);
        in_out[3] = smaller(in_out[3], out);
    }
    in_out[0] = larger(in_out[0], in_min);
    in_out[1] = smaller(in_out[1], out_max);
}

bool cts_tiled_beam_init(const TiledJob *j, TiledBeam *beam, int x0, int y0, int x1, int y1, int first)
{
    const int corner[4][2] = {{x0, y0}, {x1 - 1, y0}, {x0, y1 - 1}, {x1 - 1, y1 - 1}};
    double in_out[4] = {0, j->nk - 1, 0, j->nk - 1}; /* some ray is inside from..to, all are from..to */
    bound_slab(j, corner, in_out);
    if (!bound(j, j->u_at, j->nu - 1, corner, beam->u, in_out) ||
        !bound(j, j->v_at, j->nv - 1, corner, beam->v, in_out) || !(in_out[0] < in_out[1]))
        return false;
    beam->first = (int)in_out[0] > first ? (int)in_out[0] : first;
    beam->last = (int)ceil(in_out[1]);
    /* A view nearly along an axis meets the side faces very far away: keep to what an int holds. */
    beam->full_from = in_out[2] < j->nk ? (int)ceil(in_out[2]) : j->nk;
    beam->full_to = in_out[3] > 0 ? (int)in_out[3] : 0;
    beam->n_runs = 0;
    beam->next = beam->first;
    if (!cts_tiled_beam_extend(j, beam))
        return false;
    beam->first = beam->runs[0].from;
    return true;
}

/* Whether windows around [u, v] + step * q, and those that slopes are taken from, need no clamping. */
static bool is_inner(const TiledJob *j, const TiledBeam *beam, int q)
{
    const int beside_u = j->shade ? j->shade->step[0] : 1, beside_v = j->shade ? j->shade->step[1] : 1;
    const double du = j->u_at[3] * q, dv = j->v_at[3] * q;
    return beam->u[0] + du >= beside_u && beam->v[0] + dv >= beside_v && beam->u[1] + du + beside_u < j->window_u &&
           beam->v[1] + dv + beside_v < j->window_v;
}

static int fine_of(double at, int n_cells)
{
    const int cell = at > 0 ? (int)at : 0;
    return (cell < n_cells ? cell : n_cells - 1) / CTS_FINE_MACROCELL;
}

/* Whether something may be visible to the beam in slabs from..to - 1, which lie in one layer of fine macro-cells. */
static bool fine_visible(const TiledJob *j, const TiledBeam *beam, int from, int to)
{
    const CtsEmptySpace *empty = &j->empty;
    const double u_a = j->u_at[3] * from, u_b = j->u_at[3] * to, v_a = j->v_at[3] * from, v_b = j->v_at[3] * to;
    const int u0 = fine_of(beam->u[0] + smaller(u_a, u_b), j->nu - 1),
              u1 = fine_of(beam->u[1] + larger(u_a, u_b), j->nu - 1);
    const int v0 = fine_of(beam->v[0] + smaller(v_a, v_b), j->nv - 1),
              v1 = fine_of(beam->v[1] + larger(v_a, v_b), j->nv - 1);
    const int k = (j->rising ? from : j->nk - 2 - from) / CTS_FINE_MACROCELL;
    const uint8_t *layer = empty->fine + (ptrdiff_t)(k / 2) * empty->nu * empty->nv;
    for (int v = v0; v <= v1; v++)
        for (int u = u0; u <= u1; u++)
            if (layer[(v / 2) * empty->nu + u / 2] >> (4 * (k & 1) + 2 * (v & 1) + (u & 1)) & 1)
                return true;
    return false;
}

/* Where the layer of fine macro-cells that holds slab q ends. */
static int fine_end(const TiledJob *j, const TiledBeam *beam, int q)
{
    const int cell = j->rising ? q : j->nk - 2 - q;
    const int end = q + (j->rising ? CTS_FINE_MACROCELL - cell % CTS_FINE_MACROCELL : cell % CTS_FINE_MACROCELL + 1);
    return end < beam->last ? end : beam->last;
}

/* The run from q to end, with what follows it without a gap; rays may end soon, so that is not much. */
static void add_run(const TiledJob *j, TiledBeam *beam, int q, int end)
{
    TiledRun *const run = &beam->runs[beam->n_runs++];
    run->from = q;
    run->to = end;
    run->inner = is_inner(j, beam, q) && is_inner(j, beam, end);
    run->bend_known = 0;
    beam->next = end;
    for (int more = 0; more < MOST_AT_ONCE && beam->next < beam->last; more++) {
        end = fine_end(j, beam, run->to);
        if (run->inner != (is_inner(j, beam, run->to) && is_inner(j, beam, end)))
            break;
        beam->next = end;
        if (!fine_visible(j, beam, run->to, end))
            break;
        run->to = end;
    }
}

bool cts_tiled_beam_extend(const TiledJob *j, TiledBeam *beam)
{
    while (beam->next < beam->last) {
        const int q = beam->next;
        const double du = j->u_at[3] * q, dv = j->v_at[3] * q;
        const double u[2] = {beam->u[0] + du, beam->u[1] + du}, v[2] = {beam->v[0] + dv, beam->v[1] + dv};
        int until;
        const int skip = skip_from(j, u, v, q, &until);
        if (skip > 0) {
            beam->next += skip;
            continue;
        }
        /* A closer look: up to where the next layer of fine macro-cells begins. */
        const int end = fine_end(j, beam, q);
        beam->next = end < until ? end : until;
        if (!fine_visible(j, beam, q, beam->next))
            continue;
        add_run(j, beam, q, beam->next);
        return true;
    }
    return false;
}
