#include "base/vec3.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/raycaster.h"

void cts_raycast_shade(const CtsRaycaster *caster, const double gradient[3], double openness, double rgb[3])
{
    const CtsPreset *p = caster->preset;
    double framed[3], across = 0, specular = 0;
    cts_apply3(caster->frame, gradient, framed);
    const double length2 = cts_dot3(framed, framed);
    if (cts_dot3(gradient, gradient) > caster->least_gradient2 && length2 > 0) {
        across = fmin(fabs(framed[2]) / sqrt(length2), 1);
        specular = p->specular * pow(across, p->power);
    }
    const double open = 1 - p->occlusion * (1 - openness);
    const double colour = p->ambient * open + p->diffuse * across * (1 - p->occlusion + p->occlusion * open);
    for (int c = 0; c < 3; c++)
        rgb[c] = rgb[c] * colour + specular * open;
}

/* A curve lies in every cone, and beyond every plane, in which all its Bezier points lie. |n.v|^power falls to 1/e
 * within sqrt(2 / power) of the normal of the highlight's peak: in a cone of twice that, with a speed that varies
 * 16-fold at most (the square of the lengths' ratio), the rules' nodes resolve it. */
bool cts_raycast_normal_is_steady(const CtsRaycaster *caster, const double (*framed)[4], double a, double b)
{
    const double least_ratio = 0.25, max_tan2 = 8 / (2 + caster->preset->power);
    double point[4][3], middle[3];
    for (int axis = 0; axis < 3; axis++) {
        double at[4];
        cts_cubic_bezier(framed[axis], a, b, at);
        middle[axis] = at[0] + at[1] + at[2] + at[3];
        for (int i = 0; i < 4; i++)
            point[i][axis] = at[i];
    }
    const double middle2 = cts_dot3(middle, middle);
    double least = INFINITY, most = 0;
    for (int i = 0; i < 4; i++) {
        const double along = cts_dot3(point[i], middle);
        if (cts_dot3(point[i], point[i]) * middle2 > (1 + max_tan2) * along * along)
            return false;
        least = fmin(least, along);
        most = fmax(most, along);
    }
    return least >= least_ratio * most;
}
