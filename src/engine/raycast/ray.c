#include "engine/raycast/field.h"

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
