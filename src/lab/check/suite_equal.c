/* What must be equal to the bit: threads, CPU features, and the paper's savings when nothing is lost. Found is the
 * number of values that differ. */
#include "base/cpu.h"
#include "lab/check/suite.h"

#include <math.h>
#include <string.h>

typedef struct EqualScene {
    CtsHuFormula hu;
    double range[3];
    bool lit;
    double azimuth_deg, elevation_deg;
    CtsKernelId kernel;
    enum { TISSUES, ALL_BITS, ONE_LEVEL } shown; /* by the preset */
} EqualScene;

static double hu_checkers(const double vox[3], const void *data)
{
    (void)data;
    return fmod(vox[0] + vox[1] + vox[2], 2) > 0 ? 64511 : -1024;
}

/* Mostly air, and layers that repeat: what voids and similar layers feed on. */
static double hu_blocks(const double vox[3], const void *data)
{
    const double block[3] = {floor(vox[0] / 5), floor(vox[1] / 4), floor(vox[2] / 7)};
    const double hu = cts_hu_noise(block, data);
    return hu < 600 ? -1024 : hu;
}

/* Each layer twelve times over, without two equal voxels in it: sums that are carried on from layer to layer. */
static double hu_repeats(const double vox[3], const void *data)
{
    return cts_hu_noise((const double[3]){vox[0], floor(vox[1] / 12), vox[2]}, data);
}

/* Alike in all layers, 499 HU and a little of 500: the last of a patch's levels decides whether it shows. */
static double hu_one_level(const double vox[3], const void *data)
{
    return 499 + (cts_hu_noise((const double[3]){vox[0], 0, vox[2]}, data) > 0.97);
}

/* Every layer 2 HU beside the one before it. */
static double hu_in_turns(const double vox[3], const void *data)
{
    return cts_hu_noise((const double[3]){vox[0], 0, vox[2]}, data) + 2 * fmod(vox[1], 2);
}

static CtsStatus render_scene(CtsCheckRun *run, const EqualScene *e, const CtsRenderSettings *settings,
                              CtsPicture **picture, CtsError *err)
{
    CtsPreset preset = cts_check_preset(
        (const CtsCheckPoint[]){{100, 0, {0.9, 0.4, 0.3}}, {700, 0.2, {1, 0.9, 0.6}}, {1100, 0.6, {1, 1, 1}}}, 3);
    if (e->shown == ALL_BITS)
        preset = cts_check_preset((const CtsCheckPoint[]){{-1024, 0, {0, 0.5, 1}}, {64511, 0.1, {1, 0.5, 0}}}, 2);
    if (e->shown == ONE_LEVEL)
        preset = cts_check_preset((const CtsCheckPoint[]){{499, 0, {1, 0.5, 0}}, {500, 0.3, {1, 0.5, 0}}}, 2);
    preset.shade = e->lit;
    preset.ambient = 0.2;
    preset.diffuse = 0.7;
    preset.specular = 0.2;
    preset.power = 10;
    CtsVolume *volume = NULL;
    CtsRenderSettings s = *settings;
    s.azimuth_deg = e->azimuth_deg;
    s.elevation_deg = e->elevation_deg;
    s.kernel = e->kernel;
    CtsStatus st =
        cts_check_volume(&volume, (const int[3]){45, 38, 41}, (const double[3]){1, 1, 1}, 1, e->hu, e->range, err);
    if (!st)
        st = cts_check_render(run, volume, &preset, &s, picture, err);
    cts_volume_free(&volume);
    return st;
}

static CtsStatus compare(CtsCheckRun *run, const EqualScene *e, const CtsRenderSettings *a, const CtsRenderSettings *b,
                         CtsError *err)
{
    CtsPicture *pa = NULL, *pb = NULL;
    CtsStatus st;
    if (!(st = render_scene(run, e, a, &pa, err)) && !(st = render_scene(run, e, b, &pb, err)))
        cts_check_value(run, 0, cts_check_differing(pa, pb), 0);
    cts_picture_free(&pa);
    cts_picture_free(&pb);
    return st;
}

static CtsStatus threads(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsRenderSettings a = cts_check_settings(run, 70, 61), b = a;
    a.n_threads = 1;
    b.n_threads = 7;
    return compare(run, data, &a, &b, err);
}

static CtsStatus cpu_features(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsRenderSettings s = cts_check_settings(run, 70, 61);
    CtsPicture *plain = NULL, *fast = NULL;
    cts_cpu_set_mask(0);
    CtsStatus st = render_scene(run, data, &s, &plain, err);
    cts_cpu_set_mask(~0u);
    if (!st && !(st = render_scene(run, data, &s, &fast, err)))
        cts_check_value(run, 0, cts_check_differing(plain, fast), 0);
    cts_picture_free(&plain);
    cts_picture_free(&fast);
    return st;
}

static CtsStatus savings(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsRenderSettings a = cts_check_settings(run, 70, 61), b = a;
    b.engine = CTS_ENGINE_CLASSIC;
    return compare(run, data, &a, &b, err);
}

/* A change of exactly the tolerance is none, so that a wider one makes no difference. */
static CtsStatus tolerance(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsRenderSettings a = cts_check_settings(run, 70, 61), b = a;
    a.tolerance_hu = 2;
    b.tolerance_hu = 3;
    return compare(run, data, &a, &b, err);
}

static const EqualScene noise = {cts_hu_noise, {-200, 1200, 1}, false, 20, 10, CTS_KERNEL_TENT, TISSUES};
static const EqualScene lit_noise = {cts_hu_noise, {-200, 1200, 2}, true, -50, 25, CTS_KERNEL_TENT, TISSUES};
static const EqualScene checkers = {hu_checkers, {0, 0, 0}, false, 5, 70, CTS_KERNEL_TENT, TISSUES};
static const EqualScene checkers_gaussian = {hu_checkers, {0, 0, 0}, false, 0, 0, CTS_KERNEL_GAUSSIAN, TISSUES};
static const EqualScene blocks = {hu_blocks, {-300, 1200, 4}, false, 0, 0, CTS_KERNEL_TENT, TISSUES};
static const EqualScene blocks_oblique = {hu_blocks, {-300, 1200, 4}, true, 33, -21, CTS_KERNEL_BSPLINE, TISSUES};
static const EqualScene blocks_cone = {hu_blocks, {-300, 1200, 4}, false, 90, 10, CTS_KERNEL_CONE_PAPER, TISSUES};
static const EqualScene repeats = {hu_repeats, {-1024, 64511, 6}, false, 7, 3, CTS_KERNEL_GAUSSIAN, ALL_BITS};
static const EqualScene in_turns = {hu_in_turns, {200, 1100, 5}, false, 0, 0, CTS_KERNEL_TENT, TISSUES};

static const EqualScene one_level = {hu_one_level, {0, 1, 7}, false, 0, 0, CTS_KERNEL_TENT, ONE_LEVEL};

enum { REUSING = 1u << CTS_ENGINE_LAYERS | 1u << CTS_ENGINE_COMBINED };
enum { SAVING = 1u << CTS_ENGINE_LAYERS | 1u << CTS_ENGINE_VOID | 1u << CTS_ENGINE_COMBINED };

static const CtsCheckCase cases[] = {
    {"equal: 1 and 7 threads", CHECK_OF_ALL, threads, &noise},
    {"equal: 1 and 7 threads, lit", CHECK_OF_ALL, threads, &lit_noise},
    {"equal: with and without CPU features", CHECK_OF_PAPER | CHECK_OF_TILED, cpu_features, &noise},
    {"equal: with and without CPU features, lit", CHECK_OF_PAPER | CHECK_OF_TILED, cpu_features, &lit_noise},
    {"equal: with and without CPU features, extremes", CHECK_OF_PAPER | CHECK_OF_TILED, cpu_features, &checkers},
    {"equal: changes of exactly the tolerance", REUSING, tolerance, &in_turns},
    {"equal: savings on noise", SAVING, savings, &noise},
    {"equal: savings on lit noise", SAVING, savings, &lit_noise},
    {"equal: savings on 16-bit extremes", SAVING, savings, &checkers},
    {"equal: savings on 16-bit extremes, gaussian", SAVING, savings, &checkers_gaussian},
    {"equal: savings on layers that repeat", SAVING, savings, &repeats},
    {"equal: savings where one level shows", SAVING, savings, &one_level},
    {"equal: savings on blocks in air", SAVING, savings, &blocks},
    {"equal: savings on blocks in air, lit, B-spline", SAVING, savings, &blocks_oblique},
    {"equal: savings on blocks in air, cone-paper", SAVING, savings, &blocks_cone},
};

const CtsCheckTable cts_check_equal = {cases, sizeof cases / sizeof *cases};
