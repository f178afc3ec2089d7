/* Structures of a voxel's size, steps, and haze beside metal, from all sides and at all scales, against rays through
 * their voxels. Structures whose visible part is thinner than a voxel are the first to be lost by an engine that
 * samples too coarsely. */
#include "lab/check/suite.h"

#include <math.h>

/* Largest error of a pixel as a multiple of the picture's rms error. */
#define PIXELWISE 25

static double clamped_value(double value)
{
    return fmin(fmax(value, 0), 1);
}

/* Found is the rms over the picture's colours, or a PIXELWISE-th of the largest difference where that is more: the
 * pixel named has the largest error. In a dark scene at most an eighth of its light may be missing. */
static void check_picture(CtsCheckRun *run, const CtsRenderSettings *s, const CtsPicture *picture, double bound)
{
    CtsCheckWorst worst = {0};
    double sum = 0, light = 0;
    for (int y = 0; y < s->height; y++)
        for (int x = 0; x < s->width; x++) {
            const size_t at = 4 * ((size_t)y * (size_t)s->width + (size_t)x);
            const float *found = picture->pixels + at;
            const double *rgba = run->truth + at;
            for (int c = 0; c < 3; c++) {
                const double d = clamped_value((double)found[c]) - clamped_value(rgba[c]);
                sum += d * d;
                light += clamped_value(rgba[c]) * clamped_value(rgba[c]);
                cts_check_worst(&worst, x, y, clamped_value(rgba[c]), clamped_value((double)found[c]));
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
    const CtsFormulaScene *s = data;
    /* The truth's own error at steps that a ray grazes. */
    const bool is_reference = cts_check_family(run->engine) == CHECK_RAYCAST;
    const double bound = is_reference ? 3e-4 : s->max_error > 0 ? s->max_error / 255 : CHECK_PROMISED;
    CtsRenderedScene m;
    CtsPicture *picture = NULL;
    CtsStatus st = cts_check_make(run, s, &m, err);
    m.preset.diffuse = 0.8;
    if (!st && !(st = cts_check_render(run, &m.model, &m.preset, &m.settings, &picture, err)) &&
        !(st = cts_check_find_truth(run, &m, cts_check_volume_truth, &m, err)))
        check_picture(run, &m.settings, picture, bound);
    cts_picture_free(&picture);
    cts_model_free(&m.model);
    return st;
}

enum { SIDE = 24 };
static const double soft_hu = 40, metal_hu = 2500;

/* A cube of grain, in air; the half of it is metal of hu[3] HU, if of any. */
static double hu_grain(const double vox[3], const void *data)
{
    bool inside = true;
    for (int a = 0; a < 3; a++)
        inside = inside && vox[a] > 1 && vox[a] < SIDE - 2;
    const double *metal = (const double *)data + 3;
    return !inside ? -1000 : *metal > 0 && vox[0] > 12 ? *metal : cts_hu_noise(vox, data);
}

/* A ball in air, its edge a third of a voxel wide. */
static double hu_sharp_ball(const double vox[3], const void *data)
{
    const double *radius = data;
    const double r = sqrt(pow(vox[0] - 11.2, 2) + pow(vox[1] - 12.1, 2) + pow(vox[2] - 11.6, 2));
    return -1000 + 4000 * fmin(fmax((radius[0] - r) / 0.3 + 0.5, 0), 1);
}

static double every(double at, double step)
{
    return fmod(at, step) == 3;
}

/* hu: 1 plates, 2 wires, 3 dots, 4 a single dot; one voxel each. Then their HU, 0: metal's. */
static double hu_thin(const double vox[3], const void *data)
{
    const double *kind = data;
    const bool z = every(vox[2], 6) != 0, y = every(vox[1], 6) != 0, x = every(vox[0], 6) != 0;
    if (kind[0] > 3)
        return vox[0] == 12 && vox[1] == 9 && vox[2] == 13 ? metal_hu : soft_hu;
    return z && (y || kind[0] < 2) && (x || kind[0] < 3) ? kind[1] > 0 ? kind[1] : metal_hu : soft_hu;
}

/* One plate (hu[0] 1), line (2) or dot (3), of hu[1] HU in air. */
static double hu_single(const double vox[3], const void *data)
{
    const double *kind = data;
    for (int a = 0; a < kind[0]; a++)
        if (vox[a] != 8)
            return -1000;
    return kind[1] - 1000;
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

/* Haze with grain for 500 mm, metal of hu[0] HU to the right of it. */
static double hu_grainy_haze(const double vox[3], const void *data)
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
static const CtsCheckPoint from_150[] = {{150, 0, {1, 1, 1}}, {500, 0.75, {1, 1, 1}}};
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
static const CtsCheckPoint low_ramp[] = {{1116, 0, {0.7, 0.3, 0.9}}, {1416, 0.1, {0.8, 0.3, 0.6}}};
static const CtsCheckPoint step_300[] = {{300, 0, {1, 1, 1}}, {300, 0.9, {1, 1, 1}}};
static const CtsCheckPoint step_100[] = {{100, 0, {1, 0.8, 0.6}}, {100, 1, {1, 0.8, 0.6}}};
static const CtsCheckPoint stripes[] = {{60, 0, {1, 0, 0}},  {60, 0.3, {1, 0.5, 0}}, {150, 0.3, {1, 0.5, 0}},
                                        {150, 0, {0, 0, 0}}, {400, 0, {0, 1, 1}},    {400, 1, {0, 1, 1}},
                                        {900, 1, {0, 1, 1}}, {900, 0.02, {1, 1, 1}}};
static const CtsCheckPoint steps[] = {{0, 0, {1, 0, 0}},      {0, 0.1, {1, 0, 0}},    {400, 0.1, {1, 0.5, 0}},
                                      {400, 0.02, {0, 1, 1}}, {900, 0.02, {0, 1, 1}}, {900, 1, {1, 1, 1}}};

#define CUBE CUBE_OF(SIDE), .power = 20
#define PLATES CUBE, .formula = hu_thin, .hu = {1}
#define WIRES CUBE, .formula = hu_thin, .hu = {2}
#define DOTS CUBE, .formula = hu_thin, .hu = {3}
#define BRIGHT(KIND) CUBE, .formula = hu_thin, .hu = {KIND, 20000}
#define BALL CUBE, .formula = hu_sharp_ball, .hu = {8}
#define GRAIN CUBE, .formula = hu_grain, .hu = {20, 60, 5}
#define GRAIN_AND_METAL CUBE, .formula = hu_grain, .hu = {20, 60, 5, 20000}
#define DOT CUBE, .formula = hu_thin, .hu = {4}
#define HELIX CUBE, .formula = hu_helix
#define LEVELS CUBE_OF(12), .power = 20, .formula = hu_two_levels, .hu = {500, 8}
#define LUMP CUBE, .formula = hu_lump, .hu = {-30, 30, 4}
#define HAZE(METAL, BY) .dims = {12, 502, 12}, .formula = hu_grainy_haze, .hu = {METAL}, POINTS(BY)
/* Magnified: rows lie closer than voxels; reduced: pixels miss voxels. */
#define QUARTER(AZ, EL) VIEW(AZ, EL), .mm_per_pixel = 0.25, PIXELS(48, 64)
#define HALF(AZ, EL) VIEW(AZ, EL), .mm_per_pixel = 0.5, PIXELS(44, 44)
#define WHOLE(AZ, EL) VIEW(AZ, EL), .mm_per_pixel = 1, PIXELS(32, 32)
#define DOUBLE(AZ, EL) VIEW(AZ, EL), .mm_per_pixel = 2, PIXELS(18, 18)

/* From the side, where a ray may pass between two layers in which it is hardly visible. */
#define SINGLE(KIND, HU, AZ, EL)                                                                                       \
    CUBE_OF(17), .formula = hu_single, .hu = {KIND, HU}, POINTS(from_150), VIEW(AZ, EL), .mm_per_pixel = 0.23,         \
                 PIXELS(60, 60)

#define VOXELS(NAME, ...) SCENE(NAME, CHECK_OF_FIELDS | CHECK_OF_SHEETS, voxels, __VA_ARGS__)
/* Cases whose target tiled does not meet yet. */
#define OF_REFERENCE(NAME, ...) SCENE(NAME, CHECK_OF_RAYCAST, voxels, __VA_ARGS__)

static const CtsCheckCase cases[] = {
    VOXELS("thin: a plate at 45", SINGLE(1, 2500, 45, 0)),
    VOXELS("thin: a plate at 44, 30", SINGLE(1, 2500, 44, 30)),
    VOXELS("thin: a line at 45", SINGLE(2, 2500, 45, 0)),
    VOXELS("thin: a line at 30, 20", SINGLE(2, 2500, 30, 20)),
    VOXELS("thin: a bright line at 45", SINGLE(2, 20000, 45, 0)),
    VOXELS("thin: a dot at 45, 35", SINGLE(3, 2500, 45, 35.26)),
    VOXELS("thin: a bright dot at 45, 35", SINGLE(3, 20000, 45, 35.26)),
    VOXELS("voxels: plates, magnified", PLATES, POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: plates, magnified, oblique", PLATES, POINTS(from_1800), QUARTER(30, 20)),
    OF_REFERENCE("voxels: plates, oblique", PLATES, POINTS(from_1800), WHOLE(-50, 35)),
    VOXELS("voxels: plates, reduced", PLATES, POINTS(from_1800), DOUBLE(120, -65)),
    VOXELS("voxels: plates by a step, magnified", PLATES, POINTS(step_1800), QUARTER(5, 2)),
    VOXELS("voxels: wires, magnified", WIRES, POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: wires, magnified, oblique", WIRES, POINTS(from_1800), HALF(-35, 25)),
    VOXELS("voxels: wires, oblique", WIRES, POINTS(from_1800), WHOLE(70, 50)),
    VOXELS("voxels: wires, reduced", WIRES, POINTS(from_1800), DOUBLE(200, 10)),
    VOXELS("voxels: dots, magnified", DOTS, POINTS(step_1800), QUARTER(0, 0)),
    VOXELS("voxels: dots, magnified, oblique", DOTS, POINTS(from_1800), HALF(45, 35.26)),
    VOXELS("voxels: dots, oblique", DOTS, POINTS(step_1800), WHOLE(-20, 70)),
    VOXELS("voxels: dots, reduced", DOTS, POINTS(from_1800), DOUBLE(33, 57)),
    VOXELS("voxels: a stent, magnified", HELIX, POINTS(from_1800), QUARTER(0, 0)),
    VOXELS("voxels: a stent, magnified, oblique", HELIX, POINTS(from_1800), HALF(30, 20)),
    VOXELS("voxels: a stent from the head", HELIX, POINTS(from_1800), WHOLE(10, 85)),
    VOXELS("voxels: a stent, reduced", HELIX, POINTS(from_1800), DOUBLE(-110, -15)),
    VOXELS("voxels: a peak between two levels", LEVELS, POINTS(between_levels), QUARTER(0, 0)),
    OF_REFERENCE("voxels: a peak between two levels, oblique", LEVELS, POINTS(between_levels), HALF(25, -40)),
    OF_REFERENCE("voxels: a shell of a hundredth of a level", LEVELS, POINTS(hundredth), QUARTER(46.69, 0.445)),
    OF_REFERENCE("voxels: a plateau between two levels, oblique", LEVELS, POINTS(within_levels), WHOLE(-60, 15)),
    VOXELS("voxels: a shell between two levels", LUMP, POINTS(thin_shell), HALF(30, 20)),
    VOXELS("voxels: plates, magnified, 0.1 asked", PLATES, POINTS(from_1800), QUARTER(0, 0), .max_error = 0.1),
    VOXELS("voxels: plates, reduced, 0.1 asked", PLATES, POINTS(from_1800), DOUBLE(120, -65), .max_error = 0.1),
    VOXELS("voxels: wires, oblique, 0.25 asked", WIRES, POINTS(from_1800), WHOLE(70, 50), .max_error = 0.25),
    VOXELS("voxels: dots, magnified, oblique, 0.25 asked", DOTS, POINTS(from_1800), HALF(45, 35.26), .max_error = 0.25),
    VOXELS("voxels: one dot, oblique, 0.1 asked", DOT, POINTS(step_300), QUARTER(45, 35.26), .max_error = 0.1),
    VOXELS("voxels: a stent from the head, 0.1 asked", HELIX, POINTS(from_1800), WHOLE(10, 85), .max_error = 0.1),
    VOXELS("voxels: a peak between two levels, 0.5 asked", LEVELS, POINTS(between_levels), QUARTER(0, 0),
           .max_error = 0.5),
    VOXELS("voxels: a step, magnified, 0.1 asked", LUMP, POINTS(step_300), QUARTER(0, 0), .max_error = 0.1),
    VOXELS("voxels: a step, oblique, 0.1 asked", LUMP, POINTS(step_300), WHOLE(-125, 40), .max_error = 0.1),
    VOXELS("voxels: a step, lit, oblique, 0.25 asked", LUMP, POINTS(step_300), HALF(-30, 15), .lit = true,
           .max_error = 0.25),
    VOXELS("voxels: steps of colour, oblique, 0.5 asked", LUMP, POINTS(steps), HALF(80, 30), .max_error = 0.5),
    VOXELS("voxels: shells about bright wires", BRIGHT(2), POINTS(about_metal), HALF(47, 27.85)),
    /* Opaque where a voxel is only slightly above its cells: rays graze it between sampling positions. */
    VOXELS("voxels: grazing a dot", DOT, POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a dot, magnified", DOT, POINTS(step_100), QUARTER(70, 50)),
    VOXELS("voxels: grazing dots, not magnified", DOTS, POINTS(step_100), WHOLE(33, 57)),
    VOXELS("voxels: grazing bright dots", BRIGHT(3), POINTS(step_300), WHOLE(-110, -15)),
    VOXELS("voxels: grazing wires", WIRES, POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a stent", HELIX, POINTS(step_100), HALF(-35, 25)),
    VOXELS("voxels: grazing a stent, not magnified", HELIX, POINTS(step_1800), WHOLE(33, 57)),
    VOXELS("voxels: stripes about one dot, magnified", DOT, POINTS(stripes), QUARTER(45, 35.26)),
    VOXELS("voxels: stripes about a stent", HELIX, POINTS(stripes), HALF(30, 20)),
    OF_REFERENCE("voxels: shells about bright wires, magnified", BRIGHT(2), POINTS(about_metal), QUARTER(10, -47)),
    OF_REFERENCE("voxels: shells about bright dots", BRIGHT(3), POINTS(about_metal), HALF(10, -47)),
    OF_REFERENCE("voxels: shells about bright dots, 0.5 asked", BRIGHT(3), POINTS(about_metal), QUARTER(47, 28),
                 .max_error = 0.5),
    VOXELS("voxels: a sharp ball at 44 degrees, magnified", BALL, POINTS(low_ramp), VIEW(43.999, -0.516),
           .mm_per_pixel = 0.1, PIXELS(160, 40)),
    VOXELS("voxels: a sharp ball at 44 degrees, 0.1 asked", BALL, POINTS(low_ramp), VIEW(43.999, -0.516),
           .mm_per_pixel = 0.1, PIXELS(160, 40), .max_error = 0.1),
    VOXELS("voxels: a sharp ball at 45 degrees, 0.1 asked", BALL, POINTS(low_ramp), VIEW(45, 0.3), .mm_per_pixel = 0.2,
           PIXELS(80, 40), .max_error = 0.1),
    VOXELS("voxels: grain, lit", GRAIN, POINTS(soft), HALF(158.58, 35.56), .lit = true),
    VOXELS("voxels: grain, lit, reduced", GRAIN, POINTS(soft), DOUBLE(20, -70), .lit = true),
    VOXELS("voxels: grain, lit, 0.25 asked", GRAIN, POINTS(soft), WHOLE(-50, 20), .lit = true, .max_error = 0.25),
    VOXELS("voxels: metal in grain, lit, magnified", GRAIN_AND_METAL, POINTS(metal), VIEW(43.376, 1.848),
           .mm_per_pixel = 0.2, PIXELS(70, 20), .lit = true),
    VOXELS("voxels: metal in grain, lit, oblique", GRAIN_AND_METAL, POINTS(metal), WHOLE(63, -25), .lit = true),
    VOXELS("voxels: haze beside metal of 3000 HU", HAZE(3000, haze_and_metal), HALF(0, 0)),
    VOXELS("voxels: haze beside metal of 3000 HU, oblique", HAZE(3000, haze_and_metal), QUARTER(0.4, 0.3)),
    VOXELS("voxels: haze beside metal of 20000 HU", HAZE(20000, haze_to_metal), HALF(0, 0)),
    VOXELS("voxels: haze beside metal of 20000 HU, oblique", HAZE(20000, haze_to_metal), WHOLE(0.5, -0.2)),
    VOXELS("voxels: a step, magnified", LUMP, POINTS(step_300), QUARTER(0, 0)),
    VOXELS("voxels: a step, magnified, oblique", LUMP, POINTS(step_300), HALF(30, 20)),
    VOXELS("voxels: a step, oblique", LUMP, POINTS(step_300), WHOLE(-125, 40)),
    VOXELS("voxels: a step, lit, oblique", LUMP, POINTS(step_300), HALF(-30, 15), .lit = true),
    VOXELS("voxels: a step, lit, reduced", LUMP, POINTS(step_300), DOUBLE(60, -25), .lit = true),
    VOXELS("voxels: steps of colour, oblique", LUMP, POINTS(steps), HALF(80, 30)),
    VOXELS("voxels: steps of colour, lit, oblique", LUMP, POINTS(steps), WHOLE(155, 5), .lit = true),
};

const CtsCheckTable cts_check_voxels = {cases, sizeof cases / sizeof *cases};
