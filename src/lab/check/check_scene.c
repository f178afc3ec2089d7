#include "lab/check/check_scene.h"

#include <math.h>
#include <string.h>

CtsStatus cts_check_volume(CtsVolume **volume, const int dims[3], const double spacing_mm[3], double hu_step,
                           CtsHuFormula hu, const void *data, CtsError *err)
{
    const CtsStatus st = cts_volume_new(volume, dims[0], dims[1], dims[2], err);
    if (st)
        return st;
    CtsVolume *v = *volume;
    v->hu_step = hu_step;
    for (int axis = 0; axis < 3; axis++)
        v->step_lps[axis][axis] = spacing_mm[axis];
    size_t at = 0;
    v->hu_min = INFINITY;
    v->hu_max = -INFINITY;
    for (int k = 0; k < dims[2]; k++)
        for (int j = 0; j < dims[1]; j++)
            for (int i = 0; i < dims[0]; i++) {
                const double vox[3] = {i, j, k};
                const double grey = floor((hu(vox, data) - v->hu_offset) / hu_step + 0.5);
                v->grey[at] = (uint16_t)fmin(fmax(grey, 0), 65535);
                v->hu_min = fmin(v->hu_min, cts_volume_hu(v, v->grey[at]));
                v->hu_max = fmax(v->hu_max, cts_volume_hu(v, v->grey[at]));
                at++;
            }
    return CTS_OK;
}

double cts_hu_linear(const double vox[3], const void *data)
{
    const double *c = data;
    return c[0] + c[1] * vox[0] + c[2] * vox[1] + c[3] * vox[2];
}

double cts_hu_constant(const double vox[3], const void *data)
{
    (void)vox;
    return *(const double *)data;
}

CtsPreset cts_check_preset(const CtsCheckPoint *points, int n)
{
    CtsPreset p;
    memset(&p, 0, sizeof p);
    strcpy(p.name, "check");
    p.window_high_hu = 1000;
    p.mode = CTS_MODE_COMPOSITE;
    p.unit_distance_mm = 1;
    p.n_opacity = p.n_colour = n;
    for (int i = 0; i < n; i++) {
        p.opacity[i].hu = p.colour[i].hu = points[i].hu;
        p.opacity[i].opacity = points[i].opacity;
        memcpy(p.colour[i].rgb, points[i].rgb, sizeof points[i].rgb);
    }
    return p;
}

CtsPreset cts_check_even_preset(double opacity, double red, double green, double blue)
{
    const CtsCheckPoint point = {0, opacity, {red, green, blue}};
    return cts_check_preset(&point, 1);
}
