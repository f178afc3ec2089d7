/* Balls, checkerboards, markers, halves: properties that any true picture has. */
#include "lab/check/suite.h"

#include <math.h>

/* A pixel's values and where it lies. */
static const float *pixel_number(const CtsPicture *p, int i)
{
    return p->pixels + 4 * (size_t)i;
}

/* hu: centre, HU there, and how they fall by the voxel. */
static double hu_ball(const double vox[3], const void *data)
{
    const double *b = data;
    const double x = vox[0] - b[0], y = vox[1] - b[0], z = vox[2] - b[0];
    return b[1] - b[2] * sqrt(x * x + y * y + z * z);
}

/* The opacity of a ray at this distance from the centre of a ball of radius 10 mm: the closed form of the chord, 2
 * sqrt(R^2 - b^2). */
static double chord(double off)
{
    return off < 10 ? -expm1(2 * sqrt(100 - off * off) * log(0.9)) : 0;
}

static double distance_from_middle(const CtsPicture *p, int i)
{
    const double mm = p->info.mm_per_pixel;
    return hypot((i % p->width + 0.5 - p->width / 2.0) * mm, (i / p->width + 0.5 - p->height / 2.0) * mm);
}

static CtsStatus ball(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsPicture *p = NULL;
    CtsCheckWorst worst = {0};
    const CtsStatus st = cts_check_show(run, data, &p, err);
    for (int i = 0; !st && i < p->width * p->height; i++) {
        const double off = distance_from_middle(p, i);
        if (off < 9 || off > 10.5)
            cts_check_worst(&worst, i % p->width, i / p->width, chord(off), (double)pixel_number(p, i)[3]);
    }
    if (!st)
        cts_check_worst_value(run, &worst, cts_check_bound(run, data));
    cts_picture_free(&p);
    return st;
}

/* Half the spacing, a quarter of the distance from the ball: the voxels' own order, 2. */
static CtsStatus ball_order(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsStatus st = CTS_OK;
    double rms[2] = {0, 0};
    for (int halving = 0; halving < 2 && !st; halving++) {
        const double h = halving == 0 ? 1 : 0.5;
        const int n = halving == 0 ? 27 : 53;
        CtsFormulaScene s = *(const CtsFormulaScene *)data;
        CtsPicture *p = NULL;
        for (int a = 0; a < 3; a++) {
            s.dims[a] = n;
            s.spacing_mm[a] = h;
        }
        s.hu[0] = n / 2;
        s.hu[2] = 3000 * h;
        st = cts_check_show(run, &s, &p, err);
        for (int i = 0; !st && i < p->width * p->height; i++)
            rms[halving] += pow(chord(distance_from_middle(p, i)) - (double)pixel_number(p, i)[3], 2);
        cts_picture_free(&p);
    }
    if (!st)
        cts_check_value(run, 2, 0.5 * log2(rms[0] / rms[1]), cts_check_bound(run, data));
    return st;
}

static double hu_marker(const double vox[3], const void *data)
{
    (void)data;
    return fabs(vox[0] - 20) + fabs(vox[1] - 5) + fabs(vox[2] - 19) < 2 ? 1500 : -1024;
}

/* A marker at the patient's left, front and head: the share of light in the expected quarter of the picture, given by
 * hu: side, right and up. */
static CtsStatus marker(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsFormulaScene *s = data;
    CtsPicture *p = NULL;
    double all = 0, inside = 0;
    const CtsStatus st = cts_check_show(run, s, &p, err);
    for (int i = 0; !st && i < p->width * p->height; i++) {
        const bool right = 2 * (i % p->width) >= p->width, up = 2 * (i / p->width) < p->height;
        const double alpha = (double)pixel_number(p, i)[3];
        all += alpha;
        inside += right == (s->hu[0] > 0) && up == (s->hu[1] > 0) ? alpha : 0;
    }
    if (!st)
        cts_check_value(run, 1, all > 1 ? inside / all : 0, 0);
    cts_picture_free(&p);
    return st;
}

/* Noise, shifted along y by hu[4]. */
static double hu_noise(const double vox[3], const void *data)
{
    const double *hu = data;
    return cts_hu_noise((const double[3]){vox[0], vox[1] + hu[4], vox[2]}, hu);
}

/* Front and back half, one over the other, equal the whole: layer `cut` belongs to both. */
static CtsStatus halves(CtsCheckRun *run, const void *data, CtsError *err)
{
    const int first[3] = {0, 0, 7}, length[3] = {21, 8, 14};
    CtsPicture *p[3] = {NULL, NULL, NULL};
    CtsCheckWorst worst = {0};
    CtsStatus st = CTS_OK;
    for (int i = 0; i < 3 && !st; i++) {
        CtsFormulaScene s = *(const CtsFormulaScene *)data;
        s.dims[1] = length[i];
        s.hu[4] = first[i];
        st = cts_check_show(run, &s, &p[i], err);
    }
    for (int i = 0; !st && i < p[0]->width * p[0]->height; i++)
        for (int c = 0; c < 4; c++) {
            const double front = (double)pixel_number(p[1], i)[c], left = 1 - (double)pixel_number(p[1], i)[3];
            cts_check_worst(&worst, i % p[0]->width, i / p[0]->width, front + left * (double)pixel_number(p[2], i)[c],
                            (double)pixel_number(p[0], i)[c]);
        }
    if (!st)
        cts_check_worst_value(run, &worst, cts_check_bound(run, data));
    for (int i = 0; i < 3; i++)
        cts_picture_free(&p[i]);
    return st;
}

/* Objects behind an opaque wall are invisible. */
static double hu_wall(const double vox[3], const void *data)
{
    return vox[1] < 4 ? 3000 : cts_hu_noise(vox, data);
}

/* One cell of eight different voxels, along which HU rises and falls: many short linear segments approximate the
 * cubic. */
static double cell_hu(const CtsVolume *v, const CtsTruthRay *ray, double t_mm)
{
    double at[3], hu = 0;
    cts_truth_ray_voxel(v, ray, t_mm, at);
    for (int m = 0; m < 8; m++) {
        double weight = 1;
        for (int a = 0; a < 3; a++)
            weight *= m >> a & 1 ? at[a] : 1 - at[a];
        hu += weight * cts_volume_hu(v, v->grey[m]);
    }
    return hu;
}

static void cell_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { N = 1500 };
    static const double length = 1.0 / N;
    const CtsRenderedScene *c = data;
    CtsTruthInterval interval[N];
    double most = -INFINITY;
    for (int i = 0; i < N; i++) {
        const double step = (ray->to_mm - ray->from_mm) * length, t = ray->from_mm + i * step;
        interval[i] =
            (CtsTruthInterval){cell_hu(c->model.volume, ray, t), cell_hu(c->model.volume, ray, t + step), step, -1};
        most = fmax(most, interval[i].hu1);
    }
    if (c->preset.mode == CTS_MODE_COMPOSITE) {
        cts_truth_intervals(&c->preset, 1, interval, N, rgba);
        return;
    }
    rgba[0] = rgba[1] = rgba[2] = fmin(fmax(fmax(most, interval[0].hu0) / 1000, 0), 1);
    rgba[3] = 1;
}

/* Haze of one grey level for 200 mm, then a wall of the largest extinction: the one must not spoil the other. */
static double hu_haze(const double vox[3], const void *data)
{
    (void)data;
    return vox[1] <= 200 ? 200 : 3000;
}

/* Stripes, so that most rays have an extreme of HU within one of them. */
static CtsStatus cell(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsFormulaScene s = *(const CtsFormulaScene *)data;
    CtsCheckPoint stripes[20];
    for (int i = 0; i < 20; i++)
        stripes[i] =
            (CtsCheckPoint){50 * (i / 2 * 2 + 1), i % 4 == 1 || i % 4 == 2 ? 0.1 : 0.01, {1, 0.1 * (i / 2), 0.5}};
    s.points = stripes;
    s.n_points = 20;
    return cts_check_against(run, &s, cell_truth, err);
}

/* Distance of an opaque plane from the camera plane, which touches the box's bounding sphere. */
static CtsStatus plane_depth(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsRenderedScene m;
    CtsPicture *p = NULL;
    CtsCheckWorst worst = {0};
    CtsStatus st = cts_check_make(run, data, &m, err);
    m.settings.want_depth = true;
    if (!st)
        st = cts_check_render(run, &m.model, &m.preset, &m.settings, &p, err);
    for (int i = 0; !st && i < p->width * p->height; i++)
        cts_check_worst(&worst, i % p->width, i / p->width, 8 * sqrt(3) - 8 + 7.7,
                        p->depth_mm ? (double)p->depth_mm[i] : NAN);
    if (!st)
        cts_check_worst_value(run, &worst, cts_check_bound(run, data));
    cts_picture_free(&p);
    cts_model_free(&m.model);
    return st;
}

/* No NaN, no alpha outside 0..1, no colour above alpha, roundings apart: the number of values that break this. */
static CtsStatus sane(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsFormulaScene s = *(const CtsFormulaScene *)data;
    CtsRenderedScene m;
    CtsStatus st = cts_check_make(run, &s, &m, err);
    double bad = 0;
    for (int v = 0; v < 12 && !st; v++) {
        CtsPicture *p = NULL;
        m.settings.azimuth_deg = 30 * v + (v % 3 ? 0 : 1e-9);
        m.settings.elevation_deg = 15 * v - 90;
        m.preset.shade = v % 2;
        m.preset.ambient = m.preset.diffuse = 0.5;
        m.preset.specular = 0;
        st = cts_check_render(run, &m.model, &m.preset, &m.settings, &p, err);
        for (int i = 0; !st && i < 4 * p->width * p->height; i++)
            bad += !(p->pixels[i] >= 0 && p->pixels[i] <= 1 + 1e-5f && p->pixels[i] <= p->pixels[i | 3] + 1e-5f);
        cts_picture_free(&p);
    }
    cts_model_free(&m.model);
    if (!st)
        cts_check_value(run, 0, bad, 0);
    return st;
}

static const CtsCheckPoint of_6200[] = {{6200, 0, {1, 1, 1}}, {6200, 0.1, {1, 1, 1}}};
static const CtsCheckPoint all_bits[] = {{-1024, 0, {0, 0, 1}}, {20000, 0.3, {0, 1, 0}}, {64511, 0.1, {1, 0.5, 0}}};
static const CtsCheckPoint from_0[] = {{0, 0, {1, 1, 1}}, {400, 0.9, {1, 1, 1}}};
static const CtsCheckPoint tissues[] = {{100, 0, {0.9, 0.4, 0.3}}, {700, 0.2, {1, 0.9, 0.6}}, {1100, 0.5, {1, 1, 1}}};
static const CtsCheckPoint opaque[] = {{100, 0, {0.9, 0.4, 0.3}}, {700, 0.2, {1, 0.9, 0.6}}, {1100, 1, {1, 1, 1}}};
static const CtsCheckPoint step_770[] = {{770, 0, {1, 1, 1}}, {770, 1, {1, 1, 1}}};
static const CtsCheckPoint thin_and_opaque[] = {
    {0, 2.36e-4, {1, 0, 0}}, {400, 2.36e-4, {1, 0, 0}}, {401, 1, {0, 1, 0}}};
#define BALL .formula = hu_ball, .hu = {26, 36200, 1500}, POINTS(of_6200)
#define MARKER(NAME, AZ, EL, RIGHT, UP)                                                                                \
    SCENE(NAME, CHECK_OF_ALL, marker, CUBE_OF(25), .formula = hu_marker, .hu = {RIGHT, UP}, POINTS(from_0),            \
          PIXELS(50, 50), VIEW(AZ, EL))
#define CELL CUBE_OF(2), .spacing_mm = {10, 10, 10}, .formula = cts_hu_noise, .hu = {0, 1000, 77}
#define NOISE(SEED) CUBE_OF(19), .formula = hu_noise, .hu = {-200, 1200, SEED}, POINTS(tissues)
#define SIZE PIXELS(40, 40)

static const CtsCheckCase cases[] = {
    SCENE("ball: chords", CHECK_OF_ALL, ball, CUBE_OF(53), .spacing_mm = {0.5, 0.5, 0.5}, BALL, PIXELS(48, 48),
          VIEW(25, 15), .mm_per_pixel = 0.5, .bound = {3e-2, 3e-3, 2e-3}),
    SCENE("ball: order in spacing", CHECK_OF_FIELDS, ball_order, BALL, PIXELS(60, 60), VIEW(37, 21),
          .mm_per_pixel = 0.22, .samples = 8, .bound = {0, 0.15, 0.15}),
    SCENE("range: checkerboard of 16-bit extremes", CHECK_OF_FIELDS | CHECK_OF_SHEETS, cts_check_volume_scene,
          CUBE_OF(11), .formula = cts_hu_checkers, POINTS(all_bits), PIXELS(11, 11), .mm_per_pixel = 1,
          .bound = {0, 1e-3, 1e-6}),
    SCENE("cell: HU turns inside", CHECK_OF_FIELDS | CHECK_OF_SHEETS, cell, CELL, PIXELS(10, 10), VIEW(38, 33),
          .bound = {0, 1.2e-2, 1e-5}),
    SCENE("cell: HU turns inside, mip", CHECK_OF_FIELDS, cell, CELL, PIXELS(10, 10), VIEW(38, 33), .mode = CTS_MODE_MIP,
          .bound = {0, 1e-5, 1e-5}),
    MARKER("marker: left, front, head from anterior", 0, 0, 1, 1),
    MARKER("marker: left, front, head from posterior", 180, 0, -1, 1),
    MARKER("marker: left, front, head from left", 90, 0, -1, 1),
    MARKER("marker: left, front, head from right", -90, 0, 1, 1),
    MARKER("marker: left, front, head from head", 0, 90, 1, -1),
    MARKER("marker: left, front, head from feet", 0, -90, 1, 1),
    SCENE("same: two halves are the whole", CHECK_OF_ALL, halves, NOISE(9), SIZE, .mm_per_pixel = 0.37,
          .bound = {1e-5, 2 * CHECK_PROMISED, 1e-6}),
    SCENE("same: an opaque wall hides what is behind", CHECK_OF_ALL, cts_check_volume_scene, CUBE_OF(19),
          .formula = hu_wall, .hu = {-200, 1200, 5}, POINTS(opaque), SIZE, .mm_per_pixel = 0.3,
          .bound = {1e-5, 1e-5, 1e-6}),
    SCENE("range: faint haze before an opaque wall", CHECK_OF_ALL, cts_check_volume_scene, .dims = {5, 206, 5},
          .formula = hu_haze, POINTS(thin_and_opaque), PIXELS(9, 9), .mm_per_pixel = 0.3, .bound = {1e-4, 5e-4, 1e-6}),
    SCENE("depth: an opaque plane", CHECK_OF_ALL, plane_depth, CUBE_OF(17), .hu = {0, 0, 100}, POINTS(step_770),
          PIXELS(20, 20), .mm_per_pixel = 0.4, .bound = {0.4, 0.03, 0.02}),
    SCENE("range: no NaN, alpha 0 to 1", CHECK_OF_ALL, sane, .dims = {23, 17, 29}, .spacing_mm = {0.3, 7, 1.1},
          .formula = cts_hu_noise, .hu = {-1024, 64511, 3}, POINTS(tissues), PIXELS(31, 33), .power = 5),
};

const CtsCheckTable cts_check_shapes = {cases, sizeof cases / sizeof *cases};
