/* The reference engine: every ray by itself in float64. Shares geometry, preset and the engine's row with splatting. */
#include "engine/raycast/raycast.h"

#include "base/clamp.h"
#include "base/clock.h"
#include "base/parallel.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/raycaster.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static CtsStatus make_field(CtsField **field, const CtsScene *scene, CtsError *err)
{
    const CtsRenderSettings *s = scene->settings;
    if (s->kernel == CTS_KERNEL_TENT && s->kernel_radius == 1)
        return cts_field_trilinear(field, scene->model, scene->preset, err);
    return cts_field_kernel(field, scene->volume, &scene->view, s->kernel, s->kernel_radius, scene->preset, err);
}

/* A label's own appearance may show any HU. */
static CtsStatus make_transfers(CtsRaycaster *r, const CtsScene *scene, CtsError *err)
{
    cts_transfer_init(&r->transfer, scene->preset, scene->extinction_scale);
    r->wanted = r->transfer.visible;
    if (!r->voxel_labels)
        return CTS_OK;
    r->appearances = calloc((size_t)r->voxel_labels->n_appearances, sizeof *r->appearances);
    if (!r->appearances)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int l = CTS_APPEARANCE_PRESET; l < r->voxel_labels->n_appearances; l++) {
        CtsPreset own;
        cts_appearance_preset(&r->voxel_labels->appearances[l], scene->preset, &own);
        cts_transfer_init(&r->appearances[l], &own, scene->extinction_scale);
    }
    if (cts_voxel_labels_coloured(r->voxel_labels))
        r->wanted = (CtsHuRanges){.n = 1, .range = {{-INFINITY, INFINITY}}};
    return CTS_OK;
}

CtsStatus cts_raycaster_new(CtsRaycaster **caster, const CtsScene *scene, const CtsField *field, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsRaycaster *r = *caster = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    r->preset = scene->preset;
    r->view = scene->view;
    r->body = cts_scene_body(scene);
    r->openness = scene->openness;
    r->voxel_labels = field ? NULL : scene->model->voxel_labels;
    r->field = field;
    cts_gauss_init(&r->coarse, CTS_GAUSS_COARSE);
    cts_gauss_init(&r->fine, CTS_GAUSS_FINE);
    if (scene->preset->mode == CTS_MODE_COMPOSITE)
        st = make_transfers(r, scene, err);
    memcpy(r->frame[0], r->view.right_vox, sizeof r->frame[0]);
    memcpy(r->frame[1], r->view.up_vox, sizeof r->frame[1]);
    memcpy(r->frame[2], r->view.forward_vox, sizeof r->frame[2]);
    r->camera_mm = 0.5 * cts_volume_diagonal_mm(scene->volume);
    r->least_gradient2 = 1e-18 * scene->volume->hu_step * scene->volume->hu_step;
    if (!st && !field)
        st = make_field(&r->own_field, scene, err);
    if (r->own_field)
        r->field = r->own_field;
    if (st)
        cts_raycaster_free(caster);
    return st;
}

void cts_raycaster_free(CtsRaycaster **caster)
{
    if (!*caster)
        return;
    free((*caster)->own_field);
    free((*caster)->appearances);
    free(*caster);
    *caster = NULL;
}

/* A segment of a ray, interval by interval of equal appearance. */
static bool composite_segment(const CtsRaycaster *caster, const CtsRayWalk *walk, const CtsRaySegment *segment,
                              const double (*gradient)[4], CtsRaySum *light)
{
    CtsRayInterval interval[CTS_MAX_RAY_INTERVALS];
    if (!caster->voxel_labels)
        return cts_raycast_segment(caster, &caster->transfer, walk->ray, segment, gradient, light);
    const int n = cts_raycast_label_intervals(caster->voxel_labels, walk, interval);
    bool lit = true;
    for (int i = 0; i < n && lit; i++) {
        const double from = interval[i].from, to = interval[i].to, length_mm = segment->t1_mm - segment->t0_mm;
        CtsRaySegment part = {segment->t0_mm + from * length_mm, segment->t0_mm + to * length_mm, {0}};
        double parts[3][4];
        if (interval[i].appearance == CTS_APPEARANCE_HIDDEN)
            continue;
        cts_cubic_part(segment->hu, from, to, part.hu);
        for (int a = 0; a < 3 && gradient; a++)
            cts_cubic_part(gradient[a], from, to, parts[a]);
        lit = cts_raycast_segment(caster, &caster->appearances[interval[i].appearance], walk->ray, &part,
                                  gradient ? (const double(*)[4])parts : NULL, light);
    }
    return lit;
}

static void composite_ray(const CtsRaycaster *caster, const CtsRay *ray, double rgba[4], double *surface_mm)
{
    const CtsField *field = caster->field;
    CtsRaySum light = {.transmittance = 1, .surface_mm = INFINITY};
    CtsRayWalk walk = {.ray = ray, .wanted = &caster->wanted, .t_mm = ray->t0_mm};
    CtsRaySegment segment;
    bool lit = true;
    while (lit && ray->t1_mm > ray->t0_mm && field->next(field, &walk, &segment)) {
        double gradient[3][4];
        if (caster->preset->shade)
            field->gradient(field, &walk, &segment, gradient);
        lit = composite_segment(caster, &walk, &segment, caster->preset->shade ? (const double(*)[4])gradient : NULL,
                                &light);
    }
    for (int c = 0; c < 3; c++)
        rgba[c] = light.rgb[c];
    rgba[3] = -expm1(-light.depth);
    *surface_mm = light.surface_mm;
}

static void window_ray(const CtsRaycaster *caster, const CtsRay *ray, double rgba[4])
{
    const CtsPreset *p = caster->preset;
    const double width = p->window_high_hu - p->window_low_hu;
    double hu;
    if (!cts_raycast_extreme(caster, ray, &hu))
        return;
    const double shown = width != 0 ? (hu - p->window_low_hu) / width : hu >= p->window_low_hu;
    rgba[0] = rgba[1] = rgba[2] = fmin(fmax(shown, 0), 1);
    rgba[3] = 1;
}

void cts_raycast_ray(const CtsRaycaster *caster, double x, double y, double rgba[4], double *depth_mm)
{
    CtsRay ray;
    double surface_mm = INFINITY;
    for (int c = 0; c < 4; c++)
        rgba[c] = 0;
    memcpy(ray.step_vox, caster->view.forward_vox, sizeof ray.step_vox);
    if (cts_view_clip(&caster->view, x, y, ray.start_vox, &ray.t0_mm, &ray.t1_mm)) {
        if (caster->preset->mode == CTS_MODE_COMPOSITE)
            composite_ray(caster, &ray, rgba, &surface_mm);
        else
            window_ray(caster, &ray, rgba);
    }
    if (depth_mm)
        *depth_mm = surface_mm + caster->camera_mm;
}

typedef struct RayList {
    const CtsScene *scene;
    const CtsRaycaster *caster;
    const int (*xy)[2];
    double (*rgba)[4];
} RayList;

static void cast_rays(void *context, int worker, size_t first, size_t end)
{
    const RayList *const r = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(r->scene); i++)
        cts_raycast_ray(r->caster, r->xy[i][0], r->xy[i][1], r->rgba[i], NULL);
}

CtsStatus cts_raycast_pixels(const CtsScene *scene, const int (*xy)[2], size_t n, double (*rgba)[4], CtsError *err)
{
    CtsRaycaster *caster;
    const CtsStatus st = cts_raycaster_new(&caster, scene, NULL, err);
    if (st)
        return st;
    RayList rays = {scene, caster, xy, rgba};
    cts_parallel(scene->settings->n_threads, n, 16, cast_rays, &rays);
    cts_raycaster_free(&caster);
    return cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}

typedef struct PictureRows {
    const CtsScene *scene;
    const CtsRaycaster *caster;
    CtsPicture *picture;
} PictureRows;

static void render_rows(void *context, int worker, size_t first, size_t end)
{
    const PictureRows *const r = context;
    CtsPicture *const p = r->picture;
    const bool is_grey = r->caster->preset->mode != CTS_MODE_COMPOSITE;
    const size_t width = (size_t)p->width;
    (void)worker;
    for (size_t at = first * width; at < end * width && !cts_scene_stopped(r->scene); at++) {
        double rgba[4], depth_mm;
        cts_raycast_ray(r->caster, (int)(at % width), p->first_row + (int)(at / width), rgba, &depth_mm);
        for (size_t c = 0; c < 4; c++)
            p->pixels[4 * at + c] = is_grey ? cts_clamp_to_level(rgba[c]) : (float)rgba[c];
        if (p->depth_mm)
            p->depth_mm[at] = (float)depth_mm;
    }
}

static CtsStatus render(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                        CtsError *err)
{
    (void)errors;
    cts_report_plan(report, "each pixel by itself, in float64, split at cell faces%s",
                    scene->preset->mode == CTS_MODE_COMPOSITE
                        ? " and at the preset's points, Gauss-Legendre in between until converged to 1e-7"
                        : ", extremes and means of the cubic in each cell exactly");
    cts_scene_report_region(scene, report);
    if (!picture)
        return CTS_OK;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const size_t n = (size_t)picture->width * (size_t)picture->height;
    CtsRaycaster *caster;
    const CtsStatus st = cts_raycaster_new(&caster, scene, NULL, err);
    if (st)
        return st;
    PictureRows rows = {scene, caster, picture};
    cts_parallel(scene->settings->n_threads, (size_t)picture->height, 1, render_rows, &rows);
    cts_raycaster_free(&caster);
    cts_report_stage(report, CTS_STAGE_COMPOSITE, cts_wall_ms() - wall, cts_cpu_ms() - cpu, n, 0);
    return cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}

const CtsEngine cts_engine_raycast = {
    .name = "raycast",
    .render = render,
    .is_reference = true,
    .supports_slabs = true,
    .supports_labels = true,
    .modes = 1u << CTS_MODE_COMPOSITE | 1u << CTS_MODE_MIP | 1u << CTS_MODE_MINIP | 1u << CTS_MODE_AVERAGE,
    .kernels = (1u << CTS_N_KERNELS) - 1,
};
