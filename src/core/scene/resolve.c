#include "core/scene/resolve.h"

#include "base/cpu.h"
#include "base/mutation.h"
#include "base/vec3.h"
#include "core/scene/kernel.h"
#include "core/scene/settings.h"
#include <math.h>
#include <stdlib.h>

CtsStatus cts_scene_check(const CtsRenderSettings *s, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (const CtsSettingRow *row = cts_setting_rows; row < cts_setting_rows + CTS_N_SETTING_ROWS && !st; row++) {
        const void *field = (const char *)s + row->at;
        if (!row->bounds)
            continue;
        const bool whole = cts_setting_bounds(row->bounds)->whole;
        st = cts_setting_check(row->bounds, whole ? *(const int *)field : *(const double *)field, err);
    }
    if (!st && ((unsigned)s->engine > CTS_ENGINE_AUTO || (unsigned)s->kernel >= CTS_N_KERNELS ||
                (unsigned)s->level >= CTS_N_LEVELS))
        st = cts_fail(err, CTS_ERR_USAGE, "no such engine, kernel or level");
    if (!st && (!(s->slab_mm >= 0) || !isfinite(s->slab_mm) || !isfinite(s->slab_at_mm)))
        st = cts_fail(err, CTS_ERR_USAGE, "a slab of %g mm at %g mm (a positive thickness, a place in mm)", s->slab_mm,
                      s->slab_at_mm);
    if (!st && s->occlusion != CTS_OCCLUSION_AS_PRESET)
        st = cts_setting_check(CTS_SETTING_OCCLUSION, s->occlusion, err);
    if (!st && s->slab_at_mm != 0 && s->slab_mm == 0)
        st = cts_fail(err, CTS_ERR_USAGE, "a place for a slab that has no thickness (give `slab` MM as well)");
    if (!st && (s->mode < -1 || s->mode >= CTS_N_MODES))
        st = cts_fail(err, CTS_ERR_USAGE, "no such mode");
    return st;
}

CtsPreset cts_scene_preset(const CtsPreset *preset, const CtsRenderSettings *settings)
{
    CtsPreset p = *preset;
    if (settings->mode >= 0)
        p.mode = (CtsMode)settings->mode;
    if (settings->shade != CTS_AS_PRESET)
        p.shade = settings->shade == CTS_ON;
    if (settings->occlusion != CTS_OCCLUSION_AS_PRESET)
        p.occlusion = settings->occlusion;
    p.shade = p.shade && p.mode == CTS_MODE_COMPOSITE;
    return p;
}

CtsStatus cts_scene_init(CtsSceneStore *store, const CtsModel *model, const CtsPreset *preset,
                         const CtsRenderSettings *requested, CtsError *err)
{
    CtsStatus st;
    CtsPreset *p = &store->preset;
    CtsRenderSettings *s = &store->settings;
    *s = *requested;
    store->model = *model;
    if ((st = cts_scene_check(s, err)))
        return st;
    s->n_threads = cts_threads(s->n_threads);
    s->kernel_radius = cts_kernel_radius(s->kernel, s->kernel_radius);
    *p = cts_scene_preset(preset, s);
    if ((st = cts_preset_resolve(p, model->volume, err)))
        return st;
    CtsScene *scene = &store->scene;
    *scene =
        (CtsScene){.model = &store->model, .volume = model->volume, .preset = p, .settings = s, .extinction_scale = 1};
    scene->plan = (CtsPlan){.samples = s->samples, .max_error = s->max_error, .level = s->level};
    if ((st = cts_view_init(&scene->view, model->volume, s, err)))
        return st;
    if (s->slab_mm > 0)
        cts_view_set_slab(&scene->view, model->volume, s->slab_mm, s->slab_at_mm);
    if (s->centre_given)
        cts_view_aim(&scene->view, s->centre_lps);
    /* Slicer's GPU path hands its mapper voxels of unit spacing: a unit is then a voxel's length along the ray. */
    if (s->opacity_per_voxel)
        scene->extinction_scale = CTS_MUTATED(VOXEL_LENGTH) ? fabs(scene->view.forward_vox[scene->view.axis])
                                                            : cts_norm3(scene->view.forward_vox);
    return CTS_OK;
}

void *cts_scene_cache(const CtsScene *scene, size_t size, CtsError *err)
{
    if (!*scene->cache && !(*scene->cache = calloc(1, size)))
        cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return *scene->cache;
}

const struct CtsBodyMask *cts_scene_body(const CtsScene *scene)
{
    const CtsMode mode = scene->preset->mode;
    return mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE ? scene->model->body : NULL;
}

void cts_scene_report_region(const CtsScene *scene, CtsReport *report)
{
    const CtsMode mode = scene->preset->mode;
    const CtsRenderSettings *s = scene->settings;
    if (s->slab_mm > 0)
        cts_report_plan(report, "a slab of %g mm across the view, its middle %g mm in front of the volume's centre",
                        s->slab_mm, s->slab_at_mm);
    if (cts_scene_body(scene))
        cts_report_plan(report, "mode %s: the inside of the body, 3 mm under the skin (`remove-table` off: everything)",
                        cts_mode_names[mode]);
    else if (mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE)
        cts_report_plan(report, "mode %s: everything in the volume, air around the body too", cts_mode_names[mode]);
}
