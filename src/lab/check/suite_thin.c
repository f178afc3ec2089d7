/* One voxel thick: plates, lines and dots seen from the side, which a ray may pass between two layers that hardly show
 * them. */
#include "lab/check/suite.h"

#include <math.h>

enum { THIN_SIZE = 17, THIN_AT = 8 };

/* Thin along the axes that are 1. */
typedef struct Thin {
    int along[3];
    double azimuth_deg, elevation_deg, contrast_hu;
    int samples; /* 0: the engine's choice */
    double bound[CHECK_N_FAMILIES];
} Thin;

static const double air_hu = -1000;

static double hu_thin(const double vox[3], const void *data)
{
    const Thin *t = data;
    double weight = 1;
    for (int c = 0; c < 3; c++)
        if (t->along[c])
            weight *= fmax(1 - fabs(vox[c] - THIN_AT), 0);
    return air_hu + t->contrast_hu * weight;
}

typedef struct Scene {
    const Thin *thin;
    const CtsVolume *volume;
    const CtsPreset *preset;
} Scene;

static double hu_on_ray(const Scene *s, const CtsTruthRay *ray, double t_mm)
{
    double point[3], vox[3];
    cts_truth_ray_point(ray, t_mm, point);
    cts_truth_voxel(s->volume, point, vox);
    return hu_thin(vox, s->thin);
}

/* Where the ray is within a voxel of the thing, in short straight stretches; elsewhere is air. */
static void truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { N = 256 };
    const Scene *s = data;
    if (!ray)
        return;
    double from = ray->from_mm, to = ray->to_mm, a[3], b[3], va[3], vb[3];
    cts_truth_ray_point(ray, 0, a);
    cts_truth_ray_point(ray, 1, b);
    cts_truth_voxel(s->volume, a, va);
    cts_truth_voxel(s->volume, b, vb);
    for (int c = 0; c < 3; c++) {
        const double step = vb[c] - va[c], off = THIN_AT - va[c];
        if (!s->thin->along[c])
            continue;
        if (fabs(step) < 1e-12) {
            if (fabs(off) >= 1)
                return;
            continue;
        }
        const double first = (off - 1) / step, second = (off + 1) / step;
        from = fmax(from, fmin(first, second));
        to = fmin(to, fmax(first, second));
    }
    if (!(from < to))
        return;
    CtsTruthStretch stretch[N];
    for (int i = 0; i < N; i++)
        stretch[i] = (CtsTruthStretch){hu_on_ray(s, ray, from + (to - from) * i / N),
                                       hu_on_ray(s, ray, from + (to - from) * (i + 1) / N), (to - from) / N, -1};
    cts_truth_stretches(s->preset, 1, stretch, N, rgba);
}

static CtsStatus thin(CtsCheckRun *run, const void *data, CtsError *err)
{
    const Thin *t = data;
    const double bound = t->bound[cts_check_family(run->engine)];
    const CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{150, 0, {1, 1, 1}}, {500, 0.75, {1, 1, 1}}}, 2);
    CtsVolume *volume = NULL;
    CtsRenderSettings settings = cts_check_settings(run, 60, 60);
    settings.azimuth_deg = t->azimuth_deg;
    settings.elevation_deg = t->elevation_deg;
    settings.mm_per_pixel = 0.23;
    settings.samples = t->samples;
    CtsStatus st = cts_check_volume(&volume, (const int[3]){THIN_SIZE, THIN_SIZE, THIN_SIZE},
                                    (const double[3]){1, 1, 1}, 1, hu_thin, t, err);
    if (st)
        return st;
    const Scene scene = {t, volume, &preset};
    st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &settings, truth, &scene}, bound, err);
    cts_volume_free(&volume);
    return st;
}

enum { TILED_AND_RAYCAST = CHECK_OF_TILED | CHECK_OF_RAYCAST };

#define PLATE                                                                                                          \
    {                                                                                                                  \
        1, 0, 0                                                                                                        \
    }
#define LINE                                                                                                           \
    {                                                                                                                  \
        1, 1, 0                                                                                                        \
    }
#define DOT                                                                                                            \
    {                                                                                                                  \
        1, 1, 1                                                                                                        \
    }

/* A pixel may be off by more than a picture, rms, but not so much that a thing is lost. */
#define PIXEL (8 * CHECK_PROMISED)

static const CtsCheckCase cases[] = {
    {"thin: a plate at 45", TILED_AND_RAYCAST, thin, &(const Thin){PLATE, 45, 0, 2500, 0, {-1, 1e-3, 1e-4}}},
    {"thin: a plate at 44, 30", TILED_AND_RAYCAST, thin,
     &(const Thin){PLATE, 44, 30, 2500, 0, {-1, CHECK_PROMISED, 1e-4}}},
    {"thin: a line at 45", TILED_AND_RAYCAST, thin, &(const Thin){LINE, 45, 0, 2500, 0, {-1, PIXEL, 1e-4}}},
    {"thin: a line at 30, 20", TILED_AND_RAYCAST, thin, &(const Thin){LINE, 30, 20, 2500, 0, {-1, PIXEL, 1e-4}}},
    {"thin: a bright line at 45", TILED_AND_RAYCAST, thin, &(const Thin){LINE, 45, 0, 20000, 0, {-1, PIXEL, 1e-4}}},
    {"thin: a dot at 45, 35", TILED_AND_RAYCAST, thin, &(const Thin){DOT, 45, 35.26, 2500, 0, {-1, PIXEL, 1e-4}}},
    {"thin: a dot, 4 sheets", CHECK_OF_TILED, thin, &(const Thin){DOT, 45, 35.26, 2500, 4, {-1, PIXEL, 1e-4}}},
    {"thin: a bright dot, 4 sheets", CHECK_OF_TILED, thin, &(const Thin){DOT, 45, 35.26, 20000, 4, {-1, 0.04, 1e-4}}},
    {"thin: a bright dot, 16 sheets", CHECK_OF_TILED, thin, &(const Thin){DOT, 45, 35.26, 20000, 16, {-1, 5e-3, 1e-4}}},
};

const CtsCheckTable cts_check_thin = {cases, sizeof cases / sizeof *cases};
