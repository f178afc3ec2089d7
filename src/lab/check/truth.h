/* True values of pixels from formulas: closed forms along linear segments of HU, and rays through a volume's box in
 * patient millimetres. Shares no code with the renderers, which it validates. */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/volume.h"
#include <stdbool.h>

/* An interval of a ray along which HU runs in a straight line. facing is |n.v|, or negative where unlit. */
typedef struct CtsTruthInterval {
    double hu0, hu1, length_mm, facing;
} CtsTruthInterval;

/* Premultiplied red, green, blue and alpha of intervals one behind the other, front first, by closed forms for the
 * depth and tanh-sinh quadrature for colours that change: good to 1e-10. extinction_scale as in CtsScene. */
void cts_truth_intervals(const CtsPreset *preset, double extinction_scale, const CtsTruthInterval *intervals, int n,
                         double rgba[4]);

/* The same for each value of opacity separately: transmittance starts zeroed. */
typedef struct CtsTruthSum {
    double rgb[3], depth;
} CtsTruthSum;
void cts_truth_add(const CtsPreset *preset, double extinction_scale, const CtsTruthInterval *interval,
                   CtsTruthSum *light);
void cts_truth_pixel(const CtsTruthSum *light, double rgba[4]);

/* Integral of f over a..b by tanh-sinh quadrature; f may be steep or singular at the ends. */
double cts_truth_integral(double (*f)(double x, const void *data), const void *data, double a, double b);

/* The ray of a picture position by the geometry of ctsplat(1), PICTURES: a point on the central plane and the viewing
 * direction. */
typedef struct CtsTruthCamera {
    double azimuth_deg, elevation_deg, mm_per_pixel; /* mm_per_pixel 0: the default scale */
    int width, height;
} CtsTruthCamera;

typedef struct CtsTruthRay {
    double point_lps[3], direction_lps[3];
    double from_mm, to_mm; /* inside the box of voxel centres, along direction from point */
} CtsTruthRay;

/* False when the ray misses the box. */
bool cts_truth_ray(const CtsVolume *volume, const CtsTruthCamera *camera, double x, double y, CtsTruthRay *ray);
/* The pixel of a ray through a volume, trilinear between its voxels, by short linear segments in every cell: accurate
 * to 1e-4 where opacity steps, unless the ray grazes the step, elsewhere to 1e-6. Composite; the volume has 2 voxels or
 * more along each axis. */
void cts_truth_volume(const CtsVolume *volume, const CtsPreset *preset, const CtsTruthRay *ray, double rgba[4]);

/* Voxel coordinates of a point in patient millimetres. */
void cts_truth_voxel(const CtsVolume *volume, const double point_lps[3], double vox[3]);
void cts_truth_ray_point(const CtsTruthRay *ray, double t_mm, double point_lps[3]);
void cts_truth_ray_voxel(const CtsVolume *volume, const CtsTruthRay *ray, double t_mm, double vox[3]);
