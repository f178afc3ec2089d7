#include "input/load/load.h"

#include "base/compare.h"
#include "base/mem.h"
#include "core/volume/components.h"
#include <math.h>
#include <stdlib.h>

/* Limits of accidents; more outliers are values of another kind. VOXELS_PER_OUTLIER: a cube of 1 cm of a head's 10
 * litres; what is larger may be an object of the scene. LARGEST_PART: the 2 x 2 x 2 voxels over which resampling
 * spreads one. */
enum { VOXELS_PER_OUTLIER = 10000, LARGEST_PART = 8 };

void cts_outliers_begin(CtsOutliers *o, const int dims[3])
{
    *o = (CtsOutliers){.most = (size_t)dims[0] * (size_t)dims[1] * (size_t)dims[2] / VOXELS_PER_OUTLIER,
                       .low = INFINITY,
                       .high = -INFINITY,
                       .rest_low = INFINITY,
                       .rest_high = -INFINITY,
                       .rest_whole = true};
}

CtsStatus cts_outliers_take(CtsOutliers *o, size_t voxel, double hu, CtsError *err)
{
    cts_lower_to(&o->low, hu);
    cts_raise_to(&o->high, hu);
    if (!cts_is_outlier(hu)) {
        cts_lower_to(&o->rest_low, hu);
        cts_raise_to(&o->rest_high, hu);
        o->rest_whole &= hu == floor(hu);
        return CTS_OK;
    }
    const CtsStatus st = o->n < o->most ? cts_grow(&o->voxels, o->n, err) : CTS_OK;
    if (st)
        return st;
    if (o->n < o->most)
        o->voxels[o->n] = voxel;
    o->n++;
    o->n_low += hu < 0;
    o->n_high += hu > 0;
    return CTS_OK;
}

/* The number of voxels of the largest 26-connected part. */
static CtsStatus largest_part(const CtsOutliers *o, const int dims[3], uint64_t *largest, CtsError *err)
{
    CtsBits bits = {0};
    CtsComponents parts = {0};
    const size_t nx = (size_t)dims[0], ny = (size_t)dims[1];
    CtsStatus st = cts_bits_new(&bits, dims, err);
    for (size_t n = 0; !st && n < o->n; n++)
        cts_bits_set(&bits, (int)(o->voxels[n] % nx), (int)(o->voxels[n] / nx % ny), (int)(o->voxels[n] / nx / ny));
    if (!st)
        st = cts_components_find(&parts, &bits, CTS_CONNECTED_BY_CORNERS, err);
    *largest = 0;
    for (uint32_t p = 0; p < parts.n_parts; p++)
        *largest = parts.parts[p].n_voxels > *largest ? parts.parts[p].n_voxels : *largest;
    cts_components_free(&parts);
    cts_bits_free(&bits);
    return st;
}

CtsStatus cts_outliers_check(const CtsOutliers *o, const int dims[3], CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint64_t largest = 0;
    if (o->n && o->n <= o->most && (st = largest_part(o, dims, &largest, err)))
        return st;
    if (o->n > o->most || largest > LARGEST_PART)
        return cts_fail(err, CTS_ERR_PIXELS, "its values from %g to %g are no Hounsfield units", o->low, o->high);
    if (o->n)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_OUTLIERS,
                              "%zu isolated voxel%s hold%s what no scanner measures (all values go from %g to %g HU): "
                              "%zu low count as -1024 HU, %zu high as %g HU, the largest other value",
                              o->n, o->n > 1 ? "s" : "", o->n > 1 ? "" : "s", o->low, o->high, o->n_low, o->n_high,
                              o->rest_high);
    return CTS_OK;
}

void cts_outliers_mend(const CtsOutliers *outliers, CtsVolume *v)
{
    const double most = floor((outliers->rest_high - v->hu_offset) / v->hu_step + 0.5);
    const uint16_t level = (uint16_t)fmin(fmax(most, 0), UINT16_MAX);
    for (size_t n = 0; n < outliers->n; n++)
        if (v->grey[outliers->voxels[n]])
            v->grey[outliers->voxels[n]] = level;
}

void cts_outliers_free(CtsOutliers *o)
{
    free(o->voxels);
    *o = (CtsOutliers){0};
}
