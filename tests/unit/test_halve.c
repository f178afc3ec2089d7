/* Half the resolution: against formulas, and plain C against what runs here. */
#include "unit.h"

#include "base/cpu.h"
#include "base/sanitized.h"
#include "core/volume/body_mask.h"
#include "core/volume/halve.h"
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

static CtsVolume *make(int nx, int ny, int nz)
{
    CtsVolume *v;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, nx, ny, nz, &err), CTS_OK);
    return v;
}

static CtsVolume *halve(const CtsVolume *v, int n_threads)
{
    CtsVolume *h;
    CtsError err;
    assert_int_equal(cts_volume_halve(v, n_threads, &h, &err), CTS_OK);
    assert_null(h->macrocells);
    assert_null(h->body);
    return h;
}

static uint32_t next(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static size_t voxel(const CtsVolume *v, const int at[3])
{
    return ((size_t)at[2] * (size_t)v->dims[1] + (size_t)at[1]) * (size_t)v->dims[0] + (size_t)at[0];
}

/* From voxel to voxel, columns first; 0, and back at the first one, behind the last. */
static int next_voxel(const CtsVolume *v, int at[3])
{
    for (int a = 0; a < 3; a++) {
        if (++at[a] < v->dims[a])
            return 1;
        at[a] = 0;
    }
    return 0;
}

static const int sizes[][2] = {{1, 1},   {2, 2},   {3, 2},   {4, 3},    {5, 3},     {6, 4},
                               {7, 4},   {8, 5},   {17, 9},  {36, 19},  {37, 19},   {64, 33},
                               {65, 33}, {71, 36}, {72, 37}, {100, 51}, {512, 257}, {324, 163}};
enum { N_SIZES = sizeof sizes / sizeof *sizes };

/* The box of voxel centres stays, steps keep their directions; what else a volume tells stays too. */
static void test_place(void **state)
{
    (void)state;
    for (int s = 0; s < N_SIZES; s++)
        for (int axis = 0; axis < 3; axis++) {
            int dims[3] = {5, 5, 5};
            dims[axis] = sizes[s][0];
            CtsVolume *v = make(dims[0], dims[1], dims[2]);
            const double step[3][3] = {{0.7, 0.01, 0}, {-0.01, 0.7, 0.02}, {0, 0.2, 0.71}};
            memcpy(v->step_lps, step, sizeof step);
            memcpy(v->origin_lps, (const double[3]){-170.25, -201.5, 1033.125}, sizeof v->origin_lps);
            v->hu_offset = -2048;
            v->hu_step = 0.5;
            v->hu_min = -1999;
            v->hu_max = 3071.5;
            CtsError err;
            CtsBodyMask mask = {.n_slices = 1};
            assert_int_equal(cts_volume_prepare(v, 1, &err), CTS_OK);
            v->body = &mask;
            CtsVolume *h = halve(v, 1);
            v->body = NULL;
            for (int a = 0; a < 3; a++) {
                assert_int_equal(h->dims[a], a == axis ? sizes[s][1] : 3);
                assert_true(h->origin_lps[a] == v->origin_lps[a]);
                for (int c = 0; c < 3; c++)
                    assert_true(fabs((h->dims[a] - 1) * h->step_lps[a][c] - (v->dims[a] - 1) * v->step_lps[a][c]) <
                                1e-9);
                /* An axis of one voxel has no extent that could tell its step. */
                if (v->dims[a] < 3)
                    assert_memory_equal(h->step_lps[a], v->step_lps[a], sizeof v->step_lps[a]);
            }
            assert_true(h->hu_offset == -2048 && h->hu_step == 0.5 && h->hu_min == -1999 && h->hu_max == 3071.5);
            cts_volume_free(&v);
            cts_volume_free(&h);
        }
}

static void test_slice_layers(void **state)
{
    (void)state;
    static const int cases[][3] = {/* slices, layers before and after */
                                   {65, 1, 1}, {65, 2, 1}, {65, 3, 2}, {65, 4, 2}, {65, 8, 4}, {2, 3, 3}, {64, 4, 2}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsVolume *v = make(4, 3, cases[i][0]);
        v->slice_layers = cases[i][1];
        CtsVolume *h = halve(v, 1);
        assert_int_equal(h->slice_layers, cases[i][2]);
        cts_volume_free(&v);
        cts_volume_free(&h);
    }
}

/* Slices far apart stay as many and as they are. */
static void test_coarse_axis(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        CtsVolume *v = make(41, 42, 43);
        v->step_lps[axis][axis] = 1.5;
        v->slice_layers = 3;
        int at[3] = {0, 0, 0};
        do
            v->grey[voxel(v, at)] = (uint16_t)(65535 - 1021 * at[axis]);
        while (next_voxel(v, at));
        CtsVolume *h = halve(v, 2);
        for (int a = 0; a < 3; a++) {
            assert_int_equal(h->dims[a], a == axis ? v->dims[a] : v->dims[a] / 2 + 1);
            assert_true(h->step_lps[a][a] == (a == axis ? 1.5 : (v->dims[a] - 1.0) / (v->dims[a] / 2)));
        }
        assert_int_equal(h->slice_layers, axis == 2 ? 3 : 2);
        do
            assert_int_equal(h->grey[voxel(h, at)], 65535 - 1021 * at[axis]);
        while (next_voxel(h, at));
        cts_volume_free(&h);
        v->step_lps[axis][axis] = 1.49;
        h = halve(v, 2);
        assert_int_equal(h->dims[axis], v->dims[axis] / 2 + 1);
        cts_volume_free(&v);
        cts_volume_free(&h);
    }
}

static void test_constant(void **state)
{
    (void)state;
    static const uint16_t greys[] = {0, 1, 1024, 32767, 32768, 65534, 65535};
    for (size_t g = 0; g < sizeof greys / sizeof *greys; g++)
        for (int s = 0; s < N_SIZES; s++)
            for (int axis = 0; axis < 3; axis++) {
                int dims[3] = {4, 6, 3};
                dims[axis] = sizes[s][0];
                CtsVolume *v = make(dims[0], dims[1], dims[2]);
                for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
                    v->grey[i] = greys[g];
                CtsVolume *h = halve(v, 1);
                for (size_t i = 0; i < cts_volume_n_voxels(h); i++)
                    assert_int_equal(h->grey[i], greys[g]);
                cts_volume_free(&v);
                cts_volume_free(&h);
            }
}

/* A straight line stays one at all nodes but the outermost, which see it end. */
static void test_ramp(void **state)
{
    (void)state;
    for (int s = 0; s < N_SIZES; s++)
        for (int axis = 0; axis < 3; axis++) {
            int dims[3] = {4, 5, 6};
            dims[axis] = sizes[s][0];
            CtsVolume *v = make(dims[0], dims[1], dims[2]);
            int at[3] = {0, 0, 0};
            do
                v->grey[voxel(v, at)] = (uint16_t)(7 + 101 * at[axis]);
            while (next_voxel(v, at));
            CtsVolume *h = halve(v, 1);
            do
                if (at[axis] > 0 && at[axis] + 1 < h->dims[axis])
                    assert_true(fabs(h->grey[voxel(h, at)] - (7 + 101 * at[axis] * h->step_lps[axis][axis])) < 0.55);
            while (next_voxel(h, at));
            cts_volume_free(&v);
            cts_volume_free(&h);
        }
}

/* One voxel among equal ones shows the weights: of steps of two voxels those of the 5/3 wavelet, to the last bit. */
static void test_impulse(void **state)
{
    (void)state;
    enum { N = 65, BASE = 8000, RISE = 512 * 64 };
    static const int eighths[4] = {6, 2, -1, 0};
    for (int odd = 0; odd < 8; odd++) {
        CtsVolume *v = make(N, N, N);
        for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
            v->grey[i] = BASE;
        const int there[3] = {30 + (odd & 1), 32 + (odd >> 1 & 1), 34 + (odd >> 2)};
        v->grey[voxel(v, there)] += RISE;
        CtsVolume *h = halve(v, 1);
        int at[3] = {0, 0, 0};
        do {
            int rise = RISE / 512;
            for (int a = 0; a < 3; a++) {
                const int away = abs(2 * at[a] - there[a]);
                rise *= eighths[away < 3 ? away : 3];
            }
            assert_int_equal(h->grey[voxel(h, at)], BASE + rise);
        } while (next_voxel(h, at));
        cts_volume_free(&v);
        cts_volume_free(&h);
    }
}

/* What overshoots is cut, on each axis. */
static void test_cut(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++)
        for (int step = 32; step <= 33; step++) {
            int dims[3] = {2, 2, 2};
            dims[axis] = 65;
            CtsVolume *v = make(dims[0], dims[1], dims[2]);
            int at[3] = {0, 0, 0};
            do
                v->grey[voxel(v, at)] = at[axis] < step ? 0 : 65535;
            while (next_voxel(v, at));
            CtsVolume *h = halve(v, 1);
            do {
                const int eighths = at[axis] != 16 ? (at[axis] < 16 ? 0 : 8) : step == 32 ? 7 : 1;
                assert_int_equal(h->grey[voxel(h, at)], (int)floor(65535 * eighths / 8.0 + 0.5));
            } while (next_voxel(h, at));
            cts_volume_free(&v);
            cts_volume_free(&h);
        }
}

/* A line at node i by the words of halve.h. */
static double formula(const double *line, size_t step, int n, int i, int n_nodes)
{
    static const double low_pass[5] = {-1, 2, 6, 2, -1};
    const double h = (n - 1.0) / (n_nodes - 1);
    double sum = 0;
    for (int m = 0; m < 5; m++) {
        const double x = fmin(fmax((i + (m - 2) / 2.0) * h, 0), n - 1);
        const int cell = (int)fmin(floor(x), n - 2);
        const double a = line[(size_t)cell * step], b = line[(size_t)(cell + 1) * step];
        sum += low_pass[m] / 8 * (a + (b - a) * (x - cell));
    }
    return sum;
}

/* Random levels, in the middle of the range so that nothing is cut. Three roundings, of which the first two are
 * weighed again by up to 1.5 an axis, and weights of 14 bits. */
static void check_formula(int nx, int ny, int nz)
{
    CtsVolume *v = make(nx, ny, nz);
    uint32_t random = (uint32_t)(nx * 10007 + ny * 101 + nz);
    double *level = malloc(cts_volume_n_voxels(v) * sizeof *level),
           *made = malloc(cts_volume_n_voxels(v) * sizeof *made);
    assert_true(level && made);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        level[i] = v->grey[i] = (uint16_t)(20000 + next(&random) % 4096);
    CtsVolume *h = halve(v, 1);
    size_t step = 1, rest = (size_t)nx * (size_t)ny * (size_t)nz;
    for (int a = 0; a < 3; a++) {
        const int n = v->dims[a], n_nodes = h->dims[a];
        assert_int_equal(n_nodes, n < 3 ? n : n / 2 + 1);
        rest /= (size_t)n;
        for (size_t outer = 0; outer < rest; outer++)
            for (int i = 0; i < n_nodes; i++)
                for (size_t s = 0; s < step; s++) {
                    const double *const line = level + outer * (size_t)n * step + s;
                    made[(outer * (size_t)n_nodes + (size_t)i) * step + s] =
                        n < 3 ? line[(size_t)i * step] : formula(line, step, n, i, n_nodes);
                }
        memcpy(level, made, rest * (size_t)n_nodes * step * sizeof *level);
        step *= (size_t)n_nodes;
    }
    for (size_t i = 0; i < cts_volume_n_voxels(h); i++)
        assert_true(fabs(h->grey[i] - level[i]) < 0.5 * (1 + 1.5 + 1.5 * 1.5) + 0.6);
    free(level);
    free(made);
    cts_volume_free(&v);
    cts_volume_free(&h);
}

static void test_formula(void **state)
{
    (void)state;
    static const int ugly[] = {1, 2, 3, 4, 5, 6, 7, 17, 38, 75};
    enum { N = sizeof ugly / sizeof *ugly };
    for (int x = 0; x < N; x++)
        for (int y = 0; y < N; y++)
            for (int z = 0; z < N; z++)
                check_formula(ugly[x], ugly[y], ugly[z]);
}

/* The same bytes by plain C and by what runs here, by any number of threads. */
static void check_paths(int nx, int ny, int nz, double slice_mm)
{
    CtsVolume *v = make(nx, ny, nz), *half[4];
    uint32_t random = (uint32_t)(nx * 10007 + ny * 101 + nz);
    v->step_lps[2][2] = slice_mm;
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++) {
        const uint32_t r = next(&random);
        v->grey[i] = (uint16_t)(r & 3 ? r >> 4 : r & 4 ? 65535 : 0);
    }
    cts_cpu_set_mask(0);
    half[0] = halve(v, 1);
    cts_cpu_set_mask(~0u);
    half[1] = halve(v, 1);
    half[2] = halve(v, 2);
    half[3] = halve(v, 5);
    for (int i = 1; i < 4; i++) {
        assert_memory_equal(half[i]->dims, half[0]->dims, sizeof half[0]->dims);
        assert_memory_equal(half[i]->grey, half[0]->grey, cts_volume_n_voxels(half[0]) * sizeof *half[0]->grey);
    }
    for (int i = 0; i < 4; i++)
        cts_volume_free(&half[i]);
    cts_volume_free(&v);
}

static void test_paths(void **state)
{
    (void)state;
    static const int ugly[] = {1, 2, 3, 5, 7, 17, 36, 37, 38, 70};
    enum { N = sizeof ugly / sizeof *ugly };
    for (int x = 0; x < N; x++)
        for (int y = 0; y < N; y++)
            for (int z = 0; z < N; z++)
                check_paths(ugly[x], ugly[y], ugly[z], 1);
    for (int n = 60; n < 120; n++)
        check_paths(n, 3, n % 5 + 1, 1);
    check_paths(2111, 70, 9, 1); /* several blocks of rows, the last one shorter */
    check_paths(2111, 71, 9, 5);
    check_paths(101, 600, 40, 1);
}

/* No memory, no volume. */
static void test_too_large(void **state)
{
    (void)state;
    static const int cases[][3] = {{INT_MAX, INT_MAX, INT_MAX}, {1 << 16, 1 << 16, 1 << 16}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsVolume *v = make(1, 1, 1), *h = v;
        CtsError err;
        memcpy(v->dims, cases[i], sizeof v->dims);
        assert_int_equal(cts_volume_halve(v, 1, &h, &err), CTS_ERR_MEMORY);
        assert_null(h);
        cts_volume_free(&v);
    }
}

static void test_out_of_memory(void **state)
{
    (void)state;
    if (CTS_SANITIZED)
        skip(); /* takes the address space for itself */
    CtsVolume *v = make(511, 511, 131), *h = v;
    CtsError err;
    struct rlimit before;
    unsigned long long pages = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%llu", &pages), 1);
    fclose(file);
    assert_int_equal(getrlimit(RLIMIT_AS, &before), 0);
    int n_refused = 0;
    CtsStatus st = CTS_ERR_MEMORY;
    for (rlim_t more = 0; st && more < 64 << 20; more += 64 << 10) {
        struct rlimit limit = {(rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE) + more, before.rlim_max};
        assert_int_equal(setrlimit(RLIMIT_AS, &limit), 0);
        st = cts_volume_halve(v, 1, &h, &err);
        assert_int_equal(setrlimit(RLIMIT_AS, &before), 0);
        if (st) {
            assert_int_equal(st, CTS_ERR_MEMORY);
            assert_null(h);
            n_refused++;
        }
    }
    assert_int_equal(st, CTS_OK);
    assert_non_null(h);
    assert_true(n_refused > 0);
    cts_volume_free(&h);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_place),     cmocka_unit_test(test_slice_layers),  cmocka_unit_test(test_coarse_axis),
        cmocka_unit_test(test_constant),  cmocka_unit_test(test_ramp),          cmocka_unit_test(test_impulse),
        cmocka_unit_test(test_cut),       cmocka_unit_test(test_formula),       cmocka_unit_test(test_paths),
        cmocka_unit_test(test_too_large), cmocka_unit_test(test_out_of_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
