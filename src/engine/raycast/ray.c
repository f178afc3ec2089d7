#include "engine/raycast/field.h"

#include "core/scene/shade.h"
#include <math.h>

bool cts_ray_of_pixel(const CtsView *view, double x, double y, CtsRay *ray)
{
    const double slack_vox = 1e-9;
    cts_view_ray(view, x, y, ray->start_vox);
    double t0 = -INFINITY, t1 = INFINITY, fastest = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double last = view->dims[axis] - 1, step = view->forward_vox[axis];
        ray->step_vox[axis] = step;
        double *start = &ray->start_vox[axis];
        if (step == 0) {
            if (*start < -slack_vox || *start > last + slack_vox)
                return false;
            *start = fmin(fmax(*start, 0), last);
            continue;
        }
        fastest = fmax(fastest, fabs(step));
        const double a = -*start / step, b = (last - *start) / step;
        t0 = fmax(t0, fmin(a, b));
        t1 = fmin(t1, fmax(a, b));
    }
    if (t1 < t0 && (t0 - t1) * fastest <= slack_vox)
        t0 = t1 = 0.5 * (t0 + t1);
    ray->t0_mm = fmax(t0, view->near_mm);
    ray->t1_mm = fmin(t1, view->far_mm);
    return ray->t1_mm >= ray->t0_mm;
}

double cts_field_difference(const CtsVolume *volume, const int voxel[3], int axis, bool air_beyond)
{
    const size_t stride[3] = {1, (size_t)volume->dims[0], (size_t)volume->dims[0] * (size_t)volume->dims[1]};
    const int at = voxel[axis], n = volume->dims[axis], step = cts_shade_step(volume, axis);
    const size_t away = stride[axis] * (size_t)step;
    const uint16_t *const v =
        volume->grey + (size_t)voxel[0] + (size_t)voxel[1] * stride[1] + (size_t)voxel[2] * stride[2];
    const bool before = at >= step, after = at < n - step;
    const double beyond = air_beyond ? 0 : *v;
    const double rise = (after ? (double)v[away] : beyond) - (before ? (double)*(v - away) : beyond);
    return n == 1 ? 0 : rise / ((air_beyond || (before && after) ? 2 : 1) * step);
}
