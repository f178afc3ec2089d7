/* Operations of base/simd.h: every SIMD path against scalar C, to the bit, on ugly input. */
#include "base/cpu.h"
#include "random_input.h"
#include "simd_operations.h"
#include "unit.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>

enum { TRIALS = 2000 };

/* Special values, random bits, and ordinary numbers. */
static float ugly_float(void)
{
    static const float ugly[] = {0, -0.0F, 1, -1, INFINITY, -INFINITY, NAN, 0x1p-149F, -0x1p-126F, 0x1.fffffep127F};
    float any;
    const uint32_t bits = random_u32();
    memcpy(&any, &bits, sizeof any);
    const int kind = below(4);
    return kind == 0 ? ugly[below(10)] : kind == 1 ? any : (float)(below(2000001) - 1000000) / 1024;
}

static int32_t ugly_whole(void)
{
    static const int32_t ugly[] = {0, 1, -1, INT32_MIN, INT32_MAX, 0xffff, 0x10000, -0x10000, 255, 256};
    return below(2) ? ugly[below(10)] : (int32_t)random_u32();
}

static int16_t ugly_short(void)
{
    static const int16_t ugly[] = {0, 1, -1, INT16_MIN, INT16_MAX, 16384, -16384, 255};
    return below(2) ? ugly[below(8)] : (int16_t)random_u32();
}

static void fill(SimdInput *in)
{
    for (int l = 0; l < 16; l++) {
        in->f[l] = ugly_float();
        in->g[l] = below(4) ? ugly_float() : in->f[l];
        in->c[l] = (float)(int32_t)(random_u32() & ~0xFFU) * (below(2) ? 1 : 0x1p-25F);
        in->r[l] = below(4) ? (float)(below(0x800001) - 0x400000) / (float)(1 << below(9)) : (float)below(9) - 4.5F;
        in->i[l] = ugly_whole();
        in->j[l] = below(4) ? ugly_whole() : in->i[l];
        in->b[l] = below(TABLE_SIZE);
    }
    for (int l = 0; l < 32; l++) {
        in->s[l] = ugly_short();
        in->t[l] = ugly_short();
        in->p[l] = (int16_t)below(32);
        in->q[l] = (int16_t)below(64);
    }
    for (int k = 0; k < TABLE_SIZE; k++) {
        in->table[k] = ugly_float();
        in->twos[k][0] = ugly_whole();
        in->twos[k][1] = ugly_whole();
        in->rows[k] = ugly_short();
    }
    for (int k = 0; k < TABLE_SIZE + 2; k++)
        in->grey[k] = (uint16_t)random_u32();
    in->m = below(4) ? random_u32() & 0xffff : 0;
    in->n = below(4) ? random_u32() & 0xffff : below(2) ? 0xffff : ~in->m & 0xffff;
}

static int32_t madd(const SimdInput *in, int lane)
{
    const int16_t *const s = in->s + 2 * lane, *const t = in->t + 2 * lane;
    return (int32_t)((uint32_t)(s[0] * t[0]) + (uint32_t)(s[1] * t[1]));
}

/* The value of lane number `which` of the mask m. */
static float packed(const SimdInput *in, int which)
{
    unsigned left = in->m;
    for (int l = 0; l < which; l++)
        left &= left - 1;
    return left ? in->f[__builtin_ctz(left)] : 0;
}

/* name[]: the operation of each row. */
static int scalar_operations(const SimdInput *in, SimdRow row[MAX_ROWS], const char *name[MAX_ROWS])
{
    const int16_t *const in_s = in->s, *const in_t = in->t;
    const unsigned in_m = in->m, in_n = in->n;
    int at = 0;
#define LANE_BY_LANE(operation, member, n_lanes, lane)                                                                 \
    name[at] = #operation;                                                                                             \
    for (int l = 0; l < n_lanes; l++)                                                                                  \
        row[at].member[l] = lane;                                                                                      \
    at++;
#define FLOATS(operation, vectors, lane) LANE_BY_LANE(operation, floats, 16, lane)
#define WHOLES(operation, vectors, lane) LANE_BY_LANE(operation, wholes, 16, lane)
#define TRUTHS(operation, vectors, lane) LANE_BY_LANE(operation, wholes, 16, (lane) != 0)
#define SHORTS(operation, vectors, lane) LANE_BY_LANE(operation, shorts, 32, lane)
#define f in->f[l]
#define g in->g[l]
#define c in->c[l]
#define r in->r[l]
#define i in->i[l]
#define j in->j[l]
#define b in->b[l]
#define s in->s[l]
#define t in->t[l]
#define p in->p[l]
#define q in->q[l]
#define m (in->m >> l & 1)
#define n (in->n >> l & 1)
#include "simd_operations_tmpl.h"
#undef f
#undef g
#undef c
#undef r
#undef i
#undef j
#undef b
#undef s
#undef t
#undef p
#undef q
#undef m
#undef n
    return at;
}

/* True if two lanes have the same bits; all NaN count as equal. */
static bool same_lane(uint32_t a, uint32_t b)
{
    const bool both_nan = (a & INT32_MAX) > 0x7f800000 && (b & INT32_MAX) > 0x7f800000;
    return a == b || both_nan;
}

static void compare(const char *path, simd_operations_fn operations, uint64_t seed)
{
    SimdInput in;
    SimdRow row[MAX_ROWS], expected[MAX_ROWS];
    const char *name[MAX_ROWS];
    state = seed;
    fill(&in);
    const int n = scalar_operations(&in, expected, name);
    assert_int_equal(operations(&in, row), n);
    for (int k = 0; k < n; k++)
        for (int l = 0; l < 16; l++)
            if (!same_lane((uint32_t)row[k].wholes[l], (uint32_t)expected[k].wholes[l]))
                fail_msg("%s, %s, seed %llu: lane %d has bits %08x, expected %08x", name[k], path,
                         (unsigned long long)seed, l, (unsigned)row[k].wholes[l], (unsigned)expected[k].wholes[l]);
}

static void test_operations(void **unused)
{
    static const struct {
        const char *name;
        simd_operations_fn operations;
        unsigned needs;
    } path[] = {{"plain C", simd_operations_c, 0},
                {"AVX2", simd_operations_avx2, CTS_CPU_AVX2},
                {"AVX-512", simd_operations_avx512, CTS_CPU_AVX512}};
    for (size_t k = 0; k < sizeof path / sizeof *path; k++)
        for (uint64_t seed = 0; seed < TRIALS && !(path[k].needs & ~cts_cpu_flags()); seed++)
            compare(path[k].name, path[k].operations, seed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_operations)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
