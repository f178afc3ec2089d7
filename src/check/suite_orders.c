/* Convergence: how the error falls as sub-sheets are doubled. A lower order than theory has is a bug
 * (Etiene, Kirby, Silva 2013). */
#include "check/suite.h"

#include <math.h>

typedef struct OrderScene {
    const CtsCheckPoint *points;
    int n_points;
    double azimuth_deg, elevation_deg;
    int samples[2]; /* few and many */
    double order, bound;
} OrderScene;

enum { N = 33, SIZE = 64 };

/* A bent field: no plane, no axis of symmetry, smooth; air at the border. */
static double hu_hill(const double vox[3], const void *data)
{
    const double x = (vox[0] - 15.3) / 8, y = (vox[1] - 16.4) / 9, z = (vox[2] - 16.9) / 7;
    (void)data;
    return -1000 + 60000 * exp(-(x * x + y * y + z * z + 0.4 * x * y - 0.3 * y * z));
}

static CtsStatus rms_error(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                           const CtsPicture *reference, double *rms, CtsError *err)
{
    CtsPicture *picture = NULL;
    const CtsStatus st = cts_render(volume, preset, settings, &picture, NULL, err);
    double sum = 0;
    for (int i = 0; i < 4 * SIZE * SIZE && !st; i++) {
        const double d = (double)picture->pixels[i] - (double)reference->pixels[i];
        sum += d * d;
    }
    cts_picture_free(&picture);
    *rms = sqrt(sum / (4 * SIZE * SIZE));
    return st;
}

static CtsStatus order(CtsCheckRun *run, const void *data, CtsError *err)
{
    const OrderScene *o = data;
    const CtsPreset preset = cts_check_preset(o->points, o->n_points);
    CtsVolume *volume = NULL;
    CtsPicture *reference = NULL;
    CtsStatus st;
    double rms[2] = {0, 0};
    CtsRenderSettings s = cts_check_settings(run, SIZE, SIZE);
    s.azimuth_deg = o->azimuth_deg;
    s.elevation_deg = o->elevation_deg;
    s.mm_per_pixel = 0.6;
    if ((st = cts_check_volume(&volume, (const int[3]){N, N, N}, (const double[3]){1, 1, 1}, 1, hu_hill, NULL, err)))
        goto end;
    s.engine = CTS_ENGINE_RAYCAST;
    if ((st = cts_render(volume, &preset, &s, &reference, NULL, err)))
        goto end;
    s.engine = run->engine;
    for (int i = 0; i < 2 && !st; i++) {
        s.samples = o->samples[i];
        st = rms_error(volume, &preset, &s, reference, &rms[i], err);
    }
    if (!st)
        cts_check_value(run, o->order, log(rms[0] / rms[1]) / log((double)o->samples[1] / o->samples[0]), o->bound);
end:
    cts_picture_free(&reference);
    cts_volume_free(&volume);
    return st;
}

static const CtsCheckPoint ramp[] = {{5000, 0, {0.2, 0.4, 0.9}}, {60000, 0.3, {1, 0.6, 0.1}}};
static const CtsCheckPoint step[] = {{20000, 0, {1, 0.6, 0.1}}, {20000, 0.2, {1, 0.6, 0.1}}};

#define POINTS(ARRAY) .points = ARRAY, .n_points = 2
enum { CLASSIC = 1u << CTS_ENGINE_CLASSIC };

static const CtsCheckCase cases[] = {
    {"order: ramp", CLASSIC, order, &(const OrderScene){POINTS(ramp), 24, 13, {2, 8}, 2, 0.15}},
    {"order: ramp", CHECK_OF_TILED, order, &(const OrderScene){POINTS(ramp), 24, 13, {1, 4}, 2, 0.15}},
    {"order: step, point samples", CLASSIC, order, &(const OrderScene){POINTS(step), 24, 13, {2, 16}, 1, 0.15}},
    {"order: step, slab integrals", CHECK_OF_TILED, order, &(const OrderScene){POINTS(step), 24, 13, {1, 4}, 2, 0.15}},
};

const CtsCheckTable cts_check_orders = {cases, sizeof cases / sizeof *cases};
