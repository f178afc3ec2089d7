/* Functions of base/simd_math_tmpl.h in plain C against those of libm in double precision; every path does the same
 * operations. */
#include "unit.h"

#include "base/random.h"
#include "base/simd.h"

#include "base/simd_math_tmpl.h"

static void near(const char *name, float x, double value, double truth, double tolerance)
{
    if (!(fabs(value - truth) <= tolerance * fabs(truth)))
        fail_msg("%s(%.9g): expected %.9g within %g of it, actual %.9g", name, (double)x, truth, tolerance, value);
}

static void check_power(float x)
{
    const double to = -(double)x * M_LN2;
    near("vf_exp2 of -x", x, (double)vf_exp2(vf_of(-x))[0], exp(to), 3e-7);
    near("vf_opacity", x, (double)vf_opacity(vf_of(x))[0], -expm1(to), 6e-7);
}

/* Numbers at which the nearest integer changes, and those beside them. */
static void test_powers_around_halves(void **unused)
{
    (void)unused;
    for (int n = 0; n < 60; n++) {
        float x = (float)n + 0.5f;
        for (int i = 0; i < 8; i++)
            x = nextafterf(x, 0);
        for (int i = 0; i < 16; i++, x = nextafterf(x, INFINITY))
            check_power(x);
    }
}

static void test_random(void **unused)
{
    (void)unused;
    for (uint64_t i = 1; i <= 100000; i++) {
        const double u = (double)(cts_random_bits(i) >> 11) * 0x1p-53;
        const float x = (float)exp2(40 * u - 33); /* 2^-33 to 2^7 */
        if (x < 120)
            check_power(x);
        near("vf_log2", x, (double)vf_log2(vf_of(x))[0] + 64, log2((double)x) + 64, 3e-7);
        near("vf_inverse_root", x, (double)vf_inverse_root(vf_of(x))[0], 1 / sqrt((double)x), 3e-7);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_powers_around_halves), cmocka_unit_test(test_random)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
