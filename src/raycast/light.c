#include "base/vec3.h"
#include "raycast/raycaster.h"
#include <math.h>

void cts_raycast_shade(const CtsRaycaster *caster, const double gradient[3], double rgb[3])
{
    const CtsPreset *p = caster->preset;
    double in_mm[3], across = 0, specular = 0;
    cts_apply3(caster->metric, gradient, in_mm);
    const double length2 = cts_dot3(gradient, in_mm);
    if (cts_dot3(gradient, gradient) > caster->least_gradient2 && length2 > 0) {
        across = fmin(fabs(cts_dot3(gradient, caster->view.forward_vox)) / sqrt(length2), 1);
        specular = p->specular * pow(across, p->power);
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = rgb[c] * (p->ambient + p->diffuse * across) + specular;
}
