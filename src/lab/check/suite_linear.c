#include "lab/check/suite_linear.h"

#include <math.h>
#include <string.h>

typedef struct Scene {
    const CtsLinearScene *linear;
    const CtsVolume *volume;
    const CtsPreset *preset;
    double scale, gradient_mm[3], gradient_length;
} Scene;

static double hu_at(const Scene *s, const CtsTruthRay *ray, double t_mm)
{
    double point[3], vox[3];
    cts_truth_ray_point(ray, t_mm, point);
    cts_truth_voxel(s->volume, point, vox);
    return cts_hu_linear(vox, s->linear->hu);
}

static void truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    const Scene *s = data;
    if (!ray)
        return;
    CtsTruthStretch stretch = {hu_at(s, ray, ray->from_mm), hu_at(s, ray, ray->to_mm), ray->to_mm - ray->from_mm, -1};
    const CtsPreset *p = s->preset;
    if (p->mode != CTS_MODE_COMPOSITE) {
        const double hu = p->mode == CTS_MODE_MIP     ? fmax(stretch.hu0, stretch.hu1)
                          : p->mode == CTS_MODE_MINIP ? fmin(stretch.hu0, stretch.hu1)
                                                      : 0.5 * (stretch.hu0 + stretch.hu1);
        rgba[0] = (hu - p->window_low_hu) / (p->window_high_hu - p->window_low_hu);
        rgba[0] = rgba[1] = rgba[2] = fmin(fmax(rgba[0], 0), 1);
        rgba[3] = 1;
        return;
    }
    if (p->shade) {
        stretch.facing = 0;
        for (int c = 0; c < 3 && s->gradient_length > 0; c++)
            stretch.facing += s->gradient_mm[c] * ray->direction_lps[c] / s->gradient_length;
        stretch.facing = fabs(stretch.facing);
    }
    cts_truth_stretches(p, s->scale, &stretch, 1, rgba);
}

/* The field's gradient in mm: differences of HU over a millimetre along each patient axis. */
static void find_gradient(Scene *s)
{
    double length2 = 0;
    for (int c = 0; c < 3; c++) {
        double a[3], b[3], va[3], vb[3];
        memcpy(a, s->volume->origin_lps, sizeof a);
        memcpy(b, a, sizeof b);
        b[c] += 1;
        cts_truth_voxel(s->volume, a, va);
        cts_truth_voxel(s->volume, b, vb);
        s->gradient_mm[c] = cts_hu_linear(vb, s->linear->hu) - cts_hu_linear(va, s->linear->hu);
        length2 += s->gradient_mm[c] * s->gradient_mm[c];
    }
    s->gradient_length = sqrt(length2);
}

/* Voxels that a millimetre of ray crosses: what --opacity-unit voxel counts by. */
static double voxels_per_mm(const CtsVolume *volume, const CtsTruthCamera *camera)
{
    CtsTruthRay ray;
    double a[3], b[3], va[3], vb[3];
    if (!cts_truth_ray(volume, camera, camera->width / 2.0 - 0.5, camera->height / 2.0 - 0.5, &ray))
        return 1;
    cts_truth_ray_point(&ray, 0, a);
    cts_truth_ray_point(&ray, 1, b);
    cts_truth_voxel(volume, a, va);
    cts_truth_voxel(volume, b, vb);
    return hypot(hypot(vb[0] - va[0], vb[1] - va[1]), vb[2] - va[2]);
}

static CtsPreset make_preset(const CtsLinearScene *l)
{
    CtsPreset p = cts_check_preset(l->points, l->n_points);
    p.mode = (CtsMode)l->mode;
    p.unit_distance_mm = l->unit_mm > 0 ? l->unit_mm : 1;
    p.shade = l->lit;
    p.ambient = 0.2;
    p.diffuse = 0.7;
    p.specular = 0.3;
    p.power = l->power > 0 ? l->power : 12;
    return p;
}

CtsStatus cts_check_linear_scene(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsLinearScene *l = data;
    const double bound = l->bound[cts_check_family(run->engine)];
    if (bound == CHECK_NONE)
        return CTS_OK;
    CtsVolume *volume = NULL;
    double spacing[3];
    for (int a = 0; a < 3; a++)
        spacing[a] = l->spacing_mm[a] > 0 ? l->spacing_mm[a] : 1;
    CtsStatus st =
        cts_check_volume(&volume, l->dims, spacing, l->hu_step > 0 ? l->hu_step : 1, cts_hu_linear, l->hu, err);
    if (st)
        return st;
    volume->step_lps[2][1] = l->lean * spacing[2];
    const CtsPreset preset = make_preset(l);
    CtsRenderSettings settings = cts_check_settings(run, l->width > 0 ? l->width : 24, l->height > 0 ? l->height : 24);
    settings.azimuth_deg = l->azimuth_deg;
    settings.elevation_deg = l->elevation_deg;
    settings.mm_per_pixel = l->mm_per_pixel;
    settings.samples = l->samples;
    settings.kernel = l->kernel;
    settings.opacity_per_voxel = l->per_voxel;
    Scene scene = {.linear = l, .volume = volume, .preset = &preset, .scale = 1};
    const CtsTruthCamera camera = {l->azimuth_deg, l->elevation_deg, l->mm_per_pixel, settings.width, settings.height};
    if (l->per_voxel)
        scene.scale = voxels_per_mm(volume, &camera);
    find_gradient(&scene);
    st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &settings, truth, &scene}, bound, err);
    cts_volume_free(&volume);
    return st;
}
