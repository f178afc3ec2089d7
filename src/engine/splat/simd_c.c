/* The plain C path: readable truth, and what runs where there is no vector unit. */
#include "engine/splat/simd.h"

#include "base/cpu.h"
#include "engine/splat/simd_one.h"

static void scatter_c(const CtsScatter *job, int i0, int i1)
{
    for (int i = i0; i < i1; i++)
        cts_one_footprint(job, i);
}

static void scatter_marked_c(const CtsScatter *job, const uint64_t *marks, int i0, int i1)
{
    for (int i = i0; i < i1; i++)
        if (marks[i / 64] >> (i & 63) & 1)
            cts_one_footprint(job, i);
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
    for (int i = 0; i < n; i++)
        cts_one_place(base, by_x, last, x0 + i, cell + i, frac + i);
}

static void sample_c(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey)
{
    for (int i = 0; i < n; i++)
        grey[i] = cts_one_sample(sheets, places, i);
}

static bool blend_c(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries)
{
    bool closed = false;
    for (int i = 0; i < n; i++)
        closed |= cts_one_blend(pixels, grey, i, entries);
    return closed;
}

static bool light_c(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries, const CtsPlaces *places,
                    const CtsLight *light)
{
    bool closed = false;
    for (int i = 0; i < n; i++)
        closed |= cts_one_light(pixels, grey, i, entries, places, light);
    return closed;
}

static void gradient_c(const CtsGradientRows *rows, int i0, int i1, float (*gradient)[4])
{
    for (int i = i0; i < i1; i++)
        cts_one_gradient(rows, i, gradient);
}

void cts_simd_init(CtsSimd *simd, unsigned cpu)
{
    *simd = (CtsSimd){
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
    if (cpu & CTS_CPU_AVX2)
        cts_simd_init_avx2(simd);
}
