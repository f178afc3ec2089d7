/* Single rays of the reference ray caster, for tests: a scene from volume, preset and view. */
#pragma once

#include "engine/raycast/raycast.h"
#include "engine/raycast/raycaster.h"
#include "lab/check/check_scene.h"
#include "lab/check/truth.h"
#include "unit.h"
#include <math.h>

typedef struct Rays {
    CtsVolume *volume;
    CtsModel model; /* of volume alone */
    CtsPreset preset;
    CtsRenderSettings settings;
    CtsScene scene;
    CtsRaycaster *caster;
} Rays;

/* Aims a caster at the scene in rays. */
static inline void rays_aim(Rays *r, double azimuth_deg, double elevation_deg, double mm_per_pixel,
                            const CtsField *field)
{
    CtsError err = {0};
    cts_raycaster_free(&r->caster);
    r->settings.width = r->settings.height = 64;
    r->settings.n_threads = 1;
    r->settings.kernel_radius = 1;
    r->settings.azimuth_deg = azimuth_deg;
    r->settings.elevation_deg = elevation_deg;
    r->settings.mm_per_pixel = mm_per_pixel;
    r->model = (CtsModel){.volume = r->volume};
    r->scene = (CtsScene){
        .model = &r->model, .volume = r->volume, .preset = &r->preset, .settings = &r->settings, .extinction_scale = 1};
    assert_int_equal(cts_view_init(&r->scene.view, r->volume, &r->settings, &err), CTS_OK);
    assert_int_equal(cts_raycaster_new(&r->caster, &r->scene, field, &err), CTS_OK);
}

static inline void rays_free(Rays *r)
{
    cts_raycaster_free(&r->caster);
    cts_volume_free(&r->volume);
}

static inline bool rays_truth(const Rays *r, double x, double y, CtsTruthRay *ray)
{
    const CtsTruthCamera camera = {r->settings.azimuth_deg, r->settings.elevation_deg, r->settings.mm_per_pixel, 64,
                                   64};
    return cts_truth_ray(r->volume, &camera, x, y, ray);
}

#define assert_near(found, expected, bound)                                                                            \
    do {                                                                                                               \
        const double found_ = (found), expected_ = (expected), bound_ = (bound);                                       \
        if (!(fabs(found_ - expected_) <= bound_))                                                                     \
            fail_msg("%s: found %.12g, expected %.12g, off by %.3g, bound %.3g", #found, found_, expected_,            \
                     fabs(found_ - expected_), bound_);                                                                \
    } while (0)

static inline void assert_rgba(const double found[4], const double expected[4], double bound)
{
    for (int c = 0; c < 4; c++)
        if (!(fabs(found[c] - expected[c]) <= bound))
            fail_msg("channel %d: found %.12g, expected %.12g, off by %.3g, bound %.3g", c, found[c], expected[c],
                     fabs(found[c] - expected[c]), bound);
}

static inline void rays_shoot(const Rays *r, double x, double y, double rgba[4])
{
    cts_raycast_ray(r->caster, x, y, rgba, NULL);
}
