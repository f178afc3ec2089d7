/* Positions to layers: even, jittered, tilted, with slices missing, unequal; on invented headers. */
#include "input/series/slice_stack.h"
#include "unit.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX = 400 };

typedef struct Fake {
    CtsSlice slices[MAX];
    const CtsSlice *order[MAX];
    int n;
    CtsSliceStack stack;
    CtsError err;
} Fake;

static Fake *fake_new(void)
{
    Fake *f = calloc(1, sizeof *f);
    assert_non_null(f);
    return f;
}

static void add(Fake *f, double x, double y, double z)
{
    assert_true(f->n < MAX);
    CtsSlice *s = &f->slices[f->n];
    *s = (CtsSlice){.row_lps = {1, 0, 0},
                    .column_lps = {0, 1, 0},
                    .normal_lps = {0, 0, 1},
                    .position_lps = {x, y, z},
                    .row_spacing_mm = 0.5,
                    .column_spacing_mm = 0.5};
    f->order[f->n++] = s;
}

static Fake *at(const double *z, int n)
{
    Fake *f = fake_new();
    for (int i = 0; i < n; i++)
        add(f, 0, 0, z[i]);
    return f;
}

static CtsStatus plan(Fake *f)
{
    return cts_slice_stack_plan(f->order, f->n, false, &f->stack, &f->err);
}

static void done(Fake *f)
{
    cts_slice_stack_free(&f->stack);
    free(f);
}

static void expect_diagnostics(Fake *f, const char *only)
{
    CtsDiagnostics diagnostics = {0};
    cts_slice_stack_diagnostics(&f->stack, f->order, f->n, &diagnostics);
    assert_int_equal(diagnostics.n, only ? 1 : 0);
    if (only)
        assert_string_equal(diagnostics.items[0].code, only);
    cts_diagnostics_free(&diagnostics);
}

static void test_even(void **state)
{
    const double z[] = {-3, -1.5, 0, 1.5, 3};
    Fake *f = at(z, 5);
    assert_int_equal(plan(f), CTS_OK);
    assert_true(f->stack.kind == CTS_STACK_EVEN && f->stack.n_layers == 5 && f->stack.spacing_mm == 1.5);
    assert_true(f->stack.step_lps[2] == 1.5 && f->stack.step_lps[0] == 0 && f->stack.tilt_deg == 0);
    for (int i = 0; i < 5; i++)
        assert_true(f->stack.layer[i] == i);
    expect_diagnostics(f, NULL);
    done(f);
}

/* 0.02 mm or 1 % is the writer's rounding; beyond that the stack is unequal. */
static void test_jitter(void **state)
{
    const double zigzag[] = {0, 1.01, 2, 3.01, 4, 5.01}; /* its median gap is one of the wide ones */
    const double fine[] = {0, 1.009, 2, 3.009, 4}, rough[] = {0, 1.03, 2, 3.03, 4}, thick[] = {0, 5.02, 10, 15.02, 20};
    Fake *f = at(fine, 5);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_EVEN);
    expect_diagnostics(f, NULL);
    done(f);
    f = at(zigzag, 6);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_EVEN);
    expect_diagnostics(f, NULL);
    done(f);
    f = at(thick, 5);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_EVEN);
    done(f);
    f = at(rough, 5);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_UNEQUAL);
    expect_diagnostics(f, "unequal_spacing");
    done(f);
}

/* Every gap is accepted, yet in the middle of the stack a slice lies half a layer from its position. */
static void test_drift(void **state)
{
    Fake *f = fake_new();
    double z = 0;
    for (int i = 0; i < 300; i++, z += i <= 150 ? 1.0 : 1.009)
        add(f, 0, 0, z);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_UNEQUAL);
    expect_diagnostics(f, "unequal_spacing");
    done(f);
}

static void test_missing(void **state)
{
    Fake *f = fake_new();
    for (int i = 0; i < 30; i++)
        if (i != 7 && i != 20)
            add(f, 0, 0, 2.5 * i);
    assert_int_equal(plan(f), CTS_OK);
    assert_true(f->stack.kind == CTS_STACK_MISSING && f->stack.n_layers == 30 && f->stack.n_missing == 2);
    assert_true(f->stack.layer[6] == 6 && f->stack.layer[7] == 8 && f->stack.layer[27] == 29);
    CtsDiagnostics diagnostics = {0};
    cts_slice_stack_diagnostics(&f->stack, f->order, f->n, &diagnostics);
    assert_int_equal(diagnostics.n, 1);
    assert_string_equal(diagnostics.items[0].code, "missing_slices");
    assert_non_null(strstr(diagnostics.items[0].text, "2 of 30"));
    assert_non_null(strstr(diagnostics.items[0].text, "15.000 to 20.000 mm"));
    cts_diagnostics_free(&diagnostics);
    done(f);
    /* One of ten is a tenth; two of eleven are more. */
    f = fake_new();
    for (int i = 0; i < 10; i++)
        if (i != 4)
            add(f, 0, 0, i);
    assert_true(plan(f) == CTS_OK && f->stack.n_missing == 1);
    done(f);
    f = fake_new();
    for (int i = 0; i < 11; i++)
        if (i != 4 && i != 6)
            add(f, 0, 0, i);
    assert_int_equal(plan(f), CTS_ERR_GEOMETRY);
    assert_true(f->stack.spacing_mm == 1 && f->stack.n_layers == 0 && !f->stack.layer);
    assert_non_null(strstr(f->err.text, "2 of 11 slices missing"));
    assert_non_null(strstr(f->err.text, "from position 3.000 to 5.000 mm"));
    done(f);
    const double two_gaps[] = {0, 5, 15};
    f = at(two_gaps, 3);
    assert_int_equal(plan(f), CTS_ERR_GEOMETRY);
    done(f);
}

/* A gap that is no multiple of the spacing lacks slices all the same, whatever the other gaps are. */
static void test_wide_gaps(void **state)
{
    static const struct {
        const char *what;
        double spacing, gap, shift; /* up to the gap; shift of slice 5 */
        int n_before, n_after;
        double after; /* spacing behind the gap */
        CtsStatus status;
        int n_missing;
    } cases[] = {
        {"two scans", 3, 73, 0, 10, 10, 3, CTS_ERR_GEOMETRY, 23},
        {"two scans far apart", 3, 3e6, 0, 10, 10, 3, CTS_ERR_GEOMETRY, 20000},
        {"a slice off its place", 3, 33, 0.3, 20, 18, 3, CTS_ERR_GEOMETRY, 10},
        {"the same, less than a tenth", 3, 9.4, 0.3, 20, 18, 3, CTS_OK, 2},
        {"too narrow for a slice", 3, 5.6, 0, 20, 18, 3, CTS_OK, 0},
        {"parts of two spacings", 1.25, 2.5, 0, 20, 10, 2.5, CTS_OK, 0},
        {"parts that are no multiples", 2, 4.7, 0, 20, 10, 4.7, CTS_OK, 0},
        {"parts, and a slice missing between thick ones", 2, 4.7, 0, 30, -10, 4.7, CTS_OK, 1},
        {"parts far apart", 1.25, 100, 0, 20, 10, 5, CTS_ERR_GEOMETRY, 19},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        Fake *f = fake_new();
        double z = 0;
        for (int i = 0; i < cases[c].n_before; i++)
            add(f, 0, 0, z = i * cases[c].spacing + (i == 5 ? cases[c].shift : 0));
        for (int i = 0; i < abs(cases[c].n_after); i++)
            if (cases[c].n_after > 0 || i != 5)
                add(f, 0, 0, z + cases[c].gap + i * cases[c].after);
        const CtsStatus st = plan(f);
        if (st != cases[c].status || f->stack.n_missing != cases[c].n_missing)
            fail_msg("%s: status %d, expected %d; %d slices missing, expected %d", cases[c].what, st, cases[c].status,
                     f->stack.n_missing, cases[c].n_missing);
        assert_true(st == CTS_OK || strstr(f->err.text, "slices missing"));
        if (!st && f->stack.n_missing) {
            CtsDiagnostics diagnostics = {0};
            cts_slice_stack_diagnostics(&f->stack, f->order, f->n, &diagnostics);
            assert_int_equal(diagnostics.n, 2);
            assert_string_equal(diagnostics.items[0].code, "missing_slices");
            assert_string_equal(diagnostics.items[1].code, "unequal_spacing");
            cts_diagnostics_free(&diagnostics);
        }
        done(f);
    }
}

/* Thin slices, then thick ones: a protocol, not accidents. */
static void test_unequal(void **state)
{
    Fake *f = fake_new();
    double z = 0;
    for (int i = 0; i < 20; i++, z += i <= 10 ? 1.25 : 5)
        add(f, 0, 0, z);
    assert_int_equal(plan(f), CTS_OK);
    assert_true(f->stack.kind == CTS_STACK_UNEQUAL && f->stack.n_missing == 0);
    const double span = f->slices[19].position_lps[2];
    assert_int_equal(f->stack.n_layers, (int)(span / 1.25 + 0.5) + 1);
    for (int i = 0; i < 20; i++)
        assert_true(fabs(f->stack.layer[i] * f->stack.step_lps[2] - f->slices[i].position_lps[2]) < 1e-9);
    expect_diagnostics(f, "unequal_spacing");
    done(f);
    f = fake_new(); /* a spacing that grows from slice to slice, to ten times the first one */
    for (double gap = 1, at = 0; gap < 10; gap *= 1.06, at += gap)
        add(f, 0, 0, at);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_UNEQUAL && f->stack.n_missing == 0);
    done(f);
    /* One tiny gap does not make a giant of the volume. */
    const double z2[] = {0, 5, 10, 10.1, 15, 20};
    f = at(z2, 6);
    assert_int_equal(plan(f), CTS_OK);
    assert_true(f->stack.kind == CTS_STACK_UNEQUAL && f->stack.n_layers == CTS_STACK_GROWTH * 6);
    assert_true(f->stack.layer[0] == 0 && fabs(f->stack.layer[5] - 23) < 1e-12);
    done(f);
}

static void test_tilt(void **state)
{
    Fake *f = fake_new();
    const double slope = tan(20 * 3.14159265358979323846 / 180);
    for (int i = 0; i < 10; i++)
        add(f, 0, slope * 2 * i, 2 * i);
    assert_int_equal(plan(f), CTS_OK);
    assert_true(f->stack.kind == CTS_STACK_EVEN && fabs(f->stack.tilt_deg - 20) < 1e-9);
    assert_true(fabs(f->stack.step_lps[1] - slope * 2) < 1e-12 && fabs(f->stack.step_lps[2] - 2) < 1e-12);
    assert_true(f->stack.spacing_mm == 2);
    expect_diagnostics(f, "gantry_tilt");
    done(f);
    f = fake_new();
    for (int i = 0; i < 10; i++)
        add(f, 0, 4 * i, 2 * i);
    assert_int_equal(plan(f), CTS_ERR_GEOMETRY); /* 63 degrees: no gantry */
    done(f);
}

/* Positions written to a hundredth of a millimetre are no news, however few or thin the slices. */
static void test_written_jitter(void **state)
{
    static const double spacings_mm[] = {0.5, 1, 3};
    unsigned random = 1;
    for (int n = 2; n <= 40; n++)
        for (int s = 0; s < 3; s++) {
            Fake *f = fake_new();
            for (int i = 0; i < n; i++) {
                double off_mm[3];
                for (int c = 0; c < 3; c++) {
                    random = random * 1664525u + 1013904223u;
                    off_mm[c] = 0.01 * ((random >> 8) / 8388608.0 - 1) / 2;
                }
                add(f, off_mm[0], off_mm[1], i * spacings_mm[s] + off_mm[2]);
            }
            assert_int_equal(plan(f), CTS_OK);
            CtsDiagnostics diagnostics = {0};
            cts_slice_stack_diagnostics(&f->stack, f->order, f->n, &diagnostics);
            assert_int_equal(diagnostics.n, 0);
            done(f);
        }
}

static void test_sideways(void **state)
{
    static const struct {
        double shift;
        CtsStatus status;
        const char *diagnostic;
    } cases[] = {{0.01, CTS_OK, NULL}, {0.1, CTS_OK, "sideways_shift"}, {0.3, CTS_ERR_GEOMETRY, NULL}};
    for (size_t i = 0; i < 3; i++) {
        Fake *f = fake_new();
        for (int k = 0; k < 10; k++)
            add(f, k == 5 ? cases[i].shift : 0, 0, k);
        assert_int_equal(plan(f), cases[i].status);
        if (!cases[i].status)
            expect_diagnostics(f, cases[i].diagnostic);
        done(f);
    }
}

static void test_two_and_none(void **state)
{
    const double z[] = {1, 1.625}, same[] = {2, 2, 3};
    Fake *f = at(z, 2);
    assert_true(plan(f) == CTS_OK && f->stack.kind == CTS_STACK_EVEN && f->stack.spacing_mm == 0.625);
    done(f);
    f = at(same, 3);
    assert_int_equal(plan(f), CTS_ERR_GEOMETRY);
    done(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even),      cmocka_unit_test(test_jitter),       cmocka_unit_test(test_drift),
        cmocka_unit_test(test_missing),   cmocka_unit_test(test_unequal),      cmocka_unit_test(test_tilt),
        cmocka_unit_test(test_sideways),  cmocka_unit_test(test_two_and_none), cmocka_unit_test(test_written_jitter),
        cmocka_unit_test(test_wide_gaps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
