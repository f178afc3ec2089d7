/* Bit-exact properties: CPU features, and the paper's savings in lossless settings. Found is the number of
 * different values. */
#include "base/cpu.h"
#include "lab/check/suite.h"

#include <math.h>

/* Mostly air, and repeated layers: the input on which void voxels and similar layers save most. */
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

/* Equal in all layers, 499 HU and a little of 500: visibility depends on the last of a patch's levels. */
static double hu_one_level(const double vox[3], const void *data)
{
    return 499 + (cts_hu_noise((const double[3]){vox[0], 0, vox[2]}, data) > 0.97);
}

/* Every layer 2 HU beside the one before it. */
static double hu_in_turns(const double vox[3], const void *data)
{
    return cts_hu_noise((const double[3]){vox[0], 0, vox[2]}, data) + 2 * fmod(vox[1], 2);
}

/* cpu_mask: features that b may use. */
static CtsStatus compare_pictures(CtsCheckRun *run_a, CtsCheckRun *run_b, const CtsFormulaScene *a,
                                  const CtsFormulaScene *b, unsigned cpu_mask, CtsError *err)
{
    CtsPicture *pa = NULL, *pb = NULL;
    cts_cpu_set_mask(cpu_mask);
    CtsStatus st = cts_check_show(run_b, b, &pb, err);
    cts_cpu_set_mask(~0u);
    if (!st && !(st = cts_check_show(run_a, a, &pa, err)))
        cts_check_value(run_a, 0, cts_check_differing(pa, pb), 0);
    cts_picture_free(&pa);
    cts_picture_free(&pb);
    return st;
}

static CtsStatus cpu_features(CtsCheckRun *run, const void *data, CtsError *err)
{
    return compare_pictures(run, run, data, data, 0, err);
}

static CtsStatus savings(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsCheckRun classic = *run;
    classic.engine = CTS_ENGINE_CLASSIC;
    return compare_pictures(run, &classic, data, data, ~0u, err);
}

/* A change of exactly the tolerance counts as none, so that a larger tolerance makes no difference. */
static CtsStatus tolerance(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsFormulaScene a = *(const CtsFormulaScene *)data, b = a;
    a.tolerance_hu = 2;
    b.tolerance_hu = 3;
    return compare_pictures(run, run, &a, &b, ~0u, err);
}

static const CtsCheckPoint tissues[] = {{100, 0, {0.9, 0.4, 0.3}}, {700, 0.2, {1, 0.9, 0.6}}, {1100, 0.6, {1, 1, 1}}};
static const CtsCheckPoint all_bits[] = {{-1024, 0, {0, 0.5, 1}}, {64511, 0.1, {1, 0.5, 0}}};
static const CtsCheckPoint one_level[] = {{499, 0, {1, 0.5, 0}}, {500, 0.3, {1, 0.5, 0}}};

#define EQUAL(NAME, ENGINES, RUN, ...) SCENE(NAME, ENGINES, RUN, .dims = {45, 38, 41}, PIXELS(70, 61), __VA_ARGS__)
#define NOISE .formula = cts_hu_noise, .hu = {-200, 1200, 1}, VIEW(20, 10), POINTS(tissues)
#define LIT_NOISE .formula = cts_hu_noise, .hu = {-200, 1200, 2}, .lit = true, VIEW(-50, 25), POINTS(tissues)
#define CHECKERS .formula = cts_hu_checkers, VIEW(5, 70), POINTS(tissues)
#define CHECKERS_GAUSSIAN .formula = cts_hu_checkers, .kernel = CTS_KERNEL_GAUSSIAN, POINTS(tissues)
#define BLOCKS .formula = hu_blocks, .hu = {-300, 1200, 4}, POINTS(tissues)
#define BLOCKS_OBLIQUE                                                                                                 \
    .formula = hu_blocks, .hu = {-300, 1200, 4}, .lit = true, VIEW(33, -21), .kernel = CTS_KERNEL_BSPLINE,             \
    POINTS(tissues)
#define BLOCKS_CONE                                                                                                    \
    .formula = hu_blocks, .hu = {-300, 1200, 4}, VIEW(90, 10), .kernel = CTS_KERNEL_CONE_PAPER, POINTS(tissues)
#define REPEATS                                                                                                        \
    .formula = hu_repeats, .hu = {-1024, 64511, 6}, VIEW(7, 3), .kernel = CTS_KERNEL_GAUSSIAN, POINTS(all_bits)
#define IN_TURNS .formula = hu_in_turns, .hu = {200, 1100, 5}, POINTS(tissues)
#define ONE_LEVEL .formula = hu_one_level, .hu = {0, 1, 7}, POINTS(one_level)

enum { REUSING = 1u << CTS_ENGINE_LAYERS | 1u << CTS_ENGINE_COMBINED };
enum { SAVING = 1u << CTS_ENGINE_LAYERS | 1u << CTS_ENGINE_VOID | 1u << CTS_ENGINE_COMBINED };

static const CtsCheckCase cases[] = {
    EQUAL("equal: with and without CPU features", CHECK_OF_PAPER | CHECK_OF_TILED | CHECK_OF_SHEETS, cpu_features,
          NOISE),
    EQUAL("equal: with and without CPU features, lit", CHECK_OF_PAPER | CHECK_OF_TILED | CHECK_OF_SHEETS, cpu_features,
          LIT_NOISE),
    EQUAL("equal: with and without CPU features, extremes", CHECK_OF_PAPER | CHECK_OF_TILED | CHECK_OF_SHEETS,
          cpu_features, CHECKERS),
    EQUAL("equal: changes of exactly the tolerance", REUSING, tolerance, IN_TURNS),
    EQUAL("equal: savings on noise", SAVING, savings, NOISE),
    EQUAL("equal: savings on lit noise", SAVING, savings, LIT_NOISE),
    EQUAL("equal: savings on 16-bit extremes", SAVING, savings, CHECKERS),
    EQUAL("equal: savings on 16-bit extremes, gaussian", SAVING, savings, CHECKERS_GAUSSIAN),
    EQUAL("equal: savings on layers that repeat", SAVING, savings, REPEATS),
    EQUAL("equal: savings where one level shows", SAVING, savings, ONE_LEVEL),
    EQUAL("equal: savings on blocks in air", SAVING, savings, BLOCKS),
    EQUAL("equal: savings on blocks in air, lit, B-spline", SAVING, savings, BLOCKS_OBLIQUE),
    EQUAL("equal: savings on blocks in air, cone-paper", SAVING, savings, BLOCKS_CONE),
};

const CtsCheckTable cts_check_equal = {cases, sizeof cases / sizeof *cases};
