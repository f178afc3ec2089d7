#include "scene/resolve.h"

#include "base/cpu.h"
#include "base/vec3.h"
#include "scene/kernel.h"
#include <math.h>

static CtsStatus check_settings(const CtsRenderSettings *s, CtsError *err)
{
    if (s->width < 1 || s->width > 32768 || s->height < 1 || s->height > 32768)
        return cts_fail(err, CTS_ERR_USAGE, "a picture of %d x %d pixels (1 to 32768 each)", s->width, s->height);
    if (!isfinite(s->mm_per_pixel) || s->mm_per_pixel < 0)
        return cts_fail(err, CTS_ERR_USAGE, "%g mm per pixel (a positive number)", s->mm_per_pixel);
    if (!isfinite(s->azimuth_deg) || fabs(s->azimuth_deg) > 36000 || !(fabs(s->elevation_deg) <= 90))
        return cts_fail(err, CTS_ERR_USAGE, "view %g,%g (azimuth in degrees, elevation -90 to 90)", s->azimuth_deg,
                        s->elevation_deg);
    if ((unsigned)s->engine >= CTS_N_ENGINES || (unsigned)s->kernel >= CTS_N_KERNELS)
        return cts_fail(err, CTS_ERR_USAGE, "no such engine or kernel");
    if (!(s->kernel_radius >= 0 && s->kernel_radius <= 4))
        return cts_fail(err, CTS_ERR_USAGE, "kernel radius %g (at most 4 voxels)", s->kernel_radius);
    if (s->samples < 0 || s->samples > 64)
        return cts_fail(err, CTS_ERR_USAGE, "%d samples per layer (1 to 64)", s->samples);
    if (!(s->max_error >= 0) || !(s->tolerance_hu >= 0) || !isfinite(s->max_error) || !isfinite(s->tolerance_hu))
        return cts_fail(err, CTS_ERR_USAGE, "an error or tolerance below 0");
    if (s->grey_bits < 8 || s->grey_bits > 16)
        return cts_fail(err, CTS_ERR_USAGE, "%d bits of grey (8 to 16)", s->grey_bits);
    if (!(s->slab_mm >= 0) || !isfinite(s->slab_mm) || !isfinite(s->slab_at_mm))
        return cts_fail(err, CTS_ERR_USAGE, "a slab of %g mm at %g mm (a positive thickness, a place in mm)",
                        s->slab_mm, s->slab_at_mm);
    if (s->slab_at_mm != 0 && s->slab_mm == 0)
        return cts_fail(err, CTS_ERR_USAGE, "a place for a slab that has no thickness (give --slab MM as well)");
    if (s->mode < -1 || s->mode >= CTS_N_MODES || s->verify < 0)
        return cts_fail(err, CTS_ERR_USAGE, "no such mode, or fewer than 0 pixels to verify");
    return CTS_OK;
}

CtsStatus cts_scene_init(CtsSceneStore *store, const CtsVolume *volume, const CtsPreset *preset,
                         const CtsRenderSettings *asked, CtsError *err)
{
    CtsStatus st;
    CtsPreset *p = &store->preset;
    CtsRenderSettings *s = &store->settings;
    *p = *preset;
    *s = *asked;
    if ((st = check_settings(s, err)))
        return st;
    s->n_threads = cts_threads(s->n_threads);
    s->kernel_radius = cts_kernel_radius(s->kernel, s->kernel_radius);
    if (s->mode >= 0)
        p->mode = (CtsMode)s->mode;
    if (s->shade != CTS_AS_PRESET)
        p->shade = s->shade == CTS_ON;
    if (p->mode != CTS_MODE_COMPOSITE)
        p->shade = false;
    CtsScene *scene = &store->scene;
    *scene = (CtsScene){.volume = volume, .preset = p, .settings = s, .extinction_scale = 1};
    scene->plan = (CtsPlan){.samples = s->samples, .max_error = s->max_error};
    if ((st = cts_view_init(&scene->view, volume, s, err)))
        return st;
    if (s->slab_mm > 0)
        cts_view_set_slab(&scene->view, volume, s->slab_mm, s->slab_at_mm);
    /* Slicer's GPU path hands its mapper voxels of unit spacing: a unit is then a voxel's length along the ray. */
    if (s->opacity_per_voxel)
        scene->extinction_scale = cts_norm3(scene->view.forward_vox);
    return CTS_OK;
}

const struct CtsBodyMask *cts_scene_body(const CtsScene *scene)
{
    const CtsMode mode = scene->preset->mode;
    return mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE ? scene->volume->body : NULL;
}

void cts_scene_tell_parts(const CtsScene *scene, CtsReport *report)
{
    const CtsMode mode = scene->preset->mode;
    const CtsRenderSettings *s = scene->settings;
    if (s->slab_mm > 0)
        cts_report_plan(report, "a slab of %g mm across the view, its middle %g mm in front of the volume's centre",
                        s->slab_mm, s->slab_at_mm);
    if (cts_scene_body(scene))
        cts_report_plan(report, "mode %s: the inside of the body alone, 3 mm under the skin (--remove-table off: all)",
                        cts_mode_names[mode]);
    else if (mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE)
        cts_report_plan(report, "mode %s: everything in the volume, air around the body too", cts_mode_names[mode]);
}
