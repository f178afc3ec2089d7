/* How much the field bends for any of a beam's rays, part of march_tmpl.h; march.h says what follows from it. */
#include "engine/tiled/samples_tmpl.h"

enum { BEND_COLUMNS = sizeof(vs) / sizeof(int16_t) };

typedef int16_t vs_u __attribute__((vector_size(16), aligned(2), may_alias)); /* for loads from rows */
typedef uint16_t vs_levels __attribute__((vector_size(16)));

/* Differences wrap around: where levels seem negative for want of a sign, theirs are right all the same. */
INLINE vs vs_less(vs a, vs b)
{
    return (vs)((vs_levels)a - (vs_levels)b);
}

/* |a - b| */
INLINE vs vs_apart(vs a, vs b)
{
    return vs_max(vs_less(a, b), vs_less(b, a));
}

/* Second differences of grey levels must fit 16 bits: what they are divided by is 2 to this. */
INLINE int bend_shift(const TiledJob *j)
{
    const float range = j->grey_most - j->grey_least;
    return range < 8192 ? 0 : range < 16384 ? 1 : range < 32768 ? 2 : 3;
}

/* Columns of a row from `column` on; those beyond the row's end are as the last. */
INLINE vs load_columns(const uint16_t *row, int column, int n_columns, int shift)
{
    vs levels;
    if (__builtin_expect(column + BEND_COLUMNS <= n_columns, 1))
        levels = *(const vs_u *)(row + column);
    else
        for (int i = 0; i < BEND_COLUMNS; i++)
            levels[i] = (int16_t)row[column + i < n_columns ? column + i : n_columns - 1];
    return shift ? (vs)((vs_levels)levels >> shift) : levels;
}

/* The largest second differences of voxels around a slab: along u and v, and mixed ones; in each column. */
typedef struct Bends {
    vs uu, vv, uv, uk, vk;
    vs low, high; /* levels less 32768 */
} Bends;

/* Of BEND_COLUMNS columns, those from `from` to `last`, and rows first to end of layer `here` and the next. */
INLINE void add_bends(const TiledJob *j, const uint16_t *here, int from, int last, int first, int end, Bends *most)
{
    const int n = j->window_u + CTS_LAYOUT_MIN_U, shift = bend_shift(j);
    const vs zero = {0};
    Bends b = {.low = zero + (int16_t)32767, .high = zero + (int16_t)-32768};
    vs old[2] = {zero, zero}, old_u[2] = {zero, zero}, old_v[2] = {zero, zero};
    for (int r = first; r <= end; r++) {
        vs u[2], v[2] = {zero, zero};
        for (int k = 0; k < 2; k++) {
            const uint16_t *row = here + k * j->layer_stride + r * j->row_stride;
            const vs at = load_columns(row, from, n, shift), next = load_columns(row, from + 1, n, shift);
            u[k] = vs_less(next, at);
            b.low = vs_min(b.low, at ^ (int16_t)-32768);
            b.high = vs_max(b.high, at ^ (int16_t)-32768);
            v[k] = vs_less(at, old[k]);
            b.uu = vs_max(b.uu, vs_apart(vs_less(load_columns(row, from + 2, n, shift), next), u[k]));
            if (r > first)
                b.uv = vs_max(b.uv, vs_apart(u[k], old_u[k]));
            if (r > first + 1)
                b.vv = vs_max(b.vv, vs_apart(v[k], old_v[k]));
            old[k] = at;
            old_u[k] = u[k];
            old_v[k] = v[k];
        }
        b.uk = vs_max(b.uk, vs_apart(u[1], u[0]));
        if (r > first)
            b.vk = vs_max(b.vk, vs_apart(v[1], v[0]));
    }
    /* What reaches beyond the last column does not count. */
    const vs column = {0, 1, 2, 3, 4, 5, 6, 7};
    const int16_t left = (int16_t)(last - from < 2 * BEND_COLUMNS ? last - from : 2 * BEND_COLUMNS);
    const vs all = column <= left, one = column < left, two = column + 1 < left;
    most->low = vs_min(most->low, (b.low & all) | (~all & (int16_t)32767));
    most->high = vs_max(most->high, (b.high & all) | (~all & (int16_t)-32768));
    most->uu = vs_max(most->uu, b.uu & two);
    most->uv = vs_max(most->uv, b.uv & one);
    most->uk = vs_max(most->uk, b.uk & one);
    most->vv = vs_max(most->vv, b.vv & all);
    most->vk = vs_max(most->vk, b.vk & all);
}

INLINE int largest_of(vs a)
{
    a = vs_max(a, __builtin_shufflevector(a, a, 4, 5, 6, 7, 0, 1, 2, 3));
    a = vs_max(a, __builtin_shufflevector(a, a, 2, 3, 0, 1, 6, 7, 4, 5));
    return a[0] > a[1] ? a[0] : a[1];
}

/* In grey levels. */
INLINE float largest(vs a, int shift)
{
    const int most = largest_of(a);
    return (float)((most << shift) + 2 * ((1 << shift) - 1)); /* two levels of either sign have lost so much */
}

/* For all voxels that the beam's rays touch between layers q and q + 1. */
OUTLINE TiledBend find_bend(const TiledJob *j, const TiledBeam *beam, int q)
{
    /* Rays are where their packets' steps lead them. */
    const double hair = 1e-3, du = j->u_at[3], dv = j->v_at[3];
    const double low_u = beam->u[0] + (du < 0 ? du * (q + 1) : du * q) - hair;
    const double high_u = beam->u[1] + (du < 0 ? du * q : du * (q + 1)) + hair;
    const double low_v = beam->v[0] + (dv < 0 ? dv * (q + 1) : dv * q) - hair;
    const double high_v = beam->v[1] + (dv < 0 ? dv * q : dv * (q + 1)) + hair;
    const float su = (float)fabs(du), sv = (float)fabs(dv);
    /* Beyond a face the field is taken to go on as it is there, which is a kink too. */
    const bool faces = low_u < 0 || low_v < 0 || high_u >= j->nu - 1 || high_v >= j->nv - 1;
    const int first_u = clamp_int((int)low_u, 0, j->nu - 1), last_u = clamp_int((int)high_u + 1, 0, j->nu - 1);
    const int first_v = clamp_int((int)low_v, 0, j->nv - 1), last_v = clamp_int((int)high_v + 1, 0, j->nv - 1);
    const int shift = bend_shift(j);
    const uint16_t *here = j->layer0 + q * j->layer_stride;
    const vs zero = {0};
    Bends b = {.low = zero + (int16_t)32767, .high = zero + (int16_t)-32768};
    for (int from = first_u; from <= last_u; from += BEND_COLUMNS)
        add_bends(j, here, from, last_u, first_v, last_v, &b);
    const int low = (-1 - largest_of(~b.low) + 32768) << shift,
              high = ((largest_of(b.high) + 32768) << shift) + (1 << shift) - 1;
    const bool quiet = (float)high <= j->table.quiet_low || (float)low >= j->table.quiet_high;
    const float uv = su * sv * largest(b.uv, shift);
    const float at_face = faces ? (su + sv) * (float)(high - low) : 0;
    return (TiledBend){at_face + su * largest(b.uu, shift) + sv * largest(b.vv, shift),
                       2 * (uv + su * largest(b.uk, shift) + sv * largest(b.vk, shift)), 2 * uv, quiet};
}

/* The same, found once. */
INLINE TiledBend bend_of(const TiledJob *j, const TiledBeam *beam, TiledRun *run, int q)
{
    const int i = q - run->from;
    if (!(run->bend_known >> i & 1)) {
        run->bend[i] = find_bend(j, beam, q);
        run->bend_known |= 1u << i;
    }
    return run->bend[i];
}
