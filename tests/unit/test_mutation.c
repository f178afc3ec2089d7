/* Mutation testing: each known fault is enabled in turn, and the stability suite must detect it. Faulty files are
 * compiled a second time, so that faults can be switched while the test runs. */
#include "base/cpu.h"
#include "base/mutation.h"
#include "core/scene/resolve.h"
#include "engine/raycast/raycast.h"
#include "lab/check/check.h"
#include "render/engines/engines.h"
#include "render/framing/framing.h"
#include "scenes.h"

int cts_mutation_now = CTS_MUTATION_NONE;

typedef struct Proof {
    int fault;
    const char *name;
    bool uncorrected;  /* as in CtsCheckSettings: error control would correct the fault */
    const char *cases; /* part of the name of cases that must see it; few, so that the test is quick */
} Proof;

#define PROOF(fault, cases)                                                                                            \
    {                                                                                                                  \
        CTS_MUTATION_##fault, #fault, CTS_MUTATION_##fault >= CTS_MUTATION_SHEET_WEIGHTS, cases                        \
    }

static const Proof proofs[] = {
    PROOF(HALF_PIXEL, "ramp: oblique"),
    PROOF(MIRRORED, "front, head from anterior"),
    PROOF(UNIT_DISTANCE, "unit distance"),
    PROOF(STEP_SIDE, "exactly on a step"),
    PROOF(CAP, "ramp to opacity 1, 0.01 mm"),
    PROOF(OPACITY_STEP, "opacity per voxel"),
    PROOF(LAST_LAYER, "slab: anterior"),
    PROOF(END_PLANES, "slab: anterior"),
    PROOF(ROUNDING, "rounded to the nearest"),
    PROOF(FLOAT_DRIFT, "savings on layers that repeat"),
    PROOF(FOOTPRINT_SUM, "slab: gaussian kernel"),
    PROOF(VOID_EDGES, "savings on blocks in air"),
    PROOF(GRADIENT_STEPS, "lit, leaning"),
    PROOF(ONE_SIDED_LIGHT, "lit from behind"),
    PROOF(SKIP_RANGE, "ball: chords"),
    PROOF(STOP_EARLY, "what shows behind"),
    PROOF(ATTENUATION, "slab: anterior"),
    PROOF(CONTROL_POINTS, "steep: step"),
    PROOF(TURNS, "cell: HU turns inside"),
    PROOF(BORDER_DIFFERENCE, "cut faces: anterior"),
    PROOF(MODE_EXTREMES, "turns inside, mip"),
    PROOF(VOXEL_LENGTH, "opacity per voxel, oblique"),
    PROOF(TOLERANCE_LESS, "exactly the tolerance"),
    PROOF(QUIET_RANGE, "equal: savings where one level shows"),
    PROOF(QUIET_HIGH, "peak: one HU wide, slow field"),
    PROOF(WHOLE_LEVELS, "a peak between two levels, 0.5 asked"),
    PROOF(SKIP_TOO_FAR, "ball: chords"),
    PROOF(GRADIENT_SIGN, "lit from behind"),
    PROOF(AVERAGE_BLOCK, "average of one grey level"),
    PROOF(DEPTH_SLAB, "depth: an opaque plane"),
    PROOF(BOUND_LOW, "a step, lit, oblique"),
    PROOF(UNCAST, "peak: opaque, one HU wide"),
    PROOF(SPLITS, "grazing a dot"),
    PROOF(CONTROL_POINT_OFF, "grazing a dot"),
    PROOF(MASK_NEIGHBOUR, "ball: chords"),
    PROOF(LAST_PIECE, "slab: anterior"),
    PROOF(START_LATE, "slab: anterior"),
    PROOF(GAUSS, "ramp: oblique"),
    PROOF(LOW_WEIGHT, "ramp: lit"),
    PROOF(LIT_STEPS, "lit"),
    PROOF(HALVES, "a line at 45"),
    PROOF(HIDING, "labels: hidden voxels are air"),
    PROOF(OVERLAP, "labels: one in another, hidden"),
    PROOF(EDGES, "labels: hidden diagonal"),
    PROOF(LABEL_INTERVALS, "labels: hidden diagonal"),
    PROOF(OPEN_PLACE, "openness: a plane"),
    PROOF(OPEN_BEYOND, "openness: a bowl"),
    PROOF(OPEN_UNUSED, "openness: a bowl"),
    PROOF(SHEET_WEIGHTS, "ramp: "),
    PROOF(SHEET_SHARE, "slab: "),
    PROOF(SHEET_SHAFT, "marker: "),
    PROOF(SHEET_OPACITY, "slab: anterior"),
    PROOF(SHEET_LIGHT, "ramp: lit, leaning"),
};

/* Thin plates that rays of an oblique view cross between two sheets: samples beside them are below 150 HU, from which
 * on the preset bone shows something. */
static CtsVolume *thin_plates(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 40, 40, 40, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = (uint16_t)(1024 + (i % 10 == 5 ? 220 : 0));
    return v;
}

static CtsVolume *noisy_head(void)
{
    return phantom_head(48, 44, 40, 60);
}

/* Metal dots, whose edges rays of an oblique view pass between two sheets that both see none of them. */
static CtsVolume *metal_dots(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 40, 40, 40, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = (uint16_t)(i % 8 == 4 && i / 40 % 8 == 4 && i / 1600 % 8 == 4 ? 21024 : 1024);
    return v;
}

/* Parts of the indicator of sheets, each with a scene where it is what covers the errors. */
static const struct {
    int fault;
    const char *name, *preset;
    CtsVolume *(*volume)(void);
    CtsEngineLevel level;
    bool lit;
    double azimuth_deg, elevation_deg;
} parts[] = {
    {CTS_MUTATION_INDICATOR_LEVELS, "levels", "bone", noisy_head, CTS_LEVEL_SHEETS, false, 30, 20},
    {CTS_MUTATION_INDICATOR_LIGHT, "light", "skin", noisy_head, CTS_LEVEL_SHEETS, true, 30, 20},
    {CTS_MUTATION_INDICATOR_MISSED, "missed", "bone", thin_plates, CTS_LEVEL_SHEETS, false, 40, 0},
    {CTS_MUTATION_INDICATOR_CONTRAST, "contrast", "skin", metal_dots, CTS_LEVEL_SHEETS, false, 30, 20},
};

/* Share of the squared error of a scene that its indicators do not cover. */
static double uncovered(size_t part, int fault)
{
    enum { SIDE = 64, TILE = CTS_PROBE_X * CTS_PROBE_Y, N = SIDE * SIDE, ACROSS = SIDE / CTS_PROBE_X };
    static int corner[N / TILE][2], xy[N][2];
    static float rgba[N][4], indicator[N];
    static double truth[N][4];
    CtsSceneStore store;
    CtsError err = {0};
    CtsModel model = {.volume = parts[part].volume()};
    const CtsPreset preset = preset_named(parts[part].preset);
    CtsRenderSettings s = settings_for(CTS_ENGINE_SHEETS, SIDE, parts[part].azimuth_deg, parts[part].elevation_deg);
    s.level = parts[part].level;
    s.shade = parts[part].lit ? CTS_ON : CTS_OFF;
    s.occlusion = 0;
    cts_cpu_set_mask(0);
    assert_int_equal(cts_model_prepare(&model, 1, &err), CTS_OK);
    assert_int_equal(cts_framing_settle(&model, &preset, &s, &err), CTS_OK);
    assert_int_equal(cts_scene_init(&store, &model, &preset, &s, &err), CTS_OK);
    CtsLut *lut = NULL;
    assert_int_equal(cts_lut_new(&lut, &store.preset, model.volume, NULL, store.scene.extinction_scale, &err), CTS_OK);
    store.scene.lut = lut;
    void *cache = NULL;
    store.scene.cache = &cache;
    store.scene.plan.level = s.level;
    for (int i = 0; i < N; i++) {
        const int tile = i / TILE, at = i % TILE;
        corner[tile][0] = tile % ACROSS * CTS_PROBE_X;
        corner[tile][1] = tile / ACROSS * CTS_PROBE_Y;
        xy[i][0] = corner[tile][0] + at % CTS_PROBE_X;
        xy[i][1] = corner[tile][1] + at / CTS_PROBE_X;
    }
    const CtsEngine *const engine = cts_engine(CTS_ENGINE_SHEETS);
    cts_mutation_now = fault;
    assert_int_equal(engine->render_tiles(&store.scene, (const int(*)[2])corner, N / TILE, rgba, indicator, &err),
                     CTS_OK);
    cts_mutation_now = CTS_MUTATION_NONE;
    assert_int_equal(cts_raycast_pixels(&store.scene, (const int(*)[2])xy, N, truth, &err), CTS_OK);
    double all = 0, rest = 0;
    for (int i = 0; i < N; i++) {
        const float exact[4] = {(float)truth[i][0], (float)truth[i][1], (float)truth[i][2], (float)truth[i][3]};
        const double square = cts_scene_square_of_error(&store.scene, rgba[i], exact),
                     beyond = fmax(sqrt(square) - (double)indicator[i], 0);
        all += square;
        rest += beyond * beyond;
    }
    engine->free_cache(cache);
    cts_lut_free(&lut);
    cts_model_free(&model);
    return rest / all;
}

/* Each part of the indicator covers errors that the others do not. */
static void test_parts_of_the_indicator(void **state)
{
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        const double with = uncovered(i, CTS_MUTATION_NONE), without = uncovered(i, parts[i].fault);
        print_message("%-18s %.3f of the squared error beyond the indicator, %.3f without\n", parts[i].name, with,
                      without);
        if (without < 1.5 * with + 0.005)
            fail_msg("%s: 1.5 times %.3f and 0.005 expected at least, actual %.3f", parts[i].name, with, without);
    }
}

static void count(const CtsCheckResult *result, void *context)
{
    ++*(int *)context;
}

static int failures(int fault, const Proof *p, int *n)
{
    int n_failed = 0, seen = 0;
    CtsError err = {0};
    const CtsCheckSettings settings = {
        .n_threads = 2, .only = p->cases, .uncorrected = p->uncorrected, .sink = count, .context = &seen};
    cts_cpu_set_mask(0); /* other paths have no faults, and some cases let them through */
    cts_mutation_now = fault;
    assert_int_equal(cts_check_run(&settings, n, &n_failed, &err), CTS_OK);
    cts_mutation_now = CTS_MUTATION_NONE;
    assert_int_equal(seen, *n);
    return n_failed;
}

static void test_each_fault_has_a_proof(void **state)
{
    const int n = (int)(sizeof proofs / sizeof *proofs), n_parts = (int)(sizeof parts / sizeof *parts);
    assert_int_equal(n + n_parts, CTS_N_MUTATIONS - 1);
    for (int i = 0; i < n; i++)
        assert_int_equal(proofs[i].fault, i + 1);
    for (int i = 0; i < n_parts; i++)
        assert_int_equal(parts[i].fault, n + i + 1);
}

static void test_faults_are_caught(void **state)
{
    int missed = 0;
    for (size_t i = 0; i < sizeof proofs / sizeof *proofs; i++) {
        int n;
        const Proof *p = &proofs[i];
        assert_int_equal(failures(CTS_MUTATION_NONE, p, &n), 0);
        assert_true(n > 0);
        const int n_failed = failures(p->fault, p, &n);
        print_message("%-18s %d of %d fail: %s\n", p->name, n_failed, n, p->cases);
        missed += n_failed == 0;
    }
    assert_int_equal(missed, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_fault_has_a_proof),
        cmocka_unit_test(test_faults_are_caught),
        cmocka_unit_test(test_parts_of_the_indicator),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
