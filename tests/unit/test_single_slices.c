/* Slices of a study that are each a series: which of them form stacks. */
#include "ctsplat/series.h"
#include "unit.h"
#include <string.h>

/* Place of slice k of a scan with `gap_mm` between slices, tilted by tan(angle) = 1/4. */
static CtsSlicePlace place_of(int k, double gap_mm, double first_mm, int series_number)
{
    return (CtsSlicePlace){.rows = 5,
                           .columns = 6,
                           .series_number = series_number,
                           .row_spacing_mm = 0.75,
                           .column_spacing_mm = 0.5,
                           .row_lps = {1, 0, 0},
                           .column_lps = {0, 1, 0},
                           .position_lps = {-1, 0.25 * gap_mm * k, first_mm + gap_mm * k}};
}

static void expect_stacks(const CtsSlicePlace *places, const char *expected, const char *what)
{
    int stack[32], n_stacks = -1, most = 0;
    CtsError err;
    const size_t n = strlen(expected);
    assert_true(n <= 32);
    assert_int_equal(cts_single_slices_find(places, n, stack, &n_stacks, &err), CTS_OK);
    for (size_t i = 0; i < n; i++) {
        if (stack[i] != expected[i] - '0')
            fail_msg("%s: slice %zu in stack %d, expected %c", what, i, stack[i], expected[i]);
        most = stack[i] > most ? stack[i] : most;
    }
    assert_int_equal(n_stacks, most);
}

/* Slices of a study that are each a series. */
static void test_single_slices(void **state)
{
    CtsSlicePlace p[20];
    for (int k = 0; k < 20; k++)
        p[k] = place_of((7 * k + 3) % 20, 2, 10, 4);
    expect_stacks(p, "11111111111111111111", "even, in any order");
    expect_stacks(p, "00", "two slices");
    for (int k = 0; k < 20; k++)
        p[k] = place_of(k < 11 ? k : k + 1, 2, 10, 4);
    expect_stacks(p, "11111111111111111111", "one of 21 missing");
    expect_stacks(p + 8, "000000", "one of 7 missing");
    for (int k = 0; k < 20; k++)
        p[k] = place_of(k / 2, k % 2 ? 3 : 2, 10, k % 2);
    expect_stacks(p, "12121212121212121212", "two scans, separated by SeriesNumber");
    for (int k = 0; k < 20; k++)
        p[k].series_number = -1;
    expect_stacks(p, "00000000000000000000", "two scans without SeriesNumber");
    for (int k = 0; k < 9; k++)
        p[k] = place_of(k, 2, 10, 4);
    p[1].columns = 7;
    p[3].row_spacing_mm = 0.76;
    memcpy(p[5].row_lps, (double[]){0, 1, 0}, sizeof p[5].row_lps);
    memcpy(p[5].column_lps, (double[]){0, 0, -1}, sizeof p[5].column_lps);
    p[7].position_lps[0] = 5;
    expect_stacks(p, "000000000", "every other one of another grid or beside the line");
    for (int k = 0; k < 9; k++)
        p[k] = place_of(0, 2, 10, 4);
    expect_stacks(p, "000000000", "one position");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_single_slices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
