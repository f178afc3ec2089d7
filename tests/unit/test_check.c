/* The suite's own machinery: it must count, filter, stop, and call a failure a failure. The cases themselves are run
 * by `ctsplat check`. */
#include "lab/check/check.h"
#include "lab/check/check_scene.h"
#include "lab/check/truth.h"
#include "unit.h"
#include <math.h>
#include <signal.h>
#include <string.h>

typedef struct Seen {
    int n, n_failed, n_nan;
    const char *part;
} Seen;

static void see(const CtsCheckResult *r, void *context)
{
    Seen *seen = context;
    assert_non_null(strstr(r->name, seen->part));
    assert_true(r->pass == (r->error <= r->bound));
    seen->n++;
    seen->n_failed += !r->pass;
    seen->n_nan += isnan(r->found);
}

static void test_counts(void **state)
{
    Seen seen = {.part = "unit distance"};
    int n, n_failed;
    CtsError err;
    const CtsCheckSettings settings = {.n_threads = 1, .only = seen.part, .sink = see, .context = &seen};
    assert_int_equal(cts_check_run(&settings, &n, &n_failed, &err), CTS_OK);
    assert_int_equal(n, seen.n);
    assert_int_equal(n_failed, seen.n_failed);
    assert_true(n >= 2);
}

static void test_stops(void **state)
{
    Seen seen = {.part = ""};
    const volatile sig_atomic_t stop = 1;
    int n, n_failed;
    CtsError err;
    const CtsCheckSettings settings = {.stop = &stop, .sink = see, .context = &seen};
    assert_int_equal(cts_check_run(&settings, &n, &n_failed, &err), CTS_ERR_INTERRUPTED);
    assert_int_equal(n, 0);
}

static double square_root(double x, const void *data)
{
    return sqrt(x) * log(x);
}

/* Truths that the truths are measured by. */
static void test_truth(void **state)
{
    double rgba[4];
    assert_true(fabs(cts_truth_integral(square_root, NULL, 0, 1) + 4.0 / 9) < 1e-12);
    CtsPreset p = cts_check_even_preset(0.5, 1, 0.5, 0);
    CtsTruthInterval s = {0, 900, 3, -1};
    cts_truth_intervals(&p, 1, &s, 1, rgba);
    assert_true(fabs(rgba[3] - 0.875) < 1e-15 && fabs(rgba[1] - 0.4375) < 1e-15);
    /* Linear opacity 0..1 over 1 mm: depth is the integral of -ln(1 - x), which is 1. */
    p = cts_check_preset((const CtsCheckPoint[]){{0, 0, {0, 1, 1}}, {100, 1, {1, 1, 1}}}, 2);
    p.unit_distance_mm = 1;
    s = (CtsTruthInterval){0, 100, 1, -1};
    cts_truth_intervals(&p, 1, &s, 1, rgba);
    assert_true(fabs(rgba[3] + expm1(-1)) < 1e-12);
    /* A midpoint sum with a million steps for colour and depth together. */
    double depth = 0, red = 0;
    for (int i = 0; i < 1000000; i++) {
        const double x = (i + 0.5) * 1e-6, add = -log1p(-x) * 1e-6;
        red += x * exp(-depth) * -expm1(-add);
        depth += add;
    }
    assert_true(fabs(rgba[0] - red) < 1e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_counts),
        cmocka_unit_test(test_stops),
        cmocka_unit_test(test_truth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
