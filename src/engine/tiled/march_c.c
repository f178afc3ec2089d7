/* Plain C primitives for the tiled engine's march: the truth that the fast ones are compared with. */
#include "base/mutation.h"
#include <math.h>

#define LANES 8
#include "engine/tiled/mask_tmpl.h"

INLINE vf vf_min(vf a, vf b)
{
    vf r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] < b[l] ? a[l] : b[l];
    return r;
}

INLINE vf vf_max(vf a, vf b)
{
    vf r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] > b[l] ? a[l] : b[l];
    return r;
}

INLINE vi vi_min(vi a, vi b)
{
    vi r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] < b[l] ? a[l] : b[l];
    return r;
}

INLINE vi vi_max(vi a, vi b)
{
    vi r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] > b[l] ? a[l] : b[l];
    return r;
}

INLINE vs vs_min(vs a, vs b)
{
    vs r;
    for (int i = 0; i < 8; i++)
        r[i] = a[i] < b[i] ? a[i] : b[i];
    return r;
}

INLINE vs vs_max(vs a, vs b)
{
    vs r;
    for (int i = 0; i < 8; i++)
        r[i] = a[i] > b[i] ? a[i] : b[i];
    return r;
}

/* a b + c, rounded once. */
INLINE vf vf_fma(vf a, vf b, vf c)
{
    vf r;
    for (int l = 0; l < 8; l++)
        r[l] = fmaf(a[l], b[l], c[l]);
    return r;
}

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)((mask & (vi)yes) | (~mask & (vi)no));
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (mask & yes) | (~mask & no);
}

INLINE unsigned any_in(vmask mask)
{
    int any = 0;
    for (int l = 0; l < 8; l++)
        any |= mask[l];
    return any != 0;
}

INLINE unsigned all_in(vmask mask)
{
    int all = -1;
    for (int l = 0; l < 8; l++)
        all &= mask[l];
    return all != 0;
}

INLINE int clamped(int32_t index, int last)
{
    return index < 0 ? 0 : index > last ? last : index;
}

/* Rows `to` less rows `from`, both clamped to 0..last, subtracted as doubles. */
INLINE void look_up_difference(const double (*rows)[4], int last, vi from, vi to, vf d[4])
{
    for (int l = 0; l < 8; l++) {
        const double *a = rows[clamped(from[l], last)], *b = rows[clamped(to[l], last)];
        for (int c = 0; c < 4; c++)
            d[c][l] = (float)(b[c] - a[c]);
    }
}

/* Rows index, clamped to 0..last. */
INLINE void look_up_rows(const float (*rows)[4], int last, vi index, vf row[4])
{
    for (int l = 0; l < 8; l++)
        for (int c = 0; c < 4; c++)
            row[c][l] = rows[clamped(index[l], last)][c];
}

INLINE void look_up_pairs(const float (*rows)[2], int last, vi index, vf pair[2])
{
    for (int l = 0; l < 8; l++)
        for (int c = 0; c < 2; c++)
            pair[c][l] = rows[clamped(index[l], last)][c];
}

/* facing to the power of the preset, from shade's table. */
INLINE vf shade_power(const CtsShade *shade, vf facing)
{
    vf r;
    for (int l = 0; l < 8; l++) {
        const float at = facing[l] * (float)shade->n_power;
        const int i = at < (float)shade->n_power ? (int)at : shade->n_power - 1;
        r[l] = shade->power[i] + (shade->power[i + 1] - shade->power[i]) * (at - (float)i);
    }
    return r;
}

INLINE vi make_pick(vi x0)
{
    return x0;
}

#include "engine/tiled/taps_tmpl.h"

/* The sums of each lane's two voxels at `at`, less 32768, weighted. */
INLINE vi weigh_pairs(const uint16_t *layer, vi at, vi weights)
{
    vi sum;
    for (int l = 0; l < 8; l++) {
        const uint16_t *p = layer + at[l];
        sum[l] = (p[0] - 32768) * (weights[l] & 0xffff) + (p[1] - 32768) * (weights[l] >> 16);
    }
    return sum;
}

/* Bilinear in the layer `offset` voxels behind layer 0: columns with 14-bit integer weights, rows in float. */
INLINE vf load_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    vf a, b;
    for (int l = 0; l < 8; l++) {
        const uint16_t *p = t->at[l / 4] + offset + (t->row1[l] ? row_stride : 0) + t->pick[l];
        const int w1 = t->weights[l] >> 16, w0 = t->weights[l] & 0xffff;
        a[l] = (float)((p[0] - 32768) * w0 + (p[1] - 32768) * w1);
        b[l] = (float)((p[row_stride] - 32768) * w0 + (p[row_stride + 1] - 32768) * w1);
    }
    return vf_fma(vf_fma(t->fy, b - a, a), vf_of(1.0f / 16384), vf_of(32768));
}

/* load_window() times 16384: as load_differences() would tell of the difference to a layer of zeros. */
INLINE vf load_level(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    vf a, b;
    for (int l = 0; l < 8; l++) {
        const uint16_t *p = t->at[l / 4] + offset + (t->row1[l] ? row_stride : 0) + t->pick[l];
        const int w1 = t->weights[l] >> 16, w0 = t->weights[l] & 0xffff;
        a[l] = (float)(p[0] * w0 + p[1] * w1);
        b[l] = (float)(p[row_stride] * w0 + p[row_stride + 1] * w1);
    }
    return a + t->fy * (b - a);
}

/* What load_window() would tell of the differences between layers that start at plus[axis] and at minus[axis], times
 * 16384. narrow: a difference of two voxels fits 16 bits. */
INLINE void load_differences(const Taps *t, const ptrdiff_t minus[3], const ptrdiff_t plus[3], ptrdiff_t row_stride,
                             bool narrow, vf d[3])
{
    (void)narrow;
    for (int axis = 0; axis < 3; axis++) {
        vf a, b;
        for (int l = 0; l < 8; l++) {
            const uint16_t *at = t->at[l / 4] + (t->row1[l] ? row_stride : 0) + t->pick[l];
            const uint16_t *p = at + plus[axis], *m = at + minus[axis];
            const int w1 = t->weights[l] >> 16, w0 = t->weights[l] & 0xffff;
            a[l] = (float)((p[0] - m[0]) * w0 + (p[1] - m[1]) * w1);
            b[l] = (float)((p[row_stride] - m[row_stride]) * w0 + (p[row_stride + 1] - m[row_stride + 1]) * w1);
        }
        d[axis] = a + t->fy * (b - a);
    }
}

#include "engine/tiled/march_tmpl.h"

void cts_tiled_packets_c(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    run_packets(job, beam, spans, counts);
}
