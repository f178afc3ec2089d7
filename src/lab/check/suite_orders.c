/* Convergence: how the error falls as sub-sheets are doubled. A lower order than theory has is a bug
 * (Etiene, Kirby, Silva 2013). */
#include "lab/check/suite.h"

#include <math.h>

enum { SIZE = 64, VIEWS = 6, MOST = 2 };

typedef struct OrderScene {
    CtsFormulaScene scene;
    int samples[MOST]; /* rising numbers; 0: none */
    double order, bound;
} OrderScene;

/* A bent field: no plane, no axis of symmetry, smooth; air at the border. */
static double hu_hill(const double vox[3], const void *data)
{
    const double x = (vox[0] - 15.3) / 8, y = (vox[1] - 16.4) / 9, z = (vox[2] - 16.9) / 7;
    (void)data;
    return -1000 + 60000 * exp(-(x * x + y * y + z * z + 0.4 * x * y - 0.3 * y * z));
}

/* A curved surface in one trilinear polynomial for the whole volume. With discontinuities of the slope between cells,
 * sheets would find the surface only to order 1.5; a ray in grazing contact with it would outweigh all others. */
static double hu_saddle(const double vox[3], const void *data)
{
    const double x = vox[0] - 8, y = vox[1] - 8, z = vox[2] - 8;
    (void)data;
    return 30000 + 1000 * y + 240 * x * z + 80 * x * y;
}

static CtsStatus add_squares(CtsCheckRun *run, const CtsRenderedScene *m, const CtsPicture *reference, double *sum,
                             CtsError *err)
{
    CtsPicture *picture = NULL;
    const CtsStatus st = cts_check_render(run, &m->model, &m->preset, &m->settings, &picture, err);
    for (int i = 0; i < 4 * SIZE * SIZE && !st; i++)
        *sum += pow((double)picture->pixels[i] - (double)reference->pixels[i], 2);
    cts_picture_free(&picture);
    return st;
}

/* Squared errors of one view with each number of samples. */
static CtsStatus add_view_errors(CtsCheckRun *run, const OrderScene *o, CtsRenderedScene *m, double *sum, CtsError *err)
{
    CtsPicture *reference = NULL;
    m->settings.engine = CTS_ENGINE_RAYCAST;
    CtsStatus st = cts_check_render(run, &m->model, &m->preset, &m->settings, &reference, err);
    m->settings.engine = run->engine;
    for (int i = 0; i < MOST && o->samples[i] && !st; i++) {
        m->settings.samples = o->samples[i];
        st = add_squares(run, m, reference, &sum[i], err);
    }
    cts_picture_free(&reference);
    return st;
}

/* rms error with each number of samples, over several views together, since the position of a surface between two
 * sheets is random in each view. */
static CtsStatus find_rms(CtsCheckRun *run, const OrderScene *o, double rms[MOST], CtsError *err)
{
    CtsRenderedScene m;
    CtsStatus st = cts_check_make(run, &o->scene, &m, err);
    for (int v = 0; v < VIEWS && !st; v++) {
        m.settings.azimuth_deg = 7.3 * v - 20;
        m.settings.elevation_deg = 31 - 9.1 * v;
        m.settings.samples = 0;
        st = add_view_errors(run, o, &m, rms, err);
    }
    for (int i = 0; i < MOST; i++)
        rms[i] = sqrt(rms[i] / (VIEWS * 4.0 * SIZE * SIZE));
    cts_model_free(&m.model);
    return st;
}

/* The order in which errors fall; with one number of samples the error itself, as it may fall correctly and yet be
 * large. */
static CtsStatus order(CtsCheckRun *run, const void *data, CtsError *err)
{
    const OrderScene *o = data;
    double rms[MOST] = {0};
    const CtsStatus st = find_rms(run, o, rms, err);
    const double times = o->samples[1] ? (double)o->samples[1] / o->samples[0] : 0;
    if (!st)
        cts_check_value(run, o->order, times > 0 ? log(rms[0] / rms[1]) / log(times) : rms[0], o->bound);
    return st;
}

static const CtsCheckPoint ramp[] = {{5000, 0, {0.2, 0.4, 0.9}}, {60000, 0.3, {1, 0.6, 0.1}}};
static const CtsCheckPoint step[] = {{30000, 0, {1, 0.6, 0.1}}, {30000, 0.2, {1, 0.6, 0.1}}};

#define HILL(BY) .scene = {CUBE_OF(33), .formula = hu_hill, .mm_per_pixel = 0.6, PIXELS(SIZE, SIZE), POINTS(BY)}
#define SADDLE .scene = {CUBE_OF(17), .formula = hu_saddle, .mm_per_pixel = 0.06, PIXELS(SIZE, SIZE), POINTS(step)}
#define ORDER(NAME, ENGINES, RUN, ...) ROW(NAME, ENGINES, RUN, OrderScene, __VA_ARGS__)
enum { CLASSIC = 1u << CTS_ENGINE_CLASSIC };

static const CtsCheckCase cases[] = {
    ORDER("order: ramp", CLASSIC, order, HILL(ramp), {2, 8}, 2, 0.02),
    ORDER("order: step, point samples", CLASSIC, order, SADDLE, {2, 16}, 1, 0.1),
    ORDER("order: ramp, what is left", CLASSIC, order, HILL(ramp), {8}, 0, 1e-5),
    ORDER("order: ramp, what is left", CHECK_OF_TILED, order, HILL(ramp), {4}, 0, 0.01 / 255),
    ORDER("order: step, point samples, what is left", CLASSIC, order, SADDLE, {16}, 0, 1e-3),
    ORDER("order: step, slab integrals, what is left", CHECK_OF_TILED, order, SADDLE, {2}, 0, 0.01 / 255),
};

const CtsCheckTable cts_check_orders = {cases, sizeof cases / sizeof *cases};
