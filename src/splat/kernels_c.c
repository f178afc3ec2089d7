/* The plain kernels: readable truth, and what runs where there is no vector unit. */
#include "splat/kernels.h"

static inline void add_footprint(const CtsScatter *job, int i)
{
    const CtsFootprint *f = job->footprint;
    const int n_taps = 2 * f->reach[0] + 1;
    const uint32_t change = (uint32_t)job->value[i] - (job->old ? (uint32_t)job->old[i] : job->base);
    uint32_t *to = job->sheet + (size_t)i * (size_t)f->density[0];
    for (int v = job->tap0; v < job->tap1; v++, to += job->stride)
        for (int u = 0; u < n_taps; u++)
            to[u] += change * f->weight[v][u];
}

static void scatter_c(const CtsScatter *job, int i0, int i1)
{
    for (int i = i0; i < i1; i++)
        add_footprint(job, i);
}

static void scatter_marked_c(const CtsScatter *job, const uint64_t *marks, int i0, int i1)
{
    for (int i = i0; i < i1; i++)
        if (marks[i / 64] >> (i & 63) & 1)
            add_footprint(job, i);
}

static void mark_c(const uint16_t *value, const uint16_t *old, uint16_t base, int n, uint64_t *marks)
{
    for (int i0 = 0; i0 < n; i0 += 64) {
        uint64_t word = 0;
        for (int i = i0; i < n && i < i0 + 64; i++)
            word |= (uint64_t)(value[i] != (old ? old[i] : base)) << (i - i0);
        marks[i0 / 64] = word;
    }
}

static void widen_c(const uint16_t *value, int n, uint16_t *low, uint16_t *high)
{
    for (int i = 0; i < n; i++) {
        low[i] = value[i] < low[i] ? value[i] : low[i];
        high[i] = value[i] > high[i] ? value[i] : high[i];
    }
}

static void place_c(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac)
{
    const double last_cell = last > 1 ? last - 1 : 0;
    const float last_frac = last > 0 ? 1 : 0;
    for (int i = 0; i < n; i++) {
        const double at = base + by_x * (double)(x0 + i);
        const double down = fmin(fmax(floor(at), 0), last_cell);
        const float f = (float)(at - down);
        cell[i] = (int32_t)down;
        frac[i] = f < 0 ? 0 : f > last_frac ? last_frac : f;
    }
}

static inline float bilinear(const uint32_t *s, size_t stride, float fu, float fv)
{
    /* Halved so that they fit a signed integer, which is what vector units convert. */
    const float a = (float)(int32_t)(s[0] >> 1), b = (float)(int32_t)(s[1] >> 1);
    const float c = (float)(int32_t)(s[stride] >> 1), d = (float)(int32_t)(s[stride + 1] >> 1);
    const float top = a + (b - a) * fu, bottom = c + (d - c) * fu;
    return top + (bottom - top) * fv;
}

static void sample_c(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey)
{
    for (int i = 0; i < n; i++) {
        const size_t at = (size_t)places->cell[1][i] * sheets->stride + (size_t)places->cell[0][i];
        const float fu = places->frac[0][i], fv = places->frac[1][i];
        float value = bilinear(sheets->first + at, sheets->stride, fu, fv);
        if (sheets->second)
            value = value + (bilinear(sheets->second + at, sheets->stride, fu, fv) - value) * sheets->weight;
        value *= 2.0f / CTS_WEIGHT_ONE;
        /* Adding 2^23 rounds to the nearest whole number, ties to even, as vector conversion does. */
        value = (value + 0x1p23f) - 0x1p23f;
        grey[i] = value < 65535 ? (uint16_t)value : 65535;
    }
}

static inline void blend_pixel(float *pixel, const float entry[4])
{
    const float transmittance = pixel[3];
    for (int c = 0; c < 4; c++)
        pixel[c] += transmittance * entry[c];
    if (!(pixel[3] >= CTS_OPAQUE_BELOW))
        pixel[3] = 0;
}

static void blend_c(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries)
{
    for (int i = 0; i < n; i++)
        if (grey[i] >= entries->low && grey[i] <= entries->high)
            blend_pixel(pixels + 4 * (size_t)i, entries->entry[grey[i]]);
}

static void gradient_at(const CtsLight *light, const float (*field)[4], size_t voxel, float fu, float fv, float g[3])
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

static void light_c(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries, const CtsPlaces *places,
                    const CtsLight *light)
{
    for (int i = 0; i < n; i++) {
        float *pixel = pixels + 4 * (size_t)i;
        if (grey[i] < entries->low || grey[i] > entries->high)
            continue;
        const float *entry = entries->entry[grey[i]];
        if (entry[3] == 0 || pixel[3] == 0)
            continue;
        float fu, fv, g[3], colour, white;
        const int u = voxel_of(places->cell[0][i], places->frac[0][i], light->shift[0], &fu);
        const int v = voxel_of(places->cell[1][i], places->frac[1][i], light->shift[1], &fv);
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
        blend_pixel(pixel, lit);
    }
}

static void gradient_c(const uint16_t *row, const uint16_t *const before[2], const uint16_t *const after[2],
                       const float scale[2], int n_row, int i0, int i1, float (*gradient)[4])
{
    for (int i = i0; i < i1; i++) {
        const int left = i > 0 ? i - 1 : i, right = i < n_row - 1 ? i + 1 : i;
        const int doubled = right - left == 1 ? 2 : 1;
        gradient[i][0] = (float)(doubled * (row[right] - row[left]));
        gradient[i][1] = (float)(after[0][i] - before[0][i]) * scale[0];
        gradient[i][2] = (float)(after[1][i] - before[1][i]) * scale[1];
        gradient[i][3] = 0;
    }
}

void cts_kernels_init(CtsKernels *kernels, unsigned cpu)
{
    *kernels = (CtsKernels){
        .scatter = scatter_c,
        .scatter_marked = scatter_marked_c,
        .mark = mark_c,
        .widen = widen_c,
        .place = place_c,
        .sample = sample_c,
        .blend = blend_c,
        .light = light_c,
        .gradient = gradient_c,
    };
    (void)cpu;
}
