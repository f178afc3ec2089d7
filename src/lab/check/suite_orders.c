/* Convergence: how the error falls as sub-sheets are doubled. A lower order than theory has is a bug
 * (Etiene, Kirby, Silva 2013). */
#include "lab/check/suite.h"

#include <math.h>

enum { SIZE = 64, VIEWS = 6, MOST = 7 };

typedef struct OrderScene {
    CtsHuFormula hu;
    int side; /* voxels */
    double mm_per_pixel;
    const CtsCheckPoint *points;
    int n_points;
    int samples[MOST]; /* from few to many; 0 ends them */
    double order, bound;
} OrderScene;

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

static CtsStatus add_squares(CtsCheckRun *run, const CtsVolume *volume, const CtsPreset *preset,
                             const CtsRenderSettings *settings, const CtsPicture *reference, double *sum, CtsError *err)
{
    CtsPicture *picture = NULL;
    const CtsStatus st = cts_check_render(run, volume, preset, settings, &picture, err);
    for (int i = 0; i < 4 * SIZE * SIZE && !st; i++) {
        const double d = (double)picture->pixels[i] - (double)reference->pixels[i];
        *sum += d * d;
    }
    cts_picture_free(&picture);
    return st;
}

/* Squared errors of one view with each number of samples. */
static CtsStatus add_view(CtsCheckRun *run, const OrderScene *o, const CtsVolume *volume, double azimuth_deg,
                          double elevation_deg, double *sum, CtsError *err)
{
    const CtsPreset preset = cts_check_preset(o->points, o->n_points);
    CtsPicture *reference = NULL;
    CtsRenderSettings s = cts_check_settings(run, SIZE, SIZE);
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    s.mm_per_pixel = o->mm_per_pixel;
    s.engine = CTS_ENGINE_RAYCAST;
    CtsStatus st = cts_check_render(run, volume, &preset, &s, &reference, err);
    s.engine = run->engine;
    for (int i = 0; i < MOST && o->samples[i] && !st; i++) {
        s.samples = o->samples[i];
        st = add_squares(run, volume, &preset, &s, reference, &sum[i], err);
    }
    cts_picture_free(&reference);
    return st;
}

/* rms error with each number of samples, over several views together: where a surface lies between two sheets is chance
 * in each. */
static CtsStatus find_rms(CtsCheckRun *run, const OrderScene *o, double rms[MOST], CtsError *err)
{
    CtsVolume *volume = NULL;
    CtsStatus st = cts_check_volume(&volume, (const int[3]){o->side, o->side, o->side}, (const double[3]){1, 1, 1}, 1,
                                    o->hu, NULL, err);
    for (int v = 0; v < VIEWS && !st; v++)
        st = add_view(run, o, volume, 7.3 * v - 20, 31 - 9.1 * v, rms, err);
    for (int i = 0; i < MOST; i++)
        rms[i] = sqrt(rms[i] / (VIEWS * 4.0 * SIZE * SIZE));
    cts_volume_free(&volume);
    return st;
}

static CtsStatus order(CtsCheckRun *run, const void *data, CtsError *err)
{
    const OrderScene *o = data;
    double rms[MOST] = {0};
    const CtsStatus st = find_rms(run, o, rms, err);
    if (!st)
        cts_check_value(run, o->order, log(rms[0] / rms[1]) / log((double)o->samples[1] / o->samples[0]), o->bound);
    return st;
}

/* An error may fall as it should and yet be large. */
static CtsStatus left(CtsCheckRun *run, const void *data, CtsError *err)
{
    const OrderScene *o = data;
    double rms[MOST] = {0};
    const CtsStatus st = find_rms(run, o, rms, err);
    if (!st)
        cts_check_value(run, 0, rms[0], o->bound);
    return st;
}

/* More sheets never make a picture worse, until it is as good as anyone asks: found is the largest rise from one number
 * of sheets to the next. */
static CtsStatus floor_of(CtsCheckRun *run, const void *data, CtsError *err)
{
    const double good = 0.01 / 255;
    const OrderScene *o = data;
    double rms[MOST] = {0}, rise = 0;
    const CtsStatus st = find_rms(run, o, rms, err);
    for (int i = 0; i + 1 < MOST && o->samples[i + 1]; i++)
        rise = fmax(rise, rms[i + 1] - fmax(rms[i], good));
    if (!st)
        cts_check_value(run, 0, rise, o->bound);
    return st;
}

static const CtsCheckPoint ramp[] = {{5000, 0, {0.2, 0.4, 0.9}}, {60000, 0.3, {1, 0.6, 0.1}}};
static const CtsCheckPoint step[] = {{30000, 0, {1, 0.6, 0.1}}, {30000, 0.2, {1, 0.6, 0.1}}};

#define SHEETS                                                                                                         \
    {                                                                                                                  \
        1, 2, 4, 8, 16, 32, 64                                                                                         \
    }
#define POINTS(ARRAY) .points = ARRAY, .n_points = 2
enum { CLASSIC = 1u << CTS_ENGINE_CLASSIC };

static const CtsCheckCase cases[] = {
    {"order: ramp", CLASSIC, order, &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), {2, 8}, 2, 0.02}},
    {"order: step, point samples", CLASSIC, order,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), {2, 16}, 1, 0.1}},
    {"order: ramp, what is left", CLASSIC, left, &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), {8}, 0, 1e-5}},
    {"order: ramp, what is left", CHECK_OF_TILED, left,
     &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), {4}, 0, 0.01 / 255}},
    {"order: step, point samples, what is left", CLASSIC, left,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), {16}, 0, 1e-3}},
    {"order: step, slab integrals, what is left", CHECK_OF_TILED, left,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), {2}, 0, 0.01 / 255}},
    {"order: step, 1 to 64 sheets", CHECK_OF_TILED, floor_of,
     &(const OrderScene){hu_saddle, 17, 0.06, POINTS(step), SHEETS, 0, 0}},
    {"order: step and kinks, 1 to 64 sheets", CHECK_OF_TILED, floor_of,
     &(const OrderScene){hu_hill, 33, 0.6, POINTS(step), SHEETS, 0, 0}},
    {"order: ramp, 1 to 64 sheets", CHECK_OF_TILED, floor_of,
     &(const OrderScene){hu_hill, 33, 0.6, POINTS(ramp), SHEETS, 0, 0}},
};

const CtsCheckTable cts_check_orders = {cases, sizeof cases / sizeof *cases};
