/* Fields: HU along a ray as a sequence of cubic polynomials. The integration uses only this interface, and so serves
 * the trilinear volume, other kernels and formulas. */
#pragma once

#include "core/scene/view.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>

typedef struct CtsRay {
    double start_vox[3], step_vox[3]; /* voxel coordinates are start + t * step, t in mm */
    /* inside the closed box of voxel centres; t0 == t1 for a single point of contact */
    double t0_mm, t1_mm;
} CtsRay;

/* HU from t0 to t1 is the cubic hu in u = (t - t0) / (t1 - t0). */
typedef struct CtsRaySegment {
    double t0_mm, t1_mm;
    double hu[4];
} CtsRaySegment;

/* Sets of HU, each from low up to, not including, high; in rising order. */
typedef struct CtsHuRanges {
    int n;
    struct {
        double low, high;
    } range[260];
} CtsHuRanges;

/* False only when no HU of low..high is in a range. */
static inline bool cts_hu_wanted(const CtsHuRanges *wanted, double low, double high)
{
    for (int i = 0; i < wanted->n && high >= wanted->range[i].low; i++)
        if (low < wanted->range[i].high)
            return true;
    return false;
}

/* A traversal of one ray; the field keeps its state in it. Initialise with ray, wanted, t_mm = ray->t0_mm, the rest
 * zero. */
typedef struct CtsRayWalk {
    const CtsRay *ray;
    const CtsHuRanges *wanted; /* segments without any of these HU may be skipped; may change during the traversal */
    double t_mm;               /* end of the last segment returned */
    int cell[3];               /* of the last segment returned */
    double from[3], to[3];     /* the ends of that segment within the cell, 0..1 */
    bool within;               /* within an interval already known to be wanted, for fields that store such intervals */
    bool started;
} CtsRayWalk;

/* The begin of one block of memory, to be freed with free(). */
typedef struct CtsField CtsField;
struct CtsField {
    /* The next segment, or false at the end of the ray. */
    bool (*next)(const CtsField *field, CtsRayWalk *walk, CtsRaySegment *segment);
    /* Gradient of HU per voxel along each volume axis, on the last segment returned. */
    void (*gradient)(const CtsField *field, const CtsRayWalk *walk, const CtsRaySegment *segment,
                     double gradient[3][4]);
};

/* Central difference of grey levels at a voxel, per voxel; at the border to air, or one-sided. */
double cts_field_difference(const CtsVolume *volume, const int voxel[3], int axis, bool air_beyond);

/* Trilinear between voxel centres. The preset determines the gradients at the border. volume must outlive the field. */
CtsStatus cts_field_trilinear(CtsField **field, const CtsModel *model, const CtsPreset *preset, CtsError *err);
/* Any kernel: the layers across the view's principal axis are sheets, each voxel's kernel spread within its layer,
 * weights normalised at every position (except cone-paper) and voxels beyond the border counted as grey 0; between two
 * layers HU is linear. The limit of the splatting engines for ever finer tables and sub-sheets. The segments are cubics
 * fitted to 1e-3 HU (lit: the gradient's too). radius is in voxels; CTS_ERR_USAGE below 0.75. */
CtsStatus cts_field_kernel(CtsField **field, const CtsVolume *volume, const CtsView *view, CtsKernelId kernel,
                           double radius, const CtsPreset *preset, CtsError *err);
