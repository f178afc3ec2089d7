/* The hot loops of splatting on extreme input: every SIMD path against plain C, to the bit, including memory around the
 * output. A failure prints the parameters that reproduce it. */
#include "base/cpu.h"
#include "engine/splat/loops.h"
#include "random_input.h"
#include "unit.h"
#include <string.h>

enum { N = 75, EDGE = 64, ROWS = 40, WIDTH = 4 * N + 4 * CTS_MAX_TAPS, TRIALS = 400 };

static float unit_float(void)
{
    const int ugly = below(8);
    return ugly == 0 ? 0 : ugly == 1 ? 1 : ugly == 2 ? 0x1p-24f : (float)(random_u32() >> 8) * 0x1p-24f;
}

/* Grey levels at the floor, at the ceiling, in runs and at random. */
static void fill_grey(uint16_t *grey, int n)
{
    const int kind = below(5);
    for (int i = 0; i < n; i++)
        grey[i] = (uint16_t)(kind == 0   ? 0
                             : kind == 1 ? 65535
                             : kind == 2 ? (below(2) ? 65535 : 0)
                             : kind == 3 ? 1000 + i / 9
                                         : (int)random_u32());
}

static void same(const char *loop, const void *plain, const void *fast, size_t bytes, unsigned mask, uint64_t seed,
                 int i0, int i1)
{
    if (memcmp(plain, fast, bytes) != 0)
        fail_msg("%s: CPU mask %u, seed %llu, %d to %d: differs from plain C", loop, mask, (unsigned long long)seed, i0,
                 i1);
}

typedef void (*Loop)(const CtsSimd *plain, const CtsSimd *fast, unsigned mask, uint64_t seed);

static void scatter(const CtsSimd *plain, const CtsSimd *fast, unsigned mask, uint64_t seed)
{
    static uint32_t a[CTS_MAX_TAPS][WIDTH], b[CTS_MAX_TAPS][WIDTH];
    static const CtsKernelId kernels[] = {CTS_KERNEL_TENT, CTS_KERNEL_GAUSSIAN, CTS_KERNEL_CONE, CTS_KERNEL_BSPLINE};
    static const int densities[] = {1, 2, 4};
    const int density[2] = {densities[below(3)], densities[below(3)]};
    uint16_t value[N], old[N];
    uint64_t marks[(N + 63) / 64];
    CtsFootprint f;
    CtsError err;
    const CtsKernelId kernel = kernels[below(4)];
    assert_int_equal(cts_footprint_init(&f, kernel,
                                        kernel == CTS_KERNEL_GAUSSIAN ? 2
                                        : kernel == CTS_KERNEL_TENT   ? 1
                                                                      : 1.5,
                                        density, &err),
                     CTS_OK);
    fill_grey(value, N);
    fill_grey(old, N);
    for (int i = 0; i < (N + 63) / 64; i++)
        marks[i] = (uint64_t)random_u32() << 32 | random_u32();
    for (int v = 0; v < CTS_MAX_TAPS; v++)
        for (int u = 0; u < WIDTH; u++)
            a[v][u] = b[v][u] = random_u32();
    const int n = 1 + below(N), tap0 = below(2 * f.reach[1] + 1);
    for (int i = n; i < (N + 63) / 64 * 64; i++)
        marks[i / 64] &= ~(UINT64_C(1) << (i & 63));
    CtsScatter job = {.footprint = &f,
                      .sheet = a[tap0],
                      .stride = WIDTH,
                      .tap0 = tap0,
                      .tap1 = tap0 + below(2 * f.reach[1] + 2 - tap0),
                      .value = value,
                      .old = below(2) ? old : NULL};
    plain->scatter(&job, marks, n);
    job.sheet = b[tap0];
    fast->scatter(&job, marks, n);
    same("scatter", a, b, sizeof a, mask, seed, 0, n);
}

/* Against the definition, too. */
static void mark(const CtsSimd *plain, const CtsSimd *fast, unsigned mask, uint64_t seed)
{
    uint16_t value[N], old[N];
    uint64_t marks[3][(N + 63) / 64 + 1] = {{0}}, wanted[(N + 63) / 64];
    const int n = 1 + below(N), least = below(2);
    const uint16_t level = (uint16_t)(below(2) ? random_u32() : 1);
    fill_grey(value, N);
    for (int i = 0; i < N; i++)
        old[i] = below(3) ? value[i] : (uint16_t)random_u32();
    for (int i = 0; i < (N + 63) / 64; i++)
        wanted[i] = below(3) ? (uint64_t)random_u32() << 32 | random_u32() : 0;
    for (int path = 0; path < 2; path++) {
        const CtsSimd *k = path ? fast : plain;
        k->mark(value, least ? NULL : old, level, n, least ? wanted : NULL, marks[path]);
    }
    for (int i = 0; i < n; i++)
        if (least ? value[i] >= level && wanted[i / 64] >> (i & 63) & 1 : value[i] != old[i])
            marks[2][i / 64] |= UINT64_C(1) << (i & 63);
    same(least ? "mark by level" : "mark changes", marks[0], marks[1], sizeof marks[0], mask, seed, 0, n);
    same(least ? "mark by level, defined" : "mark changes, defined", marks[2], marks[1], sizeof marks[0], mask, seed, 0,
         n);
}

/* Positions on a lattice of N columns and ROWS rows, sampled; pixels are then blended, unlit and lit. */
enum { WORDS = (N + 63) / 64 };
typedef struct Pixels {
    int32_t cell[2][64 * WORDS];
    float frac[2][64 * WORDS];
    uint16_t grey[64 * WORDS];
    float rgbt[64 * WORDS][4];
    uint64_t marks[WORDS], closed[WORDS];
} Pixels;

static void place_all(const CtsSimd *k, uint64_t seed, int n, int last, Pixels *p)
{
    state = seed;
    for (int axis = 0; axis < 2; axis++) {
        const double base = (double)below(2 * last) - last / 2.0 + (double)unit_float();
        const double by_x = ((double)below(200) - 100) / 64;
        k->place(base, below(4) ? by_x : 0, last, below(50), n, p->cell[axis], p->frac[axis]);
    }
}

static void pixels(const CtsSimd *plain, const CtsSimd *fast, unsigned mask, uint64_t seed)
{
    static uint32_t sheets[2][ROWS + 2][N + 2 * EDGE];
    static float entry[65536][4], field[2][ROWS + 2][N + EDGE][4];
    static Pixels p[2];
    const int n = 1 + below(N), last = 1 + below(ROWS - 1), lit = below(2);
    memset(p, 0, sizeof p);
    for (size_t i = 0; i < sizeof sheets / sizeof(uint32_t); i++)
        ((uint32_t *)sheets)[i] = below(3) ? random_u32() % (65535u * CTS_WEIGHT_ONE) : 0;
    for (size_t i = 0; i < sizeof field / sizeof(float); i++)
        ((float *)field)[i] = i % 4 == 3 || below(5) == 0 ? 0 : (float)(below(131071) - 65535);
    const int top = below(2) ? 65535 : 200 + below(65000), low = below(200), high = top - below(200);
    for (int i = 0; i < 65536; i++) {
        const float alpha = i >= low && i <= high && below(3) ? unit_float() : 0;
        for (int c = 0; c < 4; c++)
            entry[i][c] = c < 3 ? alpha * unit_float() : -alpha;
    }
    const CtsEntries entries = {entry, (uint16_t)low, (uint16_t)high, (uint16_t)top};
    const CtsSheetPair pair = {sheets[0][0], below(2) ? sheets[1][0] : NULL, N + 2 * EDGE, unit_float(), top};
    CtsShade shade = {.ambient = 0.2f, .diffuse = 0.7f, .specular = 0.3f, .n_power = 64};
    float power[65];
    for (int i = 0; i <= 64; i++)
        power[i] = (float)i * (1.0f / 64);
    shade.power = power;
    for (int i = 0; i < 9; i++)
        shade.frame[i / 3][i % 3] = (float)below(2001) / 1000 - 1;
    const CtsLight light = {.shade = &shade,
                            .first = (const float(*)[4])field[0][0],
                            .second = below(2) ? (const float(*)[4])field[1][0] : NULL,
                            .stride = N + EDGE,
                            .weight = unit_float()};
    for (int i = 0; i < 64 * WORDS; i++)
        for (int c = 0; c < 4; c++)
            p[0].rgbt[i][c] = p[1].rgbt[i][c] = unit_float();
    for (int i = 0; i < 64 * WORDS; i++) /* transmittance is 0 or at least this */
        if (p[0].rgbt[i][3] > 0 && p[0].rgbt[i][3] < CTS_OPAQUE_BELOW)
            p[0].rgbt[i][3] = p[1].rgbt[i][3] = CTS_OPAQUE_BELOW;
    const int first = below(WORDS), past = first + 1 + below(WORDS - first), all = below(2), track = below(2);
    for (int i = 0; i < n; i++)
        if (all || below(3))
            p[0].marks[i / 64] |= UINT64_C(1) << (i & 63);
    memcpy(p[1].marks, p[0].marks, sizeof p[0].marks);
    const uint64_t places_seed = state;
    for (int path = 0; path < 2; path++) {
        const CtsSimd *k = path ? fast : plain;
        Pixels *to = &p[path];
        place_all(k, places_seed, n, last, to);
        const CtsPlaces places = {{to->cell[0], to->cell[1]}, {to->frac[0], to->frac[1]}, false};
        const CtsRowMarks marks = {to->marks, first, past};
        uint64_t *const closed = track ? to->closed : NULL;
        k->sample(&pair, &places, &entries, &marks, to->grey);
        k->blend(to->rgbt[0], to->grey, &marks, &entries, &places, lit ? &light : NULL, closed);
    }
    for (int axis = 0; axis < 2; axis++) {
        same("place, cells", p[0].cell[axis], p[1].cell[axis], (size_t)n * sizeof(int32_t), mask, seed, 0, n);
        same("place, fractions", p[0].frac[axis], p[1].frac[axis], (size_t)n * sizeof(float), mask, seed, 0, n);
    }
    same("sample", p[0].grey, p[1].grey, (size_t)n * sizeof(uint16_t), mask, seed, 0, n);
    same("sample, marks", p[0].marks, p[1].marks, sizeof p[0].marks, mask, seed, 0, n);
    same(lit ? "light" : "blend", p[0].rgbt, p[1].rgbt, sizeof p[0].rgbt, mask, seed, 0, n);
    same(lit ? "light, closed" : "blend, closed", p[0].closed, p[1].closed, sizeof p[0].closed, mask, seed, 0, n);
}

static void gradient(const CtsSimd *plain, const CtsSimd *fast, unsigned mask, uint64_t seed)
{
    uint16_t rows[5][N];
    float g[2][N][4];
    for (int r = 0; r < 5; r++)
        fill_grey(rows[r], N);
    memset(g, 0, sizeof g);
    const int n = 1 + below(N), i0 = below(n), i1 = i0 + below(n - i0 + 1);
    const CtsGradientRows job = {.row = rows[0],
                                 .before = {rows[1], rows[2]},
                                 .after = {rows[3], rows[4]},
                                 .scale = {(float)below(3), (float)below(3)},
                                 .n = n,
                                 .air_beyond = below(2)};
    plain->gradient(&job, i0, i1, g[0]);
    fast->gradient(&job, i0, i1, g[1]);
    same("gradient", g[0], g[1], sizeof g[0], mask, seed, i0, i1);
}

/* With every choice of the flags that this processor has, so that a new path is met without being named. */
static void each_path(Loop loop)
{
    const unsigned all = cts_cpu_flags();
    for (unsigned mask = 0; mask <= all; mask++) {
        if (mask & ~all)
            continue;
        cts_cpu_set_mask(mask);
        const CtsSimd *const fast = cts_simd_choice(cts_cpu_flags());
        for (uint64_t trial = 0; trial < TRIALS; trial++) {
            state = trial;
            loop(cts_simd_choice(0), fast, mask, trial);
        }
    }
    cts_cpu_set_mask(~0u);
}

static void test_scatter(void **unused)
{
    each_path(scatter);
}

static void test_marks(void **unused)
{
    each_path(mark);
}

static void test_pixels(void **unused)
{
    each_path(pixels);
}

static void test_gradient(void **unused)
{
    each_path(gradient);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_scatter), cmocka_unit_test(test_marks),
                                       cmocka_unit_test(test_pixels), cmocka_unit_test(test_gradient)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
