/* Mutation testing: each known fault is enabled in turn, and the stability suite must detect it. Faulty files are
 * compiled a second time, so that faults can be switched while the test runs. */
#include "base/cpu.h"
#include "base/mutation.h"
#include "lab/check/check.h"
#include "unit.h"
#include <stdio.h>
#include <string.h>

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

static void count(const CtsCheckResult *result, void *context)
{
    (void)result;
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
    (void)state;
    const int n = (int)(sizeof proofs / sizeof *proofs);
    assert_int_equal(n, CTS_N_MUTATIONS - 1);
    for (int i = 0; i < n; i++)
        assert_int_equal(proofs[i].fault, i + 1);
}

static void test_faults_are_caught(void **state)
{
    (void)state;
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
