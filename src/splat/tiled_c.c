/* Plain C primitives for the tiled engine's march: the truth that the fast ones are compared with. */
#include "splat/tiled_kernel.h"

#include "base/mutation.h"
#include "splat/tiled_taps.h"
#include <math.h>

INLINE v8f v8f_min(v8f a, v8f b)
{
    v8f r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] < b[l] ? a[l] : b[l];
    return r;
}

INLINE v8f v8f_max(v8f a, v8f b)
{
    v8f r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] > b[l] ? a[l] : b[l];
    return r;
}

INLINE v8i v8i_min(v8i a, v8i b)
{
    v8i r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] < b[l] ? a[l] : b[l];
    return r;
}

INLINE v8i v8i_max(v8i a, v8i b)
{
    v8i r;
    for (int l = 0; l < 8; l++)
        r[l] = a[l] > b[l] ? a[l] : b[l];
    return r;
}

INLINE v8f v8f_sqrt(v8f a)
{
    v8f r;
    for (int l = 0; l < 8; l++)
        r[l] = sqrtf(a[l]);
    return r;
}

INLINE bool v8_any(v8i mask)
{
    int any = 0;
    for (int l = 0; l < 8; l++)
        any |= mask[l];
    return any != 0;
}

INLINE bool v8_all(v8i mask)
{
    int all = -1;
    for (int l = 0; l < 8; l++)
        all &= mask[l];
    return all != 0;
}

INLINE void lookup8(const int32_t (*rows)[4], int last, v8i index, v8i *r, v8i *g, v8i *b, v8i *k)
{
    for (int l = 0; l < 8; l++) {
        const int i = index[l] < 0 ? 0 : index[l] > last ? last : index[l];
        (*r)[l] = rows[i][0];
        (*g)[l] = rows[i][1];
        (*b)[l] = rows[i][2];
        (*k)[l] = rows[i][3];
    }
}

/* facing to the power of the preset, from shade's table. */
INLINE v8f shade_power(const CtsShade *shade, v8f facing)
{
    v8f r;
    for (int l = 0; l < 8; l++) {
        const float at = facing[l] * (float)shade->n_power;
        const int i = at < (float)shade->n_power ? (int)at : shade->n_power - 1;
        r[l] = shade->power[i] + (shade->power[i + 1] - shade->power[i]) * (at - (float)i);
    }
    return r;
}

INLINE v8i make_pick(v8i x0)
{
    return x0;
}

/* Bilinear in the layer `offset` voxels behind layer 0: columns with 14-bit integer weights, rows in float. */
INLINE v8f load_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    v8f a, b;
    for (int l = 0; l < 8; l++) {
        const uint16_t *p = t->at[l / 4] + offset + (t->row1[l] ? row_stride : 0) + t->pick[l];
        const int w1 = t->weights[l] >> 16, w0 = t->weights[l] & 0xffff;
        a[l] = (float)((p[0] - 32768) * w0 + (p[1] - 32768) * w1);
        b[l] = (float)((p[row_stride] - 32768) * w0 + (p[row_stride + 1] - 32768) * w1);
    }
    return (a + t->fy * (b - a)) * (1.0f / 16384) + 32768.0f;
}

#include "splat/tiled_tmpl.h"

void tiled_packet_c(const TiledJob *job, TiledBeam *beam, int x, int y, int n, TiledCounts *counts)
{
    run_packet(job, beam, x, y, n, counts);
}
