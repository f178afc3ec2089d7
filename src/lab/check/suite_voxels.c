/* Things of a voxel's size, steps, and haze beside metal, from all sides and at all scales, against rays through their
 * voxels. What is thinner than a voxel once opacity has cut it is lost first where an engine looks too rarely. */
#include "base/mem.h"
#include "lab/check/suite.h"

#include <math.h>

/* A pixel may be off by this many times what the picture may be off by, rms. */
#define PIXELWISE 25

typedef struct View {
    double azimuth_deg, elevation_deg, mm_per_pixel;
} View;

typedef struct VoxelScene {
    int dims[3];
    CtsHuFormula hu;
    double numbers[4]; /* handed to hu */
    const CtsCheckPoint *points;
    int n_points;
    View view;
    int width, height;
    bool lit;
    double max_error; /* asked for; 0: nothing */
} VoxelScene;

static double shown(double value)
{
    return fmin(fmax(value, 0), 1);
}

/* The picture as it should be. The case's engines share it: making it takes longer than any of them. */
static CtsStatus make_truth(CtsCheckRun *run, const CtsVolume *volume, const CtsPreset *preset,
                            const CtsRenderSettings *s, CtsError *err)
{
    const CtsTruthCamera camera = {s->azimuth_deg, s->elevation_deg, s->mm_per_pixel, s->width, s->height};
    if (run->truth)
        return CTS_OK;
    const CtsStatus st = cts_alloc_zeroed(&run->truth, 4 * (size_t)s->width * (size_t)s->height, err);
    double *rgba = run->truth;
    for (int y = 0; y < s->height && !st; y++)
        for (int x = 0; x < s->width; x++, rgba += 4) {
            CtsTruthRay ray;
            if (cts_truth_ray(volume, &camera, x, y, &ray))
                cts_truth_volume(volume, preset, &ray, rgba);
        }
    return st;
}

/* Found is the rms over the picture's colours, or a PIXELWISE-th of the largest difference where that is more: the
 * pixel named is the one furthest off. Of a dark scene no more than an eighth of its light may be missing. */
static void judge(CtsCheckRun *run, const CtsRenderSettings *s, const CtsPicture *picture, double bound)
{
    CtsCheckWorst worst = {0};
    double sum = 0, light = 0;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            const size_t at = 4 * ((size_t)y * (size_t)s->width + (size_t)x);
            const float *found = picture->pixels + at;
            const double *rgba = run->truth + at;
            for (int c = 0; c < 3; c++) {
                const double d = shown((double)found[c]) - shown(rgba[c]);
                sum += d * d;
                light += shown(rgba[c]) * shown(rgba[c]);
                cts_check_worst(&worst, x, y, shown(rgba[c]), shown((double)found[c]));
            }
        }
    const double n = 3.0 * s->width * s->height;
    worst.most = worst.error;
    worst.found = worst.error = fmax(sqrt(sum / n), worst.error / PIXELWISE);
    worst.expected = 0;
    worst.rms = sqrt(sum / n);
    cts_check_worst_value(run, &worst, light > 0 ? fmin(bound, sqrt(light / n) / 8) : -1);
}

static CtsStatus voxels(CtsCheckRun *run, const void *data, CtsError *err)
{
    const VoxelScene *v = data;
    /* The truth's own error at steps that a ray grazes. */
    const bool exact = cts_check_family(run->engine) == CHECK_RAYCAST;
    const double bound = exact ? 3e-4 : v->max_error > 0 ? v->max_error / 255 : CHECK_PROMISED;
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsStatus st = cts_check_volume(&volume, v->dims, (const double[3]){1, 1, 1}, 1, v->hu, v->numbers, err);
    if (st)
        return st;
    CtsPreset preset = cts_check_preset(v->points, v->n_points);
    preset.shade = v->lit;
    preset.ambient = 0.2;
    preset.diffuse = 0.8;
    preset.specular = 0.3;
    preset.power = 20;
    CtsRenderSettings s = cts_check_settings(run, v->width, v->height);
    s.azimuth_deg = v->view.azimuth_deg;
    s.elevation_deg = v->view.elevation_deg;
    s.mm_per_pixel = v->view.mm_per_pixel;
    s.max_error = v->max_error;
    if (!(st = cts_check_render(run, volume, &preset, &s, &picture, err)) &&
        !(st = make_truth(run, volume, &preset, &s, err)))
        judge(run, &s, picture, bound);
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

enum { SIDE = 24 };
static const double soft_hu = 40, metal_hu = 2500;

/* A cube of grain, in air; the half of it is metal of numbers[3] HU, if of any. */
static double hu_grain(const double vox[3], const void *data)
{
    bool inside = true;
    for (int a = 0; a < 3; a++)
        inside = inside && vox[a] > 1 && vox[a] < SIDE - 2;
    const double *metal = (const double *)data + 3;
    return !inside ? -1000 : *metal > 0 && vox[0] > 12 ? *metal : cts_hu_noise(vox, data);
}

/* A ball in air, its edge a third of a voxel wide. */
static double hu_ball(const double vox[3], const void *data)
{
    const double *radius = data;
    const double r = sqrt(pow(vox[0] - 11.2, 2) + pow(vox[1] - 12.1, 2) + pow(vox[2] - 11.6, 2));
    return -1000 + 4000 * fmin(fmax((radius[0] - r) / 0.3 + 0.5, 0), 1);
}

static double every(double at, double step)
{
    return fmod(at, step) == 3;
}

/* numbers: what there is of 1 plates, 2 wires, 3 dots; 4 a single dot; one voxel each. Then their HU, 0: metal's. */
static double hu_thin(const double vox[3], const void *data)
{
    const double *kind = data;
    const bool z = every(vox[2], 6) != 0, y = every(vox[1], 6) != 0, x = every(vox[0], 6) != 0;
    if (kind[0] > 3)
        return vox[0] == 12 && vox[1] == 9 && vox[2] == 13 ? metal_hu : soft_hu;
    return z && (y || kind[0] < 2) && (x || kind[0] < 3) ? kind[1] > 0 ? kind[1] : metal_hu : soft_hu;
}

/* A stent: one wire wound about the volume's axis. */
static double hu_helix(const double vox[3], const void *data)
{
    const double radius = 7, pitch = 6, x = vox[0] - 11.5, y = vox[1] - 11.5;
    const double off = remainder(vox[2] - pitch * atan2(y, x) / (2 * M_PI), pitch);
    (void)data;
    return fabs(hypot(x, y) - radius) < 0.6 && fabs(off) < 0.7 ? metal_hu : soft_hu;
}

/* Two neighbouring grey levels, at random. */
static double hu_two_levels(const double vox[3], const void *data)
{
    const double *low_and_seed = data;
    const double unit[3] = {0, 1, low_and_seed[1]};
    return low_and_seed[0] + (cts_hu_noise(vox, unit) > 0.5);
}

/* Haze with grain for 500 mm, metal of numbers[0] HU to the right of it. */
static double hu_haze(const double vox[3], const void *data)
{
    const double *metal = data;
    return vox[0] > 7 ? metal[0] : soft_hu + cts_hu_noise(vox, (const double[3]){-20, 20, 7});
}

/* A lump with grain, in air. */
static double hu_lump(const double vox[3], const void *data)
{
    const double x = (vox[0] - 11) / 8, y = (vox[1] - 12) / 9, z = (vox[2] - 11.4) / 7;
    return -1000 + 2600 * exp(-(x * x + y * y + z * z + 0.4 * x * y - 0.3 * y * z)) + cts_hu_noise(vox, data);
}

static const CtsCheckPoint from_1800[] = {{1800, 0, {1, 0.9, 0.7}}, {2500, 0.9, {1, 0.9, 0.7}}};
static const CtsCheckPoint step_1800[] = {{1800, 0, {1, 0.9, 0.7}}, {1800, 0.9, {1, 1, 1}}};
static const CtsCheckPoint between_levels[] = {
    {500.02, 0, {1, 0.7, 0.3}}, {500.5, 1, {1, 0.7, 0.3}}, {500.98, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint within_levels[] = {
    {500.02, 0, {1, 1, 1}}, {500.02, 0.8, {1, 1, 1}}, {500.98, 0.8, {1, 1, 1}}, {500.98, 0, {1, 1, 1}}};
static const CtsCheckPoint soft[] = {{-165, 0, {0.8, 0.3, 0.2}}, {40, 0.03, {1, 0.6, 0.5}}, {485, 0.5, {1, 1, 1}}};
static const CtsCheckPoint metal[] = {{1500, 0, {0.8, 0.8, 0.9}}, {2500, 0.4, {0.9, 0.9, 1}}, {8000, 0.95, {1, 1, 1}}};
static const CtsCheckPoint hundredth[] = {{500.22, 0, {1, 0.7, 0.3}},
                                          {500.22, 0.9, {1, 0.7, 0.3}},
                                          {500.235, 0.9, {1, 0.7, 0.3}},
                                          {500.235, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint thin_shell[] = {
    {300.02, 0, {1, 0.7, 0.3}}, {300.5, 1, {1, 0.7, 0.3}}, {300.98, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint haze_and_metal[] = {
    {-500, 0, {1, 1, 1}}, {-500, 3e-5, {1, 1, 1}}, {1500, 3e-5, {1, 1, 1}}, {3000, 1, {1, 1, 1}}};
static const CtsCheckPoint haze_to_metal[] = {{-500, 0, {1, 1, 1}},
                                              {-500, 3e-5, {1, 1, 1}},
                                              {1500, 3e-5, {1, 1, 1}},
                                              {1600, 1, {1, 1, 1}},
                                              {20000, 1, {1, 1, 1}}};
static const CtsCheckPoint about_metal[] = {
    {103, 0, {0.2, 0.7, 0.9}}, {103, 1, {0.2, 0.7, 0.9}}, {9500, 1, {0.2, 0.7, 0.9}}, {9500, 0, {0.2, 0.7, 0.9}}};
static const CtsCheckPoint faint_ramp[] = {{1116, 0, {0.7, 0.3, 0.9}}, {1416, 0.1, {0.8, 0.3, 0.6}}};
static const CtsCheckPoint step_300[] = {{300, 0, {1, 1, 1}}, {300, 0.9, {1, 1, 1}}};
static const CtsCheckPoint step_100[] = {{100, 0, {1, 0.8, 0.6}}, {100, 1, {1, 0.8, 0.6}}};
static const CtsCheckPoint stripes[] = {{60, 0, {1, 0, 0}},  {60, 0.3, {1, 0.5, 0}}, {150, 0.3, {1, 0.5, 0}},
                                        {150, 0, {0, 0, 0}}, {400, 0, {0, 1, 1}},    {400, 1, {0, 1, 1}},
                                        {900, 1, {0, 1, 1}}, {900, 0.02, {1, 1, 1}}};
static const CtsCheckPoint steps[] = {{0, 0, {1, 0, 0}},      {0, 0.1, {1, 0, 0}},    {400, 0.1, {1, 0.5, 0}},
                                      {400, 0.02, {0, 1, 1}}, {900, 0.02, {0, 1, 1}}, {900, 1, {1, 1, 1}}};

#define CUBE .dims = {SIDE, SIDE, SIDE}
#define PLATES CUBE, .hu = hu_thin, .numbers = {1}
#define WIRES CUBE, .hu = hu_thin, .numbers = {2}
#define DOTS CUBE, .hu = hu_thin, .numbers = {3}
#define BRIGHT(KIND) CUBE, .hu = hu_thin, .numbers = {KIND, 20000}
#define BALL CUBE, .hu = hu_ball, .numbers = {8}
#define GRAIN CUBE, .hu = hu_grain, .numbers = {20, 60, 5}
#define GRAIN_AND_METAL CUBE, .hu = hu_grain, .numbers = {20, 60, 5, 20000}
#define DOT CUBE, .hu = hu_thin, .numbers = {4}
#define HELIX CUBE, .hu = hu_helix
#define LEVELS .dims = {12, 12, 12}, .hu = hu_two_levels, .numbers = {500, 8}
#define LUMP CUBE, .hu = hu_lump, .numbers = {-30, 30, 4}
#define HAZE(METAL, POINTS) .dims = {12, 502, 12}, .hu = hu_haze, .numbers = {METAL}, CHECK_POINTS(POINTS)
#define CHECK_POINTS(ARRAY) .points = (ARRAY), .n_points = (int)(sizeof(ARRAY) / sizeof *(ARRAY))
/* Magnified: rows lie closer than voxels; reduced: pixels miss voxels. */
#define QUARTER(AZ, EL) .view = {AZ, EL, 0.25}, .width = 48, .height = 64
#define HALF(AZ, EL) .view = {AZ, EL, 0.5}, .width = 44, .height = 44
#define WHOLE(AZ, EL) .view = {AZ, EL, 1}, .width = 32, .height = 32
#define DOUBLE(AZ, EL) .view = {AZ, EL, 2}, .width = 18, .height = 18

#define VOXELS(NAME, ...)                                                                                              \
    {                                                                                                                  \
        NAME, CHECK_OF_TILED | CHECK_OF_RAYCAST, voxels, &(const VoxelScene)                                           \
        {                                                                                                              \
            __VA_ARGS__                                                                                                \
        }                                                                                                              \
    }

/* What tiled does not keep yet. */
#define EXACT(NAME, ...)                                                                                               \
    {                                                                                                                  \
        NAME, CHECK_OF_RAYCAST, voxels, &(const VoxelScene)                                                            \
        {                                                                                                              \
            __VA_ARGS__                                                                                                \
        }                                                                                                              \
    }

static const CtsCheckCase cases[] = {
    VOXELS("voxels: plates, magnified", PLATES, CHECK_POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: plates, magnified, oblique", PLATES, CHECK_POINTS(from_1800), QUARTER(30, 20)),
    EXACT("voxels: plates, oblique", PLATES, CHECK_POINTS(from_1800), WHOLE(-50, 35)),
    VOXELS("voxels: plates, reduced", PLATES, CHECK_POINTS(from_1800), DOUBLE(120, -65)),
    VOXELS("voxels: plates by a step, magnified", PLATES, CHECK_POINTS(step_1800), QUARTER(5, 2)),
    VOXELS("voxels: wires, magnified", WIRES, CHECK_POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: wires, magnified, oblique", WIRES, CHECK_POINTS(from_1800), HALF(-35, 25)),
    VOXELS("voxels: wires, oblique", WIRES, CHECK_POINTS(from_1800), WHOLE(70, 50)),
    VOXELS("voxels: wires, reduced", WIRES, CHECK_POINTS(from_1800), DOUBLE(200, 10)),
    VOXELS("voxels: dots, magnified", DOTS, CHECK_POINTS(step_1800), QUARTER(0, 0)),
    VOXELS("voxels: dots, magnified, oblique", DOTS, CHECK_POINTS(from_1800), HALF(45, 35.26)),
    VOXELS("voxels: dots, oblique", DOTS, CHECK_POINTS(step_1800), WHOLE(-20, 70)),
    VOXELS("voxels: dots, reduced", DOTS, CHECK_POINTS(from_1800), DOUBLE(33, 57)),
    VOXELS("voxels: a stent, magnified", HELIX, CHECK_POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: a stent, magnified, oblique", HELIX, CHECK_POINTS(from_1800), HALF(30, 20)),
    VOXELS("voxels: a stent from the head", HELIX, CHECK_POINTS(from_1800), WHOLE(10, 85)),
    VOXELS("voxels: a stent, reduced", HELIX, CHECK_POINTS(from_1800), DOUBLE(-110, -15)),
    VOXELS("voxels: a peak between two levels", LEVELS, CHECK_POINTS(between_levels), QUARTER(0, 0)),
    EXACT("voxels: a peak between two levels, oblique", LEVELS, CHECK_POINTS(between_levels), HALF(25, -40)),
    EXACT("voxels: a shell of a hundredth of a level", LEVELS, CHECK_POINTS(hundredth), QUARTER(46.69, 0.445)),
    EXACT("voxels: a plateau between two levels, oblique", LEVELS, CHECK_POINTS(within_levels), WHOLE(-60, 15)),
    VOXELS("voxels: a shell between two levels", LUMP, CHECK_POINTS(thin_shell), HALF(30, 20)),
    VOXELS("voxels: plates, magnified, 0.1 asked", PLATES, CHECK_POINTS(from_1800), QUARTER(0, 0), .max_error = 0.1),
    VOXELS("voxels: plates, reduced, 0.1 asked", PLATES, CHECK_POINTS(from_1800), DOUBLE(120, -65), .max_error = 0.1),
    VOXELS("voxels: wires, oblique, 0.25 asked", WIRES, CHECK_POINTS(from_1800), WHOLE(70, 50), .max_error = 0.25),
    VOXELS("voxels: dots, magnified, oblique, 0.25 asked", DOTS, CHECK_POINTS(from_1800), HALF(45, 35.26),
           .max_error = 0.25),
    VOXELS("voxels: one dot, oblique, 0.1 asked", DOT, CHECK_POINTS(step_300), QUARTER(45, 35.26), .max_error = 0.1),
    VOXELS("voxels: a stent from the head, 0.1 asked", HELIX, CHECK_POINTS(from_1800), WHOLE(10, 85), .max_error = 0.1),
    VOXELS("voxels: a peak between two levels, 0.5 asked", LEVELS, CHECK_POINTS(between_levels), QUARTER(0, 0),
           .max_error = 0.5),
    VOXELS("voxels: a step, magnified, 0.1 asked", LUMP, CHECK_POINTS(step_300), QUARTER(0, 0), .max_error = 0.1),
    VOXELS("voxels: a step, oblique, 0.1 asked", LUMP, CHECK_POINTS(step_300), WHOLE(-125, 40), .max_error = 0.1),
    VOXELS("voxels: a step, lit, oblique, 0.25 asked", LUMP, CHECK_POINTS(step_300), HALF(-30, 15), .lit = true,
           .max_error = 0.25),
    VOXELS("voxels: steps of colour, oblique, 0.5 asked", LUMP, CHECK_POINTS(steps), HALF(80, 30), .max_error = 0.5),
    VOXELS("voxels: shells about bright wires", BRIGHT(2), CHECK_POINTS(about_metal), HALF(47, 27.85)),
    /* Opaque where a voxel brightens its cells ever so little: rays graze it between the places that are looked at. */
    VOXELS("voxels: grazing a dot", DOT, CHECK_POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a dot, magnified", DOT, CHECK_POINTS(step_100), QUARTER(70, 50)),
    VOXELS("voxels: grazing dots, not magnified", DOTS, CHECK_POINTS(step_100), WHOLE(33, 57)),
    VOXELS("voxels: grazing bright dots", BRIGHT(3), CHECK_POINTS(step_300), WHOLE(-110, -15)),
    VOXELS("voxels: grazing wires", WIRES, CHECK_POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a stent", HELIX, CHECK_POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a stent, not magnified", HELIX, CHECK_POINTS(step_1800), WHOLE(33, 57)),
    VOXELS("voxels: stripes about one dot, magnified", DOT, CHECK_POINTS(stripes), QUARTER(45, 35.26)),
    VOXELS("voxels: stripes about a stent", HELIX, CHECK_POINTS(stripes), HALF(30, 20)),
    EXACT("voxels: shells about bright wires, magnified", BRIGHT(2), CHECK_POINTS(about_metal), QUARTER(10, -47)),
    EXACT("voxels: shells about bright dots", BRIGHT(3), CHECK_POINTS(about_metal), HALF(10, -47)),
    EXACT("voxels: shells about bright dots, 0.5 asked", BRIGHT(3), CHECK_POINTS(about_metal), QUARTER(47, 28),
          .max_error = 0.5),
    VOXELS("voxels: a sharp ball at 44 degrees, magnified", BALL, CHECK_POINTS(faint_ramp),
           .view = {43.999, -0.516, 0.1}, .width = 160, .height = 40),
    VOXELS("voxels: a sharp ball at 44 degrees, 0.1 asked", BALL, CHECK_POINTS(faint_ramp),
           .view = {43.999, -0.516, 0.1}, .width = 160, .height = 40, .max_error = 0.1),
    VOXELS("voxels: a sharp ball at 45 degrees, 0.1 asked", BALL, CHECK_POINTS(faint_ramp), .view = {45, 0.3, 0.2},
           .width = 80, .height = 40, .max_error = 0.1),
    VOXELS("voxels: grain, lit", GRAIN, CHECK_POINTS(soft), HALF(158.58, 35.56), .lit = true),
    VOXELS("voxels: grain, lit, reduced", GRAIN, CHECK_POINTS(soft), DOUBLE(20, -70), .lit = true),
    VOXELS("voxels: grain, lit, 0.25 asked", GRAIN, CHECK_POINTS(soft), WHOLE(-50, 20), .lit = true, .max_error = 0.25),
    VOXELS("voxels: metal in grain, lit, magnified", GRAIN_AND_METAL, CHECK_POINTS(metal), .view = {43.376, 1.848, 0.2},
           .width = 70, .height = 20, .lit = true),
    VOXELS("voxels: metal in grain, lit, oblique", GRAIN_AND_METAL, CHECK_POINTS(metal), WHOLE(63, -25), .lit = true),
    VOXELS("voxels: haze beside metal of 3000 HU", HAZE(3000, haze_and_metal), HALF(0, 0)),
    VOXELS("voxels: haze beside metal of 3000 HU, oblique", HAZE(3000, haze_and_metal), QUARTER(0.4, 0.3)),
    VOXELS("voxels: haze beside metal of 20000 HU", HAZE(20000, haze_to_metal), HALF(0, 0)),
    VOXELS("voxels: haze beside metal of 20000 HU, oblique", HAZE(20000, haze_to_metal), WHOLE(0.5, -0.2)),
    VOXELS("voxels: a step, magnified", LUMP, CHECK_POINTS(step_300), QUARTER(0, 0)),
    VOXELS("voxels: a step, magnified, oblique", LUMP, CHECK_POINTS(step_300), HALF(30, 20)),
    VOXELS("voxels: a step, oblique", LUMP, CHECK_POINTS(step_300), WHOLE(-125, 40)),
    VOXELS("voxels: a step, lit, oblique", LUMP, CHECK_POINTS(step_300), HALF(-30, 15), .lit = true),
    VOXELS("voxels: a step, lit, reduced", LUMP, CHECK_POINTS(step_300), DOUBLE(60, -25), .lit = true),
    VOXELS("voxels: steps of colour, oblique", LUMP, CHECK_POINTS(steps), HALF(80, 30)),
    VOXELS("voxels: steps of colour, lit, oblique", LUMP, CHECK_POINTS(steps), WHOLE(155, 5), .lit = true),
};

const CtsCheckTable cts_check_voxels = {cases, sizeof cases / sizeof *cases};
