/* Positions of voxels in the patient, and cropping. */
#include "base/cpu.h"
#include "base/vec3.h"
#include "core/model/macrocells.h"
#include "ctsplat/model.h"
#include "unit.h"
#include <limits.h>
#include <stdbool.h>
#include <string.h>

/* 5 x 6 x 7 voxels whose values encode their indices: grey = 1 + i + 10 j + 100 k. */
static CtsVolume *make_volume(const double step_lps[3][3])
{
    CtsVolume *v = NULL;
    assert_int_equal(cts_volume_new(&v, 5, 6, 7, NULL), CTS_OK);
    memcpy(v->step_lps, step_lps, sizeof v->step_lps);
    for (int c = 0; c < 3; c++)
        v->origin_lps[c] = 10 * (c + 1);
    for (int k = 0; k < 7; k++)
        for (int j = 0; j < 6; j++)
            for (int i = 0; i < 5; i++)
                v->grey[(k * 6 + j) * 5 + i] = (uint16_t)(1 + i + 10 * j + 100 * k);
    return v;
}

static const double straight[3][3] = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
static const double coronal[3][3] = {{1, 0, 0}, {0, 0, -2}, {0, 3, 0}};
static const double oblique[3][3] = {{0.8, 0.36, 0.48}, {-1.2, 0.96, 1.28}, {0, -2.4, 1.8}};
static const double sheared[3][3] = {{1, 0, 0}, {0, 2, 0}, {0, 1.5, 3}};
static const double (*const all_steps[])[3] = {straight, coronal, oblique, sheared};

static bool close_to(double a, double b)
{
    return fabs(a - b) <= 1e-12 * (1 + fabs(b));
}

static void test_new(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    const int bad[][3] = {{0, 1, 1}, {1, 0, 1}, {1, 1, 0}, {-5, 1, 1}, {1, INT_MIN, 1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(cts_volume_new(&v, bad[i][0], bad[i][1], bad[i][2], &err), CTS_ERR_GEOMETRY);
        assert_null(v);
    }
    assert_int_equal(cts_volume_new(&v, INT_MAX, INT_MAX, INT_MAX, &err), CTS_ERR_MEMORY);
    assert_null(v);
    assert_int_equal(cts_volume_new(&v, 2, 3, 4, &err), CTS_OK);
    assert_int_equal(cts_volume_n_voxels(v), 24);
    assert_true(cts_volume_hu(v, 0) == -1024 && cts_volume_hu(v, 1024) == 0 && cts_volume_hu(v, 65535) == 64511);
    for (int i = 0; i < 24; i++)
        assert_int_equal(v->grey[i], 0);
    cts_volume_free(&v);
    assert_null(v);
    cts_volume_free(&v);
}

static void test_geometry(void **state)
{
    CtsVolume *v = make_volume(straight);
    double centre[3];
    cts_volume_centre_lps(v, centre);
    assert_true(centre[0] == 12 && centre[1] == 25 && centre[2] == 39);
    assert_true(cts_volume_spacing_mm(v, 0) == 1 && cts_volume_spacing_mm(v, 1) == 2 &&
                cts_volume_spacing_mm(v, 2) == 3);
    assert_true(close_to(cts_volume_diagonal_mm(v), sqrt(4 * 4 + 10 * 10 + 18 * 18)));
    cts_volume_free(&v);
    v = make_volume(oblique);
    assert_true(close_to(cts_volume_spacing_mm(v, 0), 1) && close_to(cts_volume_spacing_mm(v, 1), 2) &&
                close_to(cts_volume_spacing_mm(v, 2), 3));
    assert_true(close_to(cts_volume_diagonal_mm(v), sqrt(4 * 4 + 10 * 10 + 18 * 18)));
    cts_volume_free(&v);
    /* The longest of a sheared box's diagonals: 4, 10 + 9, 18, whichever way it leans. */
    v = make_volume(sheared);
    assert_true(close_to(cts_volume_diagonal_mm(v), sqrt(4 * 4 + 19 * 19 + 18 * 18)));
    v->step_lps[2][1] = -1.5;
    assert_true(close_to(cts_volume_diagonal_mm(v), sqrt(4 * 4 + 19 * 19 + 18 * 18)));
    cts_volume_free(&v);
}

static void test_inverse(void **state)
{
    for (size_t n = 0; n < sizeof all_steps / sizeof *all_steps; n++) {
        CtsVolume *v = make_volume(all_steps[n]);
        double inverse[3][3], vox[3];
        assert_true(cts_volume_inverse(v, inverse));
        for (int axis = 0; axis < 3; axis++) {
            cts_apply3(inverse, v->step_lps[axis], vox);
            for (int a = 0; a < 3; a++)
                assert_true(close_to(vox[a], a == axis));
        }
        cts_volume_free(&v);
    }
    const double flat[][3][3] = {
        {{1, 0, 0}, {0, 2, 0}, {0, 0, 0}}, {{1, 0, 0}, {2, 0, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 1, 0}, {1, 1, 1e-9}}};
    for (size_t n = 0; n < sizeof flat / sizeof *flat; n++) {
        CtsVolume *v = make_volume(flat[n]);
        double inverse[3][3];
        assert_false(cts_volume_inverse(v, inverse));
        cts_volume_free(&v);
    }
}

static void position(const CtsVolume *v, int i, int j, int k, double lps[3])
{
    for (int c = 0; c < 3; c++)
        lps[c] = v->origin_lps[c] + i * v->step_lps[0][c] + j * v->step_lps[1][c] + k * v->step_lps[2][c];
}

static bool in_box(const double p[3], const double lo[3], const double hi[3])
{
    for (int c = 0; c < 3; c++)
        if (p[c] < lo[c] - 1e-6 || p[c] > hi[c] + 1e-6)
            return false;
    return true;
}

/* Every voxel inside is where it was with its value, all others are air, and no border slice is all outside. */
static void check_crop(const double steps[3][3], const double lo[3], const double hi[3])
{
    CtsVolume *before = make_volume(steps), *v = make_volume(steps);
    double p[3];
    int n_inside = 0, n_kept = 0;
    for (int k = 0; k < 7; k++)
        for (int j = 0; j < 6; j++)
            for (int i = 0; i < 5; i++) {
                position(before, i, j, k, p);
                n_inside += in_box(p, lo, hi);
            }
    const CtsStatus st = cts_volume_crop(v, lo, hi, NULL, NULL);
    if (n_inside == 0) {
        assert_int_equal(st, CTS_ERR_USAGE);
        goto end;
    }
    assert_int_equal(st, CTS_OK);
    int used[3][7] = {{0}};
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++)
            for (int i = 0; i < v->dims[0]; i++) {
                const int grey = v->grey[(k * v->dims[1] + j) * v->dims[0] + i];
                double was[3];
                position(v, i, j, k, p);
                if (!in_box(p, lo, hi)) {
                    assert_int_equal(grey, 0);
                    continue;
                }
                assert_true(grey > 0);
                position(before, (grey - 1) % 10, (grey - 1) / 10 % 10, (grey - 1) / 100, was);
                for (int c = 0; c < 3; c++)
                    assert_true(fabs(was[c] - p[c]) < 1e-9);
                n_kept++;
                used[0][i] = used[1][j] = used[2][k] = 1;
            }
    assert_int_equal(n_kept, n_inside);
    for (int a = 0; a < 3; a++)
        assert_true(used[a][0] && used[a][v->dims[a] - 1]);
end:
    cts_volume_free(&before);
    cts_volume_free(&v);
}

static double between(double low, double high)
{
    static uint32_t seed = 1;
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (seed >> 8) / 16777216.0;
}

static void test_crop(void **state)
{
    for (size_t n = 0; n < sizeof all_steps / sizeof *all_steps; n++)
        for (int round = 0; round < 300; round++) {
            double lo[3], hi[3];
            for (int c = 0; c < 3; c++) {
                lo[c] = between(-20, 60);
                hi[c] = lo[c] + between(0, 40);
            }
            check_crop(all_steps[n], lo, hi);
        }
}

/* Borders that run through voxel centres keep them; boxes larger than the volume and without an end change nothing. */
static void test_crop_borders(void **state)
{
    CtsVolume *v = make_volume(straight);
    const double lo[3] = {11, 22, 33}, hi[3] = {13, 28, 42};
    assert_int_equal(cts_volume_crop(v, lo, hi, NULL, NULL), CTS_OK);
    assert_true(v->dims[0] == 3 && v->dims[1] == 4 && v->dims[2] == 4);
    assert_true(v->origin_lps[0] == 11 && v->origin_lps[1] == 22 && v->origin_lps[2] == 33);
    assert_int_equal(v->grey[0], 112);
    assert_int_equal(v->grey[3 * 4 * 4 - 1], 1 + 3 + 40 + 400);
    const double low[3] = {-INFINITY, -1e300, 0}, high[3] = {INFINITY, 1e300, 100};
    assert_int_equal(cts_volume_crop(v, low, high, NULL, NULL), CTS_OK);
    assert_int_equal(cts_volume_n_voxels(v), 48);
    const double turned_lo[3] = {13, 28, 42}, turned_hi[3] = {11, 22, 33};
    assert_int_equal(cts_volume_crop(v, turned_lo, turned_hi, NULL, NULL), CTS_ERR_USAGE);
    cts_volume_free(&v);
}

/* Each range from its voxels, one by one. */
static void check_ranges(const CtsVolume *v, const CtsRange *range, const int n[3], int size)
{
    for (int at = 0; at < n[0] * n[1] * n[2]; at++) {
        const int low[3] = {at % n[0] * size, at / n[0] % n[1] * size, at / (n[0] * n[1]) * size};
        CtsRange truth = {65535, 0};
        for (int k = low[2]; k <= low[2] + size && k < v->dims[2]; k++)
            for (int j = low[1]; j <= low[1] + size && j < v->dims[1]; j++)
                for (int i = low[0]; i <= low[0] + size && i < v->dims[0]; i++) {
                    const uint16_t grey = v->grey[(k * v->dims[1] + j) * v->dims[0] + i];
                    truth.low = grey < truth.low ? grey : truth.low;
                    truth.high = grey > truth.high ? grey : truth.high;
                }
        assert_true(range[at].low == truth.low && range[at].high == truth.high);
    }
}

static void test_macrocells(void **state)
{
    static const int dims[][3] = {{21, 19, 10}, {9, 8, 5},    {17, 1, 9},   {1, 1, 1},    {5, 33, 16},
                                  {4, 4, 4},    {1024, 3, 2}, {1025, 2, 1}, {1026, 5, 3}, {2050, 1, 2}};
    for (size_t d = 0; d < 2 * sizeof dims / sizeof *dims; d++) {
        CtsVolume *v = NULL;
        const int *const n = dims[d / 2];
        cts_cpu_set_mask(d % 2 ? ~0u : 0); /* the last one leaves all */
        assert_int_equal(cts_volume_new(&v, n[0], n[1], n[2], NULL), CTS_OK);
        for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
            v->grey[i] = (uint16_t)((uint32_t)i * 2654435761u >> 11);
        CtsMacrocells *m;
        assert_int_equal(cts_macrocells_new(&m, v, 1 + (int)d % 3, NULL), CTS_OK);
        check_ranges(v, m->fine, m->n_fine, CTS_FINE_MACROCELL);
        check_ranges(v, &m->all, (const int[]){1, 1, 1}, 4096);
        cts_macrocells_free(&m);
        cts_volume_free(&v);
    }
}

/* Whole slices, cropped twice. */
static void test_crop_slices(void **state)
{
    const int rows[] = {8, 7}; /* slices of 128 bytes, and of 112 */
    for (int n = 0; n < 2; n++)
        for (int first = 0; first < 5; first++) {
            CtsVolume *v = NULL;
            assert_int_equal(cts_volume_new(&v, 8, rows[n], 9, NULL), CTS_OK);
            const int slice = 8 * rows[n];
            for (int i = 0; i < 9 * slice; i++)
                v->grey[i] = (uint16_t)i;
            CtsModel model = {.volume = v};
            assert_int_equal(cts_model_prepare(&model, 1, NULL), CTS_OK);
            const double lo[3] = {-1, -1, first - 0.5}, hi[3] = {20, 20, 7};
            assert_int_equal(cts_model_crop(&model, lo, hi, NULL), CTS_OK);
            assert_null(model.macrocells);
            assert_true(v->dims[0] == 8 && v->dims[1] == rows[n] && v->dims[2] == 8 - first);
            assert_true(v->origin_lps[2] == first);
            for (int i = 0; i < (8 - first) * slice; i++)
                assert_int_equal(v->grey[i], first * slice + i);
            /* A second crop finds the volume as the first has left it. */
            const double again[3] = {-1, -1, 5};
            assert_int_equal(cts_volume_crop(v, again, hi, NULL, NULL), CTS_OK);
            assert_int_equal(v->dims[2], 3);
            assert_int_equal(v->grey[0], 5 * slice);
            cts_volume_free(&v);
        }
}

/* 8 bits of a window: its ends, the middle, both sides; geometry kept. */
static void quantised(void **state)
{
    CtsVolume *v = NULL, *q = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, 6, 1, 1, &err), CTS_OK);
    const int hu[6] = {-1024, 100, 104, 1100, 2100, 3000};
    const int expected[6] = {0, 0, 1, 128, 255, 255}; /* 104 lies 0.51 levels up, 1100 127.5 */
    for (int i = 0; i < 6; i++)
        v->grey[i] = (uint16_t)(hu[i] + 1024);
    v->step_lps[0][0] = 0.5;
    v->origin_lps[2] = 7;
    assert_int_equal(cts_volume_quantise(v, 8, 100, 2100, 2, &q, &err), CTS_OK);
    for (int i = 0; i < 6; i++)
        assert_int_equal(q->grey[i], expected[i]);
    assert_true(fabs(cts_volume_hu(q, 255) - 2100) < 1e-9 && cts_volume_hu(q, 0) == 100);
    assert_true(q->step_lps[0][0] == 0.5 && q->origin_lps[2] == 7);
    cts_volume_free(&q);
    assert_int_equal(cts_volume_quantise(v, 8, 5, 5, 1, &q, &err), CTS_ERR_USAGE);
    assert_null(q);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quantised),        cmocka_unit_test(test_new),        cmocka_unit_test(test_geometry),
        cmocka_unit_test(test_inverse),     cmocka_unit_test(test_crop),       cmocka_unit_test(test_crop_borders),
        cmocka_unit_test(test_crop_slices), cmocka_unit_test(test_macrocells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
