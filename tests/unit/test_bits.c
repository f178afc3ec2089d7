/* Bit masks. */
#include "unit.h"
#include <string.h>

#include "core/couch/table_removal.h"
#include "core/volume/threshold.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stdlib.h>

static const int sizes[][3] = {{1, 1, 1},  {2, 1, 3},  {5, 5, 5},   {9, 4, 13},    {64, 8, 9}, {65, 9, 8},
                               {66, 5, 6}, {68, 3, 1}, {127, 7, 5}, {129, 12, 17}, {1, 70, 2}, {300, 6, 4}};
enum { N_SIZES = sizeof sizes / sizeof *sizes, MIN = 500 };

static uint32_t random_next(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

/* Air, something dense and boxes of either, so that macro-cells come all empty, all full and mixed. */
static CtsVolume *make(const int dims[3], uint32_t seed)
{
    CtsVolume *v;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, dims[0], dims[1], dims[2], &err), CTS_OK);
    const size_t n = cts_volume_n_voxels(v);
    for (size_t i = 0; i < n; i++)
        v->grey[i] = (uint16_t)(random_next(&seed) % 40);
    for (int box = 0; box < 6; box++) {
        int lo[3], hi[3];
        for (int axis = 0; axis < 3; axis++) {
            lo[axis] = (int)(random_next(&seed) % (uint32_t)dims[axis]);
            hi[axis] = lo[axis] + 1 + (int)(random_next(&seed) % 24);
            hi[axis] = hi[axis] < dims[axis] ? hi[axis] : dims[axis];
        }
        for (int k = lo[2]; k < hi[2]; k++)
            for (int j = lo[1]; j < hi[1]; j++)
                for (int i = lo[0]; i < hi[0]; i++)
                    v->grey[((size_t)k * (size_t)dims[1] + (size_t)j) * (size_t)dims[0] + (size_t)i] =
                        (uint16_t)(MIN - 2 + (int)(random_next(&seed) % (box % 2 ? 5 : 900)));
    }
    return v;
}

static void test_threshold(void **state)
{
    for (int s = 0; s < N_SIZES; s++) {
        CtsVolume *v = make(sizes[s], (uint32_t)s);
        CtsBits plain;
        CtsError err;
        uint64_t n_runs = 0;
        for (size_t at = 0; at < cts_volume_n_voxels(v); at++)
            n_runs += v->grey[at] >= MIN && (at % (size_t)v->dims[0] == 0 || v->grey[at - 1] < MIN);
        assert_int_equal(cts_bits_new(&plain, v->dims, &err), CTS_OK);
        for (int threads = 1; threads <= 3; threads += 2)
            assert_true(cts_bits_threshold(&plain, v->grey, MIN, threads) == n_runs);
        for (int k = 0; k < v->dims[2]; k++)
            for (int j = 0; j < v->dims[1]; j++)
                for (int i = 0; i < v->dims[0]; i++)
                    assert_int_equal(cts_bits_get(&plain, i, j, k),
                                     v->grey[(k * v->dims[1] + j) * v->dims[0] + i] >= MIN);
        cts_bits_free(&plain);
        cts_volume_free(&v);
    }
}

/* Reference implementation: is a voxel within reach of a set one? */
static bool reached(const CtsBits *in, CtsReach reach, int i, int j, bool set)
{
    const int r = reach.diamond;
    for (int dj = -r; dj <= r; dj++)
        for (int di = abs(dj) - r; di <= r - abs(dj); di++)
            for (int bj = -reach.box[1]; bj <= reach.box[1]; bj++)
                for (int bi = -reach.box[0]; bi <= reach.box[0]; bi++) {
                    const int x = i + di + bi, y = j + dj + bj;
                    if (x >= 0 && y >= 0 && x < in->dims[0] && y < in->dims[1] && cts_bits_get(in, x, y, 0) == set)
                        return true;
                }
    return false;
}

static void check_morphology(int nx, int ny, CtsReach reach, uint32_t seed)
{
    CtsBits in, wide, open, narrow, thin;
    CtsMorphology *m;
    CtsError err;
    const int dims[3] = {nx, ny, 1};
    assert_int_equal(cts_bits_new(&in, dims, &err) || cts_bits_new(&wide, dims, &err) ||
                         cts_bits_new(&open, dims, &err) || cts_bits_new(&narrow, dims, &err) ||
                         cts_bits_new(&thin, dims, &err) || cts_morphologies_new(&m, &in, 1, &err),
                     CTS_OK);
    const int first = seed % 2 ? 0 : ny / 3, end = seed % 2 ? ny : ny / 3 + (ny + 1) / 2;
    for (int j = first; j < end; j++)
        for (int i = 0; i < nx; i++)
            if (random_next(&seed) % 40 && (i / 7 + j / 5) % 3)
                cts_bits_set(&in, i, j, 0);
    cts_dilate_section(m, in.words, reach, wide.words);
    cts_bits_combine(&open, CTS_BITS_OR, &in);
    cts_each_section(m, 1, cts_open_section, &open, reach, &open);
    cts_thin_section(m, in.words, reach, thin.words);
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++)
            if (!reached(&in, reach, i, j, false))
                cts_bits_set(&narrow, i, j, 0);
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++) {
            assert_int_equal(cts_bits_get(&wide, i, j, 0), reached(&in, reach, i, j, true));
            assert_int_equal(cts_bits_get(&open, i, j, 0), reached(&narrow, reach, i, j, true));
            assert_int_equal(cts_bits_get(&thin, i, j, 0),
                             cts_bits_get(&in, i, j, 0) && !reached(&open, (CtsReach){.diamond = 1}, i, j, true));
        }
    CtsBits *all[] = {&in, &wide, &open, &narrow, &thin};
    for (int n = 0; n < 5; n++)
        cts_bits_free(all[n]);
    cts_morphologies_free(&m, 1);
}

/* Some voxels far apart, made wider by up to more than a row of words: by the octagon's formula. */
static void test_far_reach(void **state)
{
    static const int shapes[][2] = {{100, 70}, {128, 64}, {64, 1}, {3, 130}, {191, 40}, {1, 1}};
    uint32_t seed = 7;
    for (int n = 0; n < 240; n++) {
        const int dims[3] = {shapes[n % 6][0], shapes[n % 6][1], 1};
        const int most = n < 120 ? 12 : 75;
        const CtsReach reach = {
            (int)(random_next(&seed) % (unsigned)most),
            {(int)(random_next(&seed) % (unsigned)most), (int)(random_next(&seed) % (unsigned)most)}};
        int at[3][2];
        CtsBits in, wide;
        CtsMorphology *m;
        CtsError err;
        assert_int_equal(cts_bits_new(&in, dims, &err) || cts_bits_new(&wide, dims, &err) ||
                             cts_morphologies_new(&m, &in, 1, &err),
                         CTS_OK);
        for (int k = 0; k < 3; k++) {
            for (int c = 0; c < 2; c++)
                at[k][c] = n % 4 ? (int)(random_next(&seed) % (unsigned)dims[c]) : k % 2 * (dims[c] - 1); /* corners */
            cts_bits_set(&in, at[k][0], at[k][1], 0);
        }
        for (int again = 0; again < 2; again++) { /* nothing is left of the first time */
            cts_dilate_section(m, in.words, reach, wide.words);
            for (int j = 0; j < dims[1]; j++)
                for (int i = 0; i < dims[0]; i++) {
                    bool reached_it = false;
                    for (int k = 0; k < 3; k++) {
                        const int dx = abs(i - at[k][0]) - reach.box[0], dy = abs(j - at[k][1]) - reach.box[1];
                        reached_it |= (dx > 0 ? dx : 0) + (dy > 0 ? dy : 0) <= reach.diamond;
                    }
                    assert_int_equal(cts_bits_get(&wide, i, j, 0), reached_it);
                }
        }
        cts_bits_free(&in);
        cts_bits_free(&wide);
        cts_morphologies_free(&m, 1);
    }
}

static void test_morphology(void **state)
{
    const CtsReach reaches[] = {{1, {0, 0}}, {1, {1, 0}}, {2, {0, 3}}, {3, {2, 2}}, {7, {1, 5}}};
    for (int n = 0; n < 5; n++)
        for (int s = 0; s < N_SIZES; s++)
            check_morphology(sizes[s][0], sizes[s][1], reaches[n], (uint32_t)s);
    const double spacing_mm[2] = {0.5, 2};
    const CtsReach disk = cts_reach_mm(8, spacing_mm);
    assert_true(disk.diamond + disk.box[0] == 16 && disk.diamond + disk.box[1] == 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_threshold),
        cmocka_unit_test(test_morphology),
        cmocka_unit_test(test_far_reach),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
