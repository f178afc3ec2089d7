/* What each hot loop does to one voxel or pixel: all of the plain C path, and the ends of rows of the vector ones. */
#ifndef CTS_SPLAT_SIMD_ONE_H
#define CTS_SPLAT_SIMD_ONE_H

#include "base/mutation.h"
#include "engine/splat/simd.h"
#include <math.h>

static inline void cts_one_footprint(const CtsScatter *job, int i)
{
    const CtsFootprint *f = job->footprint;
    const int n_taps = 2 * f->reach[0] + 1;
    const uint32_t change = (uint32_t)job->value[i] - (job->old ? (uint32_t)job->old[i] : job->base);
    uint32_t *to = job->sheet + (size_t)i * (size_t)f->density[0];
    for (int v = job->tap0; v < job->tap1; v++, to += job->stride)
        for (int u = 0; u < n_taps; u++)
            to[u] += change * f->weight[v][u];
}

static inline void cts_one_place(double base, double by_x, int last, int x, int32_t *cell, float *frac)
{
    const double last_cell = last > 1 ? last - 1 : 0, at = base + by_x * (double)x;
    const double down = fmin(fmax(floor(at), 0), last_cell);
    const float f = (float)(at - down), last_frac = last > 0 ? 1 : 0;
    *cell = (int32_t)down;
    *frac = f < 0 ? 0 : f > last_frac ? last_frac : f;
}

static inline float bilinear(const uint32_t *s, size_t stride, float fu, float fv)
{
    /* Halved so that they fit a signed integer, which is what vector units convert. */
    const float a = (float)(int32_t)(s[0] >> 1), b = (float)(int32_t)(s[1] >> 1);
    const float c = (float)(int32_t)(s[stride] >> 1), d = (float)(int32_t)(s[stride + 1] >> 1);
    const float top = a + (b - a) * fu, bottom = c + (d - c) * fu;
    return top + (bottom - top) * fv;
}

static inline uint16_t cts_one_sample(const CtsSheetPair *sheets, const CtsPlaces *places, int i)
{
    const int row = places->level ? 0 : i;
    const size_t at = (size_t)places->cell[1][row] * sheets->stride + (size_t)places->cell[0][i];
    const float fu = places->frac[0][i], fv = places->frac[1][row];
    float value = bilinear(sheets->first + at, sheets->stride, fu, fv);
    if (sheets->second)
        value = value + (bilinear(sheets->second + at, sheets->stride, fu, fv) - value) * sheets->weight;
    value *= 2.0f / CTS_WEIGHT_ONE;
    /* Adding 2^23 rounds to the nearest whole number, ties to even, as vector conversion does. */
    value = CTS_MUTATED(ROUNDING) ? floorf(value) : (value + 0x1p23f) - 0x1p23f;
    return value < 65535 ? (uint16_t)value : 65535;
}

/* True when this made the transmittance 0. */
static inline bool blend_pixel(float *pixel, const float entry[4])
{
    const float transmittance = pixel[3];
    for (int c = 0; c < 4; c++)
        pixel[c] += transmittance * entry[c];
    if (pixel[3] >= CTS_OPAQUE_BELOW)
        return false;
    pixel[3] = 0;
    return transmittance > 0;
}

static inline bool cts_one_blend(float *pixels, const uint16_t *grey, int i, const CtsEntries *entries)
{
    if (grey[i] < entries->low || grey[i] > entries->high)
        return false;
    return blend_pixel(pixels + 4 * (size_t)i, entries->entry[grey[i]]);
}

static inline void gradient_at(const CtsLight *light, const float (*field)[4], size_t voxel, float fu, float fv,
                               float g[3])
{
    const float *a = field[voxel], *b = field[voxel + 1];
    const float *c = field[voxel + light->stride], *d = field[voxel + light->stride + 1];
    for (int i = 0; i < 3; i++) {
        const float top = a[i] + (b[i] - a[i]) * fu, bottom = c[i] + (d[i] - c[i]) * fu;
        g[i] = top + (bottom - top) * fv;
    }
}

/* Voxel and fraction of a lattice cell and fraction. */
static inline int voxel_of(int32_t cell, float frac, int shift, float *voxel_frac)
{
    const int whole = cell >> shift;
    *voxel_frac = ((float)(cell - (whole << shift)) + frac) * (1.0f / (float)(1 << shift));
    return whole;
}

/* Where nothing can change the pixel, neither can this: skipping is for speed. */
static inline bool cts_one_light(float *pixels, const uint16_t *grey, int i, const CtsEntries *entries,
                                 const CtsPlaces *places, const CtsLight *light)
{
    float *pixel = pixels + 4 * (size_t)i;
    if (grey[i] < entries->low || grey[i] > entries->high)
        return false;
    const float *entry = entries->entry[grey[i]];
    if (entry[3] == 0 || pixel[3] == 0)
        return false;
    float fu, fv, g[3], colour, white;
    const int u = voxel_of(places->cell[0][i], places->frac[0][i], light->shift[0], &fu);
    const int row = places->level ? 0 : i;
    const int v = voxel_of(places->cell[1][row], places->frac[1][row], light->shift[1], &fv);
    const size_t voxel = (size_t)v * light->stride + (size_t)u;
    gradient_at(light, light->first, voxel, fu, fv, g);
    if (light->second) {
        float h[3];
        gradient_at(light, light->second, voxel, fu, fv, h);
        for (int c = 0; c < 3; c++)
            g[c] = g[c] + (h[c] - g[c]) * light->weight;
    }
    cts_shade_factors(light->shade, cts_shade_facing(light->shade, g[0], g[1], g[2]), &colour, &white);
    const float lift = -entry[3] * white;
    const float lit[4] = {entry[0] * colour + lift, entry[1] * colour + lift, entry[2] * colour + lift, entry[3]};
    return blend_pixel(pixel, lit);
}

static inline void cts_one_gradient(const CtsGradientRows *rows, int i, float (*gradient)[4])
{
    const int beyond = rows->air_beyond ? 0 : rows->row[i];
    const int left = i > 0 ? rows->row[i - 1] : beyond, right = i < rows->n - 1 ? rows->row[i + 1] : beyond;
    const bool one_sided = !rows->air_beyond && (i == 0 || i == rows->n - 1);
    gradient[i][0] = (float)((one_sided ? 2 : 1) * (right - left));
    gradient[i][1] = (float)(rows->after[0][i] - rows->before[0][i]) * rows->scale[0];
    gradient[i][2] = (float)(rows->after[1][i] - rows->before[1][i]) * rows->scale[1];
    gradient[i][3] = 0;
}

#endif
