/* The camera: where each pixel's ray runs, in patient and in voxel coordinates (ctsplat(1), PICTURES).
 * Shared with the reference ray caster, so it holds geometry only. */
#pragma once

#include "ctsplat/render.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"

/* Unit vectors of a view, patient coordinates; forward is the viewing direction. */
typedef struct CtsViewAxes {
    double right_lps[3], up_lps[3], forward_lps[3];
} CtsViewAxes;
void cts_view_axes(CtsViewAxes *axes, double azimuth_deg, double elevation_deg);

typedef struct CtsView {
    int width, height; /* pixels */
    double mm_per_pixel;
    double azimuth_deg, elevation_deg;
    double right_lps[3], up_lps[3], forward_lps[3]; /* unit vectors; forward is the viewing direction */
    double centre_lps[3];
    /* The same in voxel coordinates: the centre, and voxels per mm along each direction. */
    double centre_vox[3], right_vox[3], up_vox[3], forward_vox[3];
    /* Nothing is visible outside 0..dims-1 (the box of voxel centres). */
    int dims[3];
    int axis;        /* principal axis: the volume axis nearest to the viewing direction, in voxel coordinates */
    int axis_sign;   /* +1: layers are crossed front to back in rising order */
    double layer_mm; /* length of a ray between two layers */
    /* Visible part of a ray: distances from the plane through the centre across the viewing direction. */
    double near_mm, far_mm;
} CtsView;

/* The camera of the settings: width, height, mm_per_pixel (0: the whole bounding box fits), azimuth_deg and
 * elevation_deg. CTS_ERR_GEOMETRY when the voxel steps do not span space. */
CtsStatus cts_view_init(CtsView *view, const CtsVolume *volume, const CtsRenderSettings *requested, CtsError *err);

/* Limits rays to a slab across the view, thickness_mm thick, its middle at_mm in front of the volume's centre. */
void cts_view_set_slab(CtsView *view, const CtsVolume *volume, double thickness_mm, double at_mm);

/* Moves the picture's centre, within its plane, to the projection of this point. */
void cts_view_aim(CtsView *view, const double centre_lps[3]);

/* Voxel coordinates of the intersection of pixel (x, y)'s ray with the plane through the volume's centre across the
 * viewing direction; the ray advances by forward_vox per mm. Pixel centres, x from the left, y from the top. */
void cts_view_ray(const CtsView *view, double x, double y, double start_vox[3]);
/* The same, and the part of the ray, in mm from there, that lies in the box of voxel centres and is visible; false
 * where it misses that by more than 1e-9 voxels, by which rounding must not lose a ray that runs along a face. From and
 * to are equal where it touches it. */
bool cts_view_clip(const CtsView *view, double x, double y, double start_vox[3], double *from_mm, double *to_mm);

/* Rows of pixels, this wide, whose error is controlled together: so many that they have 2^20 pixels, which bounds the
 * memory of a band; a multiple of CTS_BAND_ROWS. */
int cts_strip_rows(int width);
