/* Linear fields, in any view. */
#include "lab/check/suite.h"

#include <math.h>

typedef struct LinearScene {
    const CtsFormulaScene *linear;
    const CtsVolume *volume;
    const CtsPreset *preset;
    double scale, gradient_mm[3], gradient_length;
} LinearScene;

static double linear_hu_at(const LinearScene *s, const CtsTruthRay *ray, double t_mm)
{
    double vox[3];
    cts_truth_ray_voxel(s->volume, ray, t_mm, vox);
    return cts_hu_linear(vox, s->linear->hu);
}

static void linear_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    const LinearScene *s = data;
    CtsTruthInterval interval = {linear_hu_at(s, ray, ray->from_mm), linear_hu_at(s, ray, ray->to_mm),
                                 ray->to_mm - ray->from_mm, -1};
    const CtsPreset *p = s->preset;
    if (p->mode != CTS_MODE_COMPOSITE) {
        const double hu = p->mode == CTS_MODE_MIP     ? fmax(interval.hu0, interval.hu1)
                          : p->mode == CTS_MODE_MINIP ? fmin(interval.hu0, interval.hu1)
                                                      : 0.5 * (interval.hu0 + interval.hu1);
        rgba[0] = (hu - p->window_low_hu) / (p->window_high_hu - p->window_low_hu);
        rgba[0] = rgba[1] = rgba[2] = fmin(fmax(rgba[0], 0), 1);
        rgba[3] = 1;
        return;
    }
    if (p->shade) {
        interval.facing = 0;
        for (int c = 0; c < 3 && s->gradient_length > 0; c++)
            interval.facing += s->gradient_mm[c] * ray->direction_lps[c] / s->gradient_length;
        interval.facing = fabs(interval.facing);
    }
    cts_truth_intervals(p, s->scale, &interval, 1, rgba);
}

/* The field's gradient in mm: differences of HU over a millimetre along each patient axis. */
static void find_gradient(LinearScene *s)
{
    double length2 = 0;
    for (int c = 0; c < 3; c++) {
        double va[3], vb[3];
        const double *const o = s->volume->origin_lps;
        cts_truth_voxel(s->volume, o, va);
        cts_truth_voxel(s->volume, (const double[3]){o[0] + (c == 0), o[1] + (c == 1), o[2] + (c == 2)}, vb);
        s->gradient_mm[c] = cts_hu_linear(vb, s->linear->hu) - cts_hu_linear(va, s->linear->hu);
        length2 += s->gradient_mm[c] * s->gradient_mm[c];
    }
    s->gradient_length = sqrt(length2);
}

/* Voxels per millimetre of ray, the unit of --opacity-unit voxel. */
static double voxels_per_mm(const CtsVolume *volume, const CtsFormulaScene *l)
{
    const CtsTruthCamera camera = {l->azimuth_deg, l->elevation_deg, 1, 1, 1};
    CtsTruthRay ray;
    double a[3], b[3];
    if (!cts_truth_ray(volume, &camera, 0, 0, &ray))
        return 1;
    cts_truth_ray_voxel(volume, &ray, 0, a);
    cts_truth_ray_voxel(volume, &ray, 1, b);
    return hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
}

CtsStatus cts_check_linear_scene(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsFormulaScene *l = data;
    const double bound = cts_check_bound(run, l);
    CtsRenderedScene m;
    if (bound == CHECK_NONE)
        return CTS_OK;
    CtsStatus st = cts_check_make(run, l, &m, err);
    if (st)
        return st;
    LinearScene scene = {.linear = l, .volume = m.model.volume, .preset = &m.preset, .scale = 1};
    if (l->per_voxel)
        scene.scale = voxels_per_mm(m.model.volume, l);
    find_gradient(&scene);
    st = cts_check_picture(run, &m, linear_truth, &scene, bound, err);
    cts_model_free(&m.model);
    return st;
}
