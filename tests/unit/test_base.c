/* Status, memory, cores and reports. */
#include "base/clamp.h"
#include "base/cpu.h"
#include "base/exit_code.h"
#include "base/mem.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "unit.h"
#include <math.h>
#include <string.h>

static void test_exit_codes(void **state)
{
    const struct {
        CtsStatus status;
        int code;
    } cases[] = {
        {CTS_OK, 0},         {CTS_ERR_MEMORY, 1},    {CTS_ERR_USAGE, 2},         {CTS_ERR_PRESET, 2},
        {CTS_ERR_READ, 3},   {CTS_ERR_NO_SERIES, 3}, {CTS_ERR_SYNTAX, 3},        {CTS_ERR_GEOMETRY, 4},
        {CTS_ERR_PIXELS, 4}, {CTS_ERR_OUTPUT, 5},    {CTS_ERR_INTERRUPTED, 130}, {CTS_ERR_INTERNAL, 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_int_equal(cts_exit_code(cases[i].status), cases[i].code);
}

static void test_fail(void **state)
{
    CtsError err;
    assert_int_equal(cts_fail(NULL, CTS_ERR_READ, "no listener"), CTS_ERR_READ);
    assert_int_equal(cts_fail(&err, CTS_ERR_READ, "%s: slice %d", "a.dcm", 3), CTS_ERR_READ);
    assert_int_equal(err.status, CTS_ERR_READ);
    assert_string_equal(err.text, "a.dcm: slice 3");
    assert_int_equal(cts_context(&err, "reading %s", "b"), CTS_ERR_READ);
    assert_string_equal(err.text, "reading b: a.dcm: slice 3");
    assert_int_equal(cts_context(NULL, "x"), CTS_ERR_INTERNAL);
}

/* A message is one line without control sequences, whatever a file name or a header contains. */
static void test_fail_escapes(void **state)
{
    CtsError err;
    cts_fail(&err, CTS_ERR_READ, "%s", "a\nb\x1b[31m\x7f\t");
    assert_string_equal(err.text, "a?b?[31m??");
    cts_fail(&err, CTS_ERR_READ, "inner");
    cts_context(&err, "%s", "x\ny");
    assert_string_equal(err.text, "x?y: inner");
    cts_fail(&err, CTS_ERR_READ, "%s",
             "\xc3\xa9 \xe2\x80\xaegnp.a \xc2\x9b"
             "2J \xff\xc3 \xc0\x80 \xe2\x80\xa9");
    assert_string_equal(err.text, "\xc3\xa9 ?gnp.a ?2J ?? ?? ?"); /* turned writing, C1, no UTF-8, a line's end */
}

static void test_fail_long(void **state)
{
    CtsError err;
    char text[4000];
    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = 0;
    cts_fail(&err, CTS_ERR_READ, "%s", text);
    assert_int_equal(strlen(err.text), sizeof err.text - 1);
    cts_fail(&err, CTS_ERR_READ, "inner");
    cts_context(&err, "%s", text); /* no room for both: the cause is what matters */
    assert_string_equal(err.text, "inner");
    memset(text, 'y', sizeof text);
    text[1000] = 0;
    cts_context(&err, "%s", text);
    assert_int_equal(strncmp(err.text, text, 1000), 0);
    assert_string_equal(err.text + 1000, ": inner");
}

static void test_memory(void **state)
{
    CtsError err;
    double *p = NULL;
    assert_int_equal(cts_alloc_array(&p, SIZE_MAX / 4, &err), CTS_ERR_MEMORY);
    assert_null(p);
    p = (double *)&err;
    assert_int_equal(cts_alloc_array(&p, SIZE_MAX / sizeof *p, &err), CTS_ERR_MEMORY);
    assert_null(p);
    assert_int_equal(cts_alloc_zeroed(&p, 1000, &err), CTS_OK);
    assert_int_equal((uintptr_t)p % CTS_ALIGNMENT, 0);
    for (int i = 0; i < 1000; i++)
        assert_true(p[i] == 0);
    cts_free(&p);
    assert_null(p);
    cts_free(&p);
    assert_int_equal(cts_alloc_array(&p, 0, &err), CTS_OK);
    cts_free(&p);
    size_t product;
    assert_true(cts_mul_overflows(SIZE_MAX, 2, &product));
    assert_false(cts_mul_overflows(SIZE_MAX, 1, &product));
    assert_true(product == SIZE_MAX);
}

/* Small blocks, which may change their alignment, and large ones, whose pages are moved: contents are kept. */
static void test_resize(void **state)
{
    static const size_t sizes[] = {1, 5, 63, 1000, 70000, 1300000, 5000000, 20};
    CtsError err;
    uint32_t *p = NULL;
    assert_int_equal(cts_alloc_array(&p, sizes[0], &err), CTS_OK);
    p[0] = 0;
    for (size_t n = 1; n < sizeof sizes / sizeof *sizes; n++) {
        const size_t kept = sizes[n] < sizes[n - 1] ? sizes[n] : sizes[n - 1];
        assert_int_equal(cts_resize_array(&p, sizes[n - 1], sizes[n], &err), CTS_OK);
        assert_int_equal((uintptr_t)p % CTS_ALIGNMENT, 0);
        for (size_t i = 0; i < kept; i++)
            assert_int_equal(p[i], i);
        for (size_t i = kept; i < sizes[n]; i++)
            p[i] = (uint32_t)i;
    }
    uint32_t *const before = p;
    assert_int_equal(cts_resize_array(&p, 20, SIZE_MAX / sizeof *p, &err), CTS_ERR_MEMORY);
    assert_true(p == before && p[19] == 19);
    cts_free(&p);
}

static void test_threads(void **state)
{
    assert_true(cts_cpu_cores() >= 1);
    assert_true(cts_threads(0) >= 1 && cts_threads(0) <= cts_cpu_cores());
    assert_int_equal(cts_threads(7), 7);
    assert_int_equal(cts_threads(1 << 20), 1024);
}

static void test_stages_add_up(void **state)
{
    CtsReport r = {0};
    cts_report_stage(&r, CTS_STAGE_SCAN, 2, 3, 4, 5);
    cts_report_stage(&r, CTS_STAGE_SCAN, 20, 30, 40, 50);
    const CtsStageTime *t = &r.stages[CTS_STAGE_SCAN];
    assert_true(t->ran && t->wall_ms == 22 && t->cpu_ms == 33 && t->items == 44 && t->bytes == 55);
    assert_false(r.stages[CTS_STAGE_DECODE].ran);
    cts_report_stage(NULL, CTS_STAGE_SCAN, 1, 1, 1, 1);
    cts_report_free(&r);
    assert_false(r.stages[CTS_STAGE_SCAN].ran);
}

/* Concurrent activities share the time by CPU usage, and the sum is complete. */
static void test_region(void **state)
{
    CtsReport r = {0};
    double busy[CTS_N_STAGES] = {0};
    uint64_t items[CTS_N_STAGES] = {0};
    busy[CTS_STAGE_SPLAT] = 6;
    busy[CTS_STAGE_COMPOSITE] = 2;
    items[CTS_STAGE_SPLAT] = 1000;
    items[CTS_STAGE_SHADE] = 7; /* did not run: not counted */
    cts_report_region(&r, 10, 16, busy, items, NULL);
    assert_true(r.stages[CTS_STAGE_SPLAT].wall_ms == 7.5 && r.stages[CTS_STAGE_SPLAT].cpu_ms == 12);
    assert_true(r.stages[CTS_STAGE_COMPOSITE].wall_ms == 2.5 && r.stages[CTS_STAGE_COMPOSITE].cpu_ms == 4);
    assert_int_equal(r.stages[CTS_STAGE_SPLAT].items, 1000);
    assert_false(r.stages[CTS_STAGE_SHADE].ran);
    memset(busy, 0, sizeof busy);
    cts_report_region(&r, 10, 16, busy, NULL, NULL);
    double wall = 0;
    for (int s = 0; s < CTS_N_STAGES; s++)
        wall += r.stages[s].wall_ms;
    assert_true(wall == 10);
    cts_report_region(NULL, 10, 16, busy, NULL, NULL);
    cts_report_free(&r);
}

static void test_lists(void **state)
{
    CtsReport r = {0};
    char text[600];
    memset(text, 'z', sizeof text - 1);
    text[sizeof text - 1] = 0;
    for (int i = 0; i < 100; i++) {
        cts_report_skip(&r, "lighting", "reason %d", i);
        cts_report_diagnostic(&r, CTS_DIAGNOSTIC_BAD_SLICES, "slice %d", i);
    }
    cts_report_diagnostic(&r, CTS_DIAGNOSTIC_REFUSED, "%s", text);
    assert_int_equal(r.n_skips, 100);
    assert_int_equal(r.diagnostics.n, 101);
    assert_string_equal(r.skips[63].why, "reason 63");
    assert_string_equal(r.diagnostics.items[99].text, "slice 99");
    assert_int_equal(strlen(r.diagnostics.items[100].text), sizeof r.diagnostics.items[100].text - 1);
    assert_ptr_equal(cts_diagnostics_find(&r.diagnostics, CTS_DIAGNOSTIC_REFUSED), &r.diagnostics.items[100]);
    assert_null(cts_diagnostics_find(&r.diagnostics, CTS_DIAGNOSTIC_PASSED));
    cts_report_plan(&r, "engine %s", "classic");
    cts_report_plan(&r, "layers %d", 12);
    assert_string_equal(r.plan, "engine classic\nlayers 12\n");
    cts_report_free(&r);
    assert_true(!r.plan && !r.skips && !r.diagnostics.items && r.n_skips == 0);
    cts_report_free(&r);
    cts_report_free(NULL);
    cts_report_skip(NULL, "a", "b");
    cts_report_diagnostic(NULL, CTS_DIAGNOSTIC_PASSED, "b");
    cts_report_plan(NULL, "a");
}

static void test_stage_names(void **state)
{
    const char *const names[CTS_N_STAGES] = {"scan",      "labels", "decode",    "grey",  "classify", "occlusion",
                                             "footprint", "splat",  "composite", "shade", "warp",     "export"};
    for (int s = 0; s < CTS_N_STAGES; s++)
        assert_string_equal(cts_stage_names[s], names[s]);
}

/* Either side of each middle between two levels, where floats lie on both sides of it or on neither. */
static void test_levels(void **state)
{
    int crossed = 0;
    for (int level = 1; level < 65536; level++) {
        const double middle = (level - 0.5) / 65535, below = middle * (1 - 1e-15), above = middle * (1 + 1e-15);
        assert_int_equal(floor((double)cts_clamp_to_level(below) * 65535 + 0.5), level - 1);
        assert_int_equal(floor((double)cts_clamp_to_level(above) * 65535 + 0.5), level);
        assert_true(fabs((double)cts_clamp_to_level(above) - above) < 1.2e-7 * above);
        crossed += floor((double)(float)above * 65535 + 0.5) != level;
    }
    assert_true(crossed > 1000);
    assert_true(cts_clamp_to_level(NAN) == 0 && cts_clamp_to_level(-1) == 0 && cts_clamp_to_level(2) == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exit_codes), cmocka_unit_test(test_fail),        cmocka_unit_test(test_fail_escapes),
        cmocka_unit_test(test_fail_long),  cmocka_unit_test(test_memory),      cmocka_unit_test(test_resize),
        cmocka_unit_test(test_threads),    cmocka_unit_test(test_region),      cmocka_unit_test(test_stages_add_up),
        cmocka_unit_test(test_lists),      cmocka_unit_test(test_stage_names), cmocka_unit_test(test_levels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
