/* Convergence: how the error falls as sub-sheets are doubled. A lower order than theory has is a bug
 * (Etiene, Kirby, Silva 2013). */
#include "check/suite.h"

#include <math.h>

typedef struct OrderScene {
    CtsHuFormula hu;
    int side; /* voxels */
    double mm_per_pixel;
    const CtsCheckPoint *points;
    int n_points;
    int samples[2]; /* few and many */
    double order, bound;
} OrderScene;

enum { SIZE = 64 };

/* A bent field: no plane, no axis of symmetry, smooth; air at the border. */
static double hu_hill(const double vox[3], const void *data)
{
    const double x = (vox[0] - 15.3) / 8, y = (vox[1] - 16.4) / 9, z = (vox[2] - 16.9) / 7;
    (void)data;
    return -1000 + 60000 * exp(-(x * x + y * y + z * z + 0.4 * x * y - 0.3 * y * z));
}

/* A bent surface in one trilinear polynomial for the whole volume. Were there kinks between cells, sheets would find
 * the surface only to order 1.5; a ray that grazes it would outweigh all others. */
static double hu_saddle(const double vox[3], const void *data)
{
    const double x = vox[0] - 8, y = vox[1] - 8, z = vox[2] - 8;
    (void)data;
    return 30000 + 1000 * y + 240 * x * z + 80 * x * y;
}

static CtsStatus add_squares(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                             const CtsPicture *reference, double *sum, CtsError *err)
{
    CtsPicture *picture = NULL;
    const CtsStatus st = cts_render(volume, preset, settings, &picture, NULL, err);
    for (int i = 0; i < 4 * SIZE * SIZE && !st; i++) {
        const double d = (double)picture->pixels[i] - (double)reference->pixels[i];
        *sum += d * d;
    }
    cts_picture_free(&picture);
    return st;
}

/* Squared errors of one view with few and with many samples. */
static CtsStatus add_view(CtsCheckRun *run, const OrderScene *o, const CtsVolume *volume, double azimuth_deg,
                          double elevation_deg, double sum[2], CtsError *err)
{
    const CtsPreset preset = cts_check_preset(o->points, o->n_points);
    CtsPicture *reference = NULL;
    CtsRenderSettings s = cts_check_settings(run, SIZE, SIZE);
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    s.mm_per_pixel = o->mm_per_pixel;
    s.engine = CTS_ENGINE_RAYCAST;
    CtsStatus st = cts_render(volume, &preset, &s, &reference, NULL, err);
    s.engine = run->engine;
    for (int i = 0; i < 2 && !st; i++) {
        s.samples = o->samples[i];
        st = add_squares(volume, &preset, &s, reference, &sum[i], err);
    }
    cts_picture_free(&reference);
    return st;
}

/* Several views together: where a surface lies between two sheets is chance in each. */
static CtsStatus order(CtsCheckRun *run, const void *data, CtsError *err)
{
    const OrderScene *o = data;
    CtsVolume *volume = NULL;
    double sum[2] = {0, 0};
    CtsStatus st = cts_check_volume(&volume, (const int[3]){o->side, o->side, o->side}, (const double[3]){1, 1, 1}, 1,
                                    o->hu, NULL, err);
    for (int v = 0; v < 6 && !st; v++)
        st = add_view(run, o, volume, 7.3 * v - 20, 31 - 9.1 * v, sum, err);
    if (!st)
        cts_check_value(run, o->order, 0.5 * log(sum[0] / sum[1]) / log((double)o->samples[1] / o->samples[0]),
                        o->bound);
    cts_volume_free(&volume);
    return st;
}

static const CtsCheckPoint ramp[] = {{5000, 0, {0.2, 0.4, 0.9}}, {60000, 0.3, {1, 0.6, 0.1}}};
static const CtsCheckPoint step[] = {{30000, 0, {1, 0.6, 0.1}}, {30000, 0.2, {1, 0.6, 0.1}}};

#define POINTS(ARRAY) .points = ARRAY, .n_points = 2
enum { CLASSIC = 1u << CTS_ENGINE_CLASSIC };

static const CtsCheckCase cases[] = {
    {"order: ramp", CLASSIC, order, &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), {2, 8}, 2, 0.15}},
    {"order: ramp", CHECK_OF_TILED, order, &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), {1, 4}, 2, 0.15}},
    {"order: step, point samples", CLASSIC, order,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), {2, 16}, 1, 0.15}},
    {"order: step, slab integrals", CHECK_OF_TILED, order,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), {1, 2}, 2, 0.15}},
};

const CtsCheckTable cts_check_orders = {cases, sizeof cases / sizeof *cases};
