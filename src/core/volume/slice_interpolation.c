#include "core/volume/slice_interpolation.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "core/volume/shape_interpolation.h"
#include "ctsplat/volume.h"
#include <math.h>

CtsInterpolationWeights cts_slice_interpolation_weights(double t, const double distance[3])
{
    const double s = 1 - t, before = distance[0], here = distance[1], behind = distance[2];
    /* Hermite's basis, slopes over the distance of b and c. */
    const double at_b = (1 + 2 * t) * s * s, at_c = (1 + 2 * s) * t * t, slope_b = t * s * s, slope_c = -s * t * t;
    /* A slope is the mean of the differences on both sides, the nearer one counting more. */
    const double rise_ab = slope_b * here / (before + here) * here / before,
                 rise_b = slope_b * before / (before + here);
    const double rise_cd = slope_c * here / (here + behind) * here / behind,
                 rise_c = slope_c * behind / (here + behind);
    return (CtsInterpolationWeights){.a = (float)-rise_ab,
                                     .b = (float)(at_b + rise_ab - rise_b - rise_c),
                                     .c = (float)(at_c + rise_b + rise_c - rise_cd),
                                     .d = (float)rise_cd};
}

#define INLINE static inline __attribute__((always_inline))

/* first, last: the stack begins or ends with the inner slices, and is continued along the straight line through them.
 */
INLINE void interpolate_voxels(uint16_t *restrict to, const uint16_t *const slices[4], int n,
                               const CtsInterpolationWeights *w, bool first, bool last)
{
    const uint16_t *const pa = slices[0], *const pb = slices[1], *const pc = slices[2], *const pd = slices[3];
    for (int i = 0; i < n; i++) {
        const int b = pb[i], c = pc[i], low = b < c ? b : c, high = b < c ? c : b;
        const float a = first ? (float)(2 * b - c) : (float)pa[i], d = last ? (float)(2 * c - b) : (float)pd[i];
        /* Clamped as an integer: rounding does not leave the range. */
        int y = (int)(w->a * a + w->b * (float)b + w->c * (float)c + w->d * d + 0.5f);
        y = y < low ? low : y;
        to[i] = (uint16_t)(y > high ? high : y);
    }
}

INLINE void interpolate_any(uint16_t *to, const uint16_t *const slices[4], int n, const CtsInterpolationWeights *w)
{
    const bool first = slices[0] == slices[1], last = slices[3] == slices[2];
    if (!first && !last)
        interpolate_voxels(to, slices, n, w, false, false);
    else
        interpolate_voxels(to, slices, n, w, first, last);
}

CTS_CPU_VARIANTS(void, interpolate,
                 (uint16_t * to, const uint16_t *const slices[4], int n, const CtsInterpolationWeights *w),
                 interpolate_any(to, slices, n, w))

void cts_slice_interpolation_row(uint16_t *to, const uint16_t *const slices[4], int n,
                                 const CtsInterpolationWeights *weights)
{
    CTS_CPU_CHOICE(cts_cpu_flags(), interpolate)(to, slices, n, weights);
}

int cts_volume_layers_per_slice(const CtsVolume *volume)
{
    enum { MAX_PARTS = 8 }; /* error of a cubic as eight linear segments: 6 / (8 * 64), 1 % of its range */
    const double pixel_mm = fmin(cts_volume_spacing_mm(volume, 0), cts_volume_spacing_mm(volume, 1));
    const double ratio = cts_volume_spacing_mm(volume, 2) / pixel_mm;
    if (volume->dims[2] < 2 || !(ratio > 1.5)) /* up to 1.5, rounding gives one layer a slice */
        return 1;
    return (int)fmin(floor(ratio + 0.5), MAX_PARTS);
}

CtsStatus cts_volume_interpolate(CtsVolume *v, int n_parts, CtsInterpolation how, int n_threads,
                                 CtsInterpolationCounts *made, CtsError *err)
{
    const size_t layer_voxels = (size_t)v->dims[0] * (size_t)v->dims[1];
    const int64_t n_layers = (int64_t)(v->dims[2] - 1) * n_parts + 1;
    const size_t n_scanned = layer_voxels * (size_t)v->dims[2];
    size_t n;
    if (n_parts <= 1)
        return CTS_OK;
    if (n_layers > INT32_MAX || cts_mul_overflows(layer_voxels, (size_t)n_layers, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "%d layers for each of %d slices are too many", n_parts, v->dims[2]);
    const double need = (double)(n - n_scanned) * sizeof *v->grey;
    const uint64_t free_bytes = cts_memory_available();
    if (!cts_memory_allows(need, free_bytes))
        return cts_fail(err, CTS_ERR_MEMORY, "layers between the slices need %.0f MiB of memory, and %.0f MiB are free",
                        need / 1048576, (double)free_bytes / 1048576);
    const CtsStatus st = cts_resize_array(&v->grey, n_scanned, n, err);
    if (st)
        return st;
    cts_shape_interpolate_layers(&(CtsShapeStack){.slices = v->grey,
                                                  .layers = v->grey,
                                                  .n_columns = v->dims[0],
                                                  .n_rows = v->dims[1],
                                                  .n_slices = v->dims[2],
                                                  .end = {v->dims[0], v->dims[1], (int)n_layers},
                                                  .n_parts = n_parts,
                                                  .scale = v},
                                 how, n_threads, made);
    v->dims[2] = (int)n_layers;
    for (int c = 0; c < 3; c++)
        v->step_lps[2][c] /= n_parts;
    v->slice_layers *= n_parts;
    v->air_before[2] *= n_parts;
    v->air_behind[2] *= n_parts;
    return CTS_OK;
}
