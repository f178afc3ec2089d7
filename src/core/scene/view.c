#include "core/scene/view.h"

#include "base/compare.h"
#include "base/mutation.h"
#include "base/vec3.h"
#include <math.h>
#include <string.h>

/* sin and cos in degrees, exact at multiples of 90, so that axis views are axis-aligned to the last bit. */
static void sincos_deg(double deg, double *s, double *c)
{
    static const double sines[4] = {0, 1, 0, -1};
    const double turns = deg / 90, whole = nearbyint(turns);
    if (turns == whole) {
        const int quarter = (int)fmod(fmod(whole, 4) + 4, 4);
        *s = sines[quarter];
        *c = sines[(quarter + 1) % 4];
        return;
    }
    const double rad = deg * (M_PI / 180);
    *s = sin(rad);
    *c = cos(rad);
}

/* Removes components of 1e-17 from rounded trigonometry, which would make an axis view oblique. */
static void clean(double v[3])
{
    for (int c = 0; c < 3; c++)
        v[c] = fabs(v[c]) < 1e-15 * cts_norm3(v) ? 0 : v[c];
}

void cts_view_axes(CtsViewAxes *axes, double azimuth_deg, double elevation_deg)
{
    double sa, ca, se, ce;
    sincos_deg(azimuth_deg, &sa, &ca);
    sincos_deg(elevation_deg, &se, &ce);
    /* The camera is at sin(az) cos(el) to the left, cos(az) cos(el) to the front, sin(el) to the head. */
    const double forward[3] = {-sa * ce, ca * ce, -se}, right[3] = {ca, sa, 0};
    for (int c = 0; c < 3; c++) {
        axes->forward_lps[c] = forward[c] + 0.0;
        axes->right_lps[c] = right[c] + 0.0;
    }
    cts_cross3(axes->right_lps, axes->forward_lps, axes->up_lps);
    clean(axes->up_lps);
}

CtsStatus cts_view_init(CtsView *view, const CtsVolume *volume, const CtsRenderSettings *requested, CtsError *err)
{
    double inverse[3][3];
    CtsViewAxes axes;
    if (!cts_volume_inverse(volume, inverse))
        return cts_fail(err, CTS_ERR_GEOMETRY, "the volume's steps do not span space (is one spacing zero?)");
    const double diagonal_mm = cts_volume_diagonal_mm(volume);
    const int side = requested->width < requested->height ? requested->width : requested->height;
    const double fitting_mm = (diagonal_mm > 0 ? diagonal_mm : 1) / (0.95 * side);
    *view = (CtsView){.width = requested->width,
                      .height = requested->height,
                      .mm_per_pixel = requested->mm_per_pixel > 0 ? requested->mm_per_pixel : fitting_mm,
                      .azimuth_deg = requested->azimuth_deg,
                      .elevation_deg = requested->elevation_deg,
                      .near_mm = -INFINITY,
                      .far_mm = INFINITY};
    cts_view_axes(&axes, requested->azimuth_deg, requested->elevation_deg);
    memcpy(view->right_lps, axes.right_lps, sizeof view->right_lps);
    memcpy(view->up_lps, axes.up_lps, sizeof view->up_lps);
    memcpy(view->forward_lps, axes.forward_lps, sizeof view->forward_lps);
    for (int c = 0; c < 3 && CTS_MUTATED(MIRRORED); c++)
        view->right_lps[c] = -view->right_lps[c];
    cts_volume_centre_lps(volume, view->centre_lps);
    for (int axis = 0; axis < 3; axis++) {
        view->dims[axis] = volume->dims[axis];
        view->centre_vox[axis] = 0.5 * (cts_volume_extent(volume, axis) - 1) - volume->air_before[axis];
    }
    cts_apply3(inverse, view->right_lps, view->right_vox);
    cts_apply3(inverse, view->up_lps, view->up_vox);
    cts_apply3(inverse, view->forward_lps, view->forward_vox);
    clean(view->right_vox);
    clean(view->up_vox);
    clean(view->forward_vox);
    /* Ties go to the later axis, within a margin of rounding, so that the choice at 45 degrees does not depend on the
     * last bit. */
    for (int axis = 1; axis < 3; axis++)
        if (fabs(view->forward_vox[axis]) >= fabs(view->forward_vox[view->axis]) * (1 - 1e-12))
            view->axis = axis;
    view->axis_sign = view->forward_vox[view->axis] > 0 ? 1 : -1;
    view->layer_mm = 1 / fabs(view->forward_vox[view->axis]);
    return CTS_OK;
}

void cts_view_set_slab(CtsView *view, const CtsVolume *volume, double thickness_mm, double at_mm)
{
    double centre[3];
    cts_volume_centre_lps(volume, centre);
    for (int c = 0; c < 3; c++)
        centre[c] -= view->centre_lps[c];
    const double middle_mm = cts_dot3(centre, view->forward_lps) - at_mm;
    view->near_mm = middle_mm - thickness_mm / 2;
    view->far_mm = middle_mm + thickness_mm / 2;
}

void cts_view_aim(CtsView *view, const double centre_lps[3])
{
    double offset[3];
    for (int c = 0; c < 3; c++)
        offset[c] = centre_lps[c] - view->centre_lps[c];
    const double u_mm = cts_dot3(offset, view->right_lps), v_mm = cts_dot3(offset, view->up_lps);
    for (int c = 0; c < 3; c++) {
        view->centre_lps[c] += u_mm * view->right_lps[c] + v_mm * view->up_lps[c];
        view->centre_vox[c] += u_mm * view->right_vox[c] + v_mm * view->up_vox[c];
    }
}

void cts_view_ray(const CtsView *view, double x, double y, double start_vox[3])
{
    const double u_mm = (x + (CTS_MUTATED(HALF_PIXEL) ? 0 : 0.5) - view->width / 2.0) * view->mm_per_pixel;
    const double v_mm = (view->height / 2.0 - y - 0.5) * view->mm_per_pixel;
    for (int axis = 0; axis < 3; axis++)
        start_vox[axis] = view->centre_vox[axis] + u_mm * view->right_vox[axis] + v_mm * view->up_vox[axis];
}

bool cts_view_clip(const CtsView *view, double x, double y, double start_vox[3], double *from_mm, double *to_mm)
{
    const double slack_vox = 1e-9;
    double from = -INFINITY, to = INFINITY, fastest = 0;
    cts_view_ray(view, x, y, start_vox);
    for (int a = 0; a < 3; a++) {
        const double last = view->dims[a] - 1, step = view->forward_vox[a];
        if (step == 0 && (start_vox[a] < -slack_vox || start_vox[a] > last + slack_vox))
            return false;
        if (step == 0)
            continue;
        const double in = (0 - start_vox[a]) / step, out = (last - start_vox[a]) / step;
        from = cts_larger_double(from, cts_smaller_double(in, out));
        to = cts_smaller_double(to, cts_larger_double(in, out));
        fastest = cts_larger_double(fastest, fabs(step));
    }
    if (to < from && (from - to) * fastest <= slack_vox)
        to = from;
    *from_mm = cts_larger_double(from, view->near_mm);
    *to_mm = cts_smaller_double(to, view->far_mm);
    return *to_mm >= *from_mm;
}

int cts_strip_rows(int width)
{
    enum { PIXELS = 1 << 20 };
    const int rows = PIXELS / width / CTS_BAND_ROWS * CTS_BAND_ROWS;
    return rows > CTS_BAND_ROWS ? rows : CTS_BAND_ROWS;
}
