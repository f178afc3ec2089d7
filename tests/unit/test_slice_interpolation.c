/* Layers between slices, and smoothing: against formulas. */
#include "unit.h"

#include "base/cpu.h"
#include "core/volume/shape_interpolation.h"
#include "core/volume/shape_move.h"
#include "core/volume/slice_interpolation.h"
#include "ctsplat/volume.h"
#include <math.h>
#include <stdlib.h>

static CtsInterpolationCounts made;

static CtsVolume *make(int nx, int ny, int nz, double slice_mm)
{
    CtsVolume *v;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, nx, ny, nz, &err), CTS_OK);
    v->step_lps[2][2] = slice_mm;
    v->step_lps[2][1] = 0.3 * slice_mm; /* a tilted gantry */
    return v;
}

static uint32_t next(uint32_t *state)
{
    return *state = *state * 1664525u + 1013904223u;
}

/* Slices keep their values, no value leaves the range of its two slices, a straight line stays one, and positions are
 * kept. */
static void test_layers(void **state)
{
    CtsError err;
    for (int parts = 2; parts <= 8; parts++) {
        CtsVolume *v = make(37, 5, 9, 3.1);
        uint16_t before[9][37 * 5];
        uint32_t random = 7;
        for (int k = 0; k < 9; k++)
            for (int i = 0; i < 37 * 5; i++)
                before[k][i] = v->grey[k * 37 * 5 + i] = i == 3   ? (uint16_t)(1000 + 80 * k)
                                                         : i == 4 ? (uint16_t)((k & 1) * 65535)
                                                                  : (uint16_t)(next(&random) >> 16);
        double end_lps[3];
        for (int c = 0; c < 3; c++)
            end_lps[c] = v->origin_lps[c] + 8 * v->step_lps[2][c];
        assert_int_equal(cts_volume_interpolate(v, parts, CTS_INTERPOLATION_CUBIC, 1 + parts % 3, &made, &err), CTS_OK);
        assert_int_equal(v->dims[2], 8 * parts + 1);
        for (int c = 0; c < 3; c++)
            assert_true(fabs(v->origin_lps[c] + 8 * parts * v->step_lps[2][c] - end_lps[c]) < 1e-9);
        for (int k = 0; k <= 8 * parts; k++)
            for (int i = 0; i < 37 * 5; i++) {
                const int y = v->grey[k * 37 * 5 + i], b = before[k / parts][i];
                const int c = before[k / parts + (k % parts > 0)][i];
                assert_in_range(y, b < c ? b : c, b < c ? c : b);
                if (i == 3)
                    assert_true(abs(y * parts - (1000 * parts + 80 * k)) <= parts);
            }
        cts_volume_free(&v);
    }
}

/* A parabola is met, where the slices on both sides are its own. */
static void test_parabola(void **state)
{
    CtsError err;
    CtsVolume *v = make(1, 1, 12, 4);
    for (int k = 0; k < 12; k++)
        v->grey[k] = (uint16_t)(400 * (k + 1) * (k + 1));
    assert_int_equal(cts_volume_interpolate(v, 4, CTS_INTERPOLATION_CUBIC, 1, &made, &err), CTS_OK);
    for (int k = 4; k <= 40; k++)
        assert_true(fabs(v->grey[k] - 400 * pow(k / 4.0 + 1, 2)) <= 0.51);
    cts_volume_free(&v);
}

/* The same where slices lie at uneven distances. */
static void test_uneven_parabola(void **state)
{
    static const double at[4] = {0, 2, 5, 6};
    uint16_t slice[4], between;
    const uint16_t *const slices[4] = {&slice[0], &slice[1], &slice[2], &slice[3]};
    for (int i = 0; i < 4; i++)
        slice[i] = (uint16_t)(1000 + 100 * at[i] * at[i]);
    for (double t = 0; t < 1; t += 0.125) {
        const CtsInterpolationWeights w = cts_slice_interpolation_weights(t, (const double[]){2, 3, 1});
        cts_slice_interpolation_row(&between, slices, 1, &w);
        assert_true(fabs(between - (1000 + 100 * pow(2 + 3 * t, 2))) <= 0.51);
    }
}

/* The number of layers per slice is known to code that computes gradients, also in a copy with fewer grey levels. */
static void test_slice_layers(void **state)
{
    CtsError err;
    CtsVolume *v = make(4, 4, 5, 3), *q = NULL;
    assert_int_equal(v->slice_layers, 1);
    assert_int_equal(cts_volume_interpolate(v, 3, CTS_INTERPOLATION_CUBIC, 1, &made, &err), CTS_OK);
    assert_int_equal(v->slice_layers, 3);
    assert_int_equal(cts_volume_quantise(v, 8, 0, 100, 1, &q, &err), CTS_OK);
    assert_int_equal(q->slice_layers, 3);
    cts_volume_free(&v);
    cts_volume_free(&q);
}

static void test_when(void **state)
{
    static const struct {
        double slice_mm;
        int layers;
    } cases[] = {{0.5, 1}, {1.4, 1}, {1.6, 2}, {2.5, 3}, {7, 7}, {70, 8}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsVolume *v = make(4, 4, 4, cases[i].slice_mm);
        v->step_lps[2][1] = 0;
        assert_int_equal(cts_volume_layers_per_slice(v), cases[i].layers);
        cts_volume_free(&v);
    }
    CtsVolume *flat = make(4, 4, 1, 5);
    assert_int_equal(cts_volume_layers_per_slice(flat), 1);
    cts_volume_free(&flat);
}

/* A point becomes the Gaussian, for any spacing; constants and the sum are preserved. */
static void test_smooth(void **state)
{
    CtsError err;
    CtsVolume *v = make(41, 39, 21, 2);
    v->step_lps[2][1] = 0;
    const double sd_mm = 2.5;
    const size_t centre = (10 * 39 + 19) * 41 + 20;
    v->grey[centre] = 60000;
    assert_int_equal(cts_volume_smooth(v, sd_mm, 3, &err), CTS_OK);
    for (int k = 0; k < 21; k++)
        for (int j = 0; j < 39; j++)
            for (int i = 0; i < 41; i++) {
                const double r2 = pow(i - 20, 2) + pow(j - 19, 2) + pow(2 * (k - 10), 2);
                const double expected = 60000 * 2 / pow(sd_mm * sqrt(2 * M_PI), 3) * exp(-r2 / (2 * sd_mm * sd_mm));
                /* Cut at three deviations, and three roundings, each smoothed again. */
                assert_true(fabs(v->grey[(k * 39 + j) * 41 + i] - expected) < 0.015 * 60000 / 122 + 2);
            }
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = 65535;
    assert_int_equal(cts_volume_smooth(v, 0.7, 2, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        assert_int_equal(v->grey[i], 65535);
    assert_int_equal(cts_volume_smooth(v, 21, 2, &err), CTS_ERR_USAGE);
    assert_int_equal(cts_volume_smooth(v, NAN, 2, &err), CTS_ERR_USAGE);
    cts_volume_free(&v);
}

static void test_threads(void **state)
{
    CtsError err;
    CtsVolume *a = make(50, 33, 17, 2.2), *b = make(50, 33, 17, 2.2);
    uint32_t random = 11;
    for (size_t i = 0; i < cts_volume_n_voxels(a); i++)
        a->grey[i] = b->grey[i] = (uint16_t)(next(&random) >> 16);
    assert_int_equal(cts_volume_smooth(a, 1.3, 1, &err), CTS_OK);
    assert_int_equal(cts_volume_smooth(b, 1.3, 7, &err), CTS_OK);
    assert_int_equal(cts_volume_interpolate(a, 3, CTS_INTERPOLATION_CUBIC, 1, &made, &err), CTS_OK);
    assert_int_equal(cts_volume_interpolate(b, 3, CTS_INTERPOLATION_CUBIC, 7, &made, &err), CTS_OK);
    assert_memory_equal(a->grey, b->grey, cts_volume_n_voxels(a) * sizeof *a->grey);
    cts_volume_free(&a);
    cts_volume_free(&b);
}

enum { DISC = 96, DISCS = 4, PARTS = 4 };
static const double growth_vox = 7;

/* A soft disc about (48.3, 47.6), of 40 HU in air, or a ring of 800 HU in 40 HU, whose radius grows from slice to
 * slice. */
static CtsVolume *make_discs(bool rings)
{
    CtsVolume *v = make(DISC, DISC, DISCS, 4);
    for (int k = 0; k < DISCS; k++)
        for (int n = 0; n < DISC * DISC; n++) {
            const double off = hypot(n % DISC - 48.3, n / DISC - 47.6) - 15 - growth_vox * k;
            const double inside = fmin(fmax(0.5 - (rings ? fabs(off) - 5 : off) / 2, 0), 1);
            v->grey[k * DISC * DISC + n] = (uint16_t)(rings ? 1064 + 760 * inside : 24 + 1040 * inside);
        }
    return v;
}

/* Largest distance of the surface in a layer from the disc's radius, along rays from its centre. */
static double worst_radius(const CtsVolume *v, int layer, double level)
{
    double worst = 0;
    for (int ray = 0; ray < 64; ray++) {
        const double x = cos(ray * 0.1), y = sin(ray * 0.1);
        double r = 47;
        for (; r > 0; r -= 0.05) {
            const int i = (int)(48.3 + r * x + 0.5), j = (int)(47.6 + r * y + 0.5);
            if (i >= 0 && j >= 0 && i < DISC && j < DISC && v->grey[(layer * DISC + j) * DISC + i] > level)
                break;
        }
        worst = fmax(worst, fabs(r - 15 - growth_vox * layer / PARTS));
    }
    return worst;
}

/* Between two discs lies a disc, to within a pixel, where blending gives two half discs; the slices are unchanged. */
static void test_shape(void **state)
{
    CtsError err;
    for (int rings = 0; rings < 2; rings++) {
        CtsVolume *before = make_discs(rings), *v = make_discs(rings), *blended = make_discs(rings);
        const double level = rings ? 1464 : 544, edge = rings ? 5 : 0;
        made = (CtsInterpolationCounts){0};
        assert_int_equal(cts_volume_interpolate(v, PARTS, CTS_INTERPOLATION_SHAPE, 2, &made, &err), CTS_OK);
        assert_true(made.n_moved > 1000 && made.n_voxels == (DISCS - 1) * (PARTS - 1) * DISC * DISC);
        assert_true(made.sum_of_differences_hu > 50.0 * (double)made.n_moved && !made.no_memory);
        assert_int_equal(cts_volume_interpolate(blended, PARTS, CTS_INTERPOLATION_CUBIC, 2, &made, &err), CTS_OK);
        for (int layer = 0; layer < v->dims[2]; layer++) {
            if (layer % PARTS == 0)
                assert_memory_equal(v->grey + layer * DISC * DISC, before->grey + layer / PARTS * DISC * DISC,
                                    DISC * DISC * sizeof *v->grey);
            else
                assert_true(worst_radius(v, layer, level) < 1.3 + edge);
            if (layer % PARTS == 1)
                assert_true(worst_radius(blended, layer, level) > 1.3 + edge || rings);
        }
        cts_volume_free(&blended);
        cts_volume_free(&before);
        cts_volume_free(&v);
    }
}

/* Layers of a stack with uneven distances, in a box; NULL: all of them. Free with free(). */
static uint16_t *layers_in_box(const CtsVolume *discs, const int box[2][3])
{
    static const double layer[DISCS] = {0, 3.2, 7, 12};
    CtsShapeStack stack = {.slices = discs->grey,
                           .n_columns = DISC,
                           .n_rows = DISC,
                           .n_slices = DISCS,
                           .end = {DISC, DISC, 13},
                           .layer = layer,
                           .n_parts = 1,
                           .scale = &(CtsVolume){.hu_offset = -1024, .hu_step = 1}};
    for (int axis = 0; box && axis < 3; axis++) {
        stack.low[axis] = box[0][axis];
        stack.end[axis] = box[1][axis];
    }
    size_t n = sizeof *stack.layers;
    for (int axis = 0; axis < 3; axis++)
        n *= (size_t)(stack.end[axis] - stack.low[axis]);
    stack.layers = malloc(n);
    assert_non_null(stack.layers);
    cts_shape_interpolate_layers(&stack, CTS_INTERPOLATION_SHAPE, 2, &made);
    return stack.layers;
}

/* Layers in a box have the grey levels of whole ones, whether a surface moves within it or beside it. */
static void test_box(void **state)
{
    static const int boxes[][2][3] = {{{0, 0, 0}, {DISC, DISC, 13}}, {{8, 16, 2}, {DISC, 71, 11}},
                                      {{16, 24, 4}, {57, 90, 5}},    {{40, 0, 0}, {41, 2, 13}},
                                      {{26, 30, 8}, {90, DISC, 13}}, {{0, 94, 3}, {DISC, DISC, 4}}};
    CtsVolume *discs = make_discs(false);
    made = (CtsInterpolationCounts){0};
    uint16_t *const whole = layers_in_box(discs, NULL);
    assert_true(made.n_moved > 1000);
    for (size_t b = 0; b < sizeof boxes / sizeof *boxes; b++)
        for (int path = 0; path < 3; path++) {
            const int *const low = boxes[b][0], *const end = boxes[b][1];
            cts_cpu_set_mask(path == 0 ? 0 : path == 1 ? CTS_CPU_AVX2 : ~0u);
            uint16_t *const layers = layers_in_box(discs, boxes[b]), *to = layers;
            for (int k = low[2]; k < end[2]; k++)
                for (int j = low[1]; j < end[1]; j++)
                    for (int i = low[0]; i < end[0]; i++, to++)
                        if (*to != whole[(k * DISC + j) * DISC + i])
                            fail_msg("box %zu, SIMD path %d, voxel %d,%d,%d: expected grey %d, actual %d", b, path, i,
                                     j, k, whole[(k * DISC + j) * DISC + i], *to);
            free(layers);
        }
    cts_cpu_set_mask(~0u);
    free(whole);
    cts_volume_free(&discs);
}

/* Static structures, or differences below the noise, are blended as before; threads and SIMD paths change nothing, for
 * any slices. */
static void test_shape_at_rest(void **state)
{
    CtsError err;
    for (int noise = 0; noise <= 90; noise += 90) {
        CtsVolume *a = make_discs(false), *b = make_discs(false);
        uint32_t random = 3;
        for (int n = 0; n < DISCS * DISC * DISC; n++)
            b->grey[n] = a->grey[n] =
                (uint16_t)(a->grey[n % (DISC * DISC)] + (noise ? next(&random) >> 16 : 0) % (uint32_t)(noise + 1));
        made = (CtsInterpolationCounts){0};
        assert_int_equal(cts_volume_interpolate(a, 3, CTS_INTERPOLATION_SHAPE, 1, &made, &err), CTS_OK);
        assert_int_equal(made.n_moved, 0);
        assert_int_equal(cts_volume_interpolate(b, 3, CTS_INTERPOLATION_CUBIC, 1, &made, &err), CTS_OK);
        assert_memory_equal(a->grey, b->grey, cts_volume_n_voxels(a) * sizeof *a->grey);
        cts_volume_free(&a);
        cts_volume_free(&b);
    }
    uint64_t n_moved = 0;
    for (int wide = 1; wide < 130; wide += 13) {
        CtsVolume *a = make(wide, 131 - wide, 5, 3), *b = make(wide, 131 - wide, 5, 3);
        uint32_t random = 11;
        for (int n = 0; n < 5 * wide * (131 - wide); n++) {
            const int x = n % wide, y = n / wide % (131 - wide), k = n / wide / (131 - wide);
            const bool inside = (x - 5 * k) * (x - 5 * k) + (y - 20) * (y - 20) < 400 + 300 * (k % 2);
            a->grey[n] = b->grey[n] = (uint16_t)(n % 53 == 0 ? 65535 : (next(&random) >> 25) + (inside ? 1464 : 0));
        }
        CtsInterpolationCounts plain = {0}, fast = {0};
        cts_cpu_set_mask(0);
        assert_int_equal(cts_volume_interpolate(a, 3, CTS_INTERPOLATION_SHAPE, 1, &plain, &err), CTS_OK);
        cts_cpu_set_mask(wide % 2 ? ~0u : CTS_CPU_AVX2);
        assert_int_equal(cts_volume_interpolate(b, 3, CTS_INTERPOLATION_SHAPE, 7, &fast, &err), CTS_OK);
        assert_true(plain.n_moved == fast.n_moved && plain.sum_of_differences_hu == fast.sum_of_differences_hu);
        n_moved += plain.n_moved;
        assert_memory_equal(a->grey, b->grey, cts_volume_n_voxels(a) * sizeof *a->grey);
        cts_volume_free(&a);
        cts_volume_free(&b);
    }
    cts_cpu_set_mask(~0u);
    assert_true(n_moved > 1000);
}

/* Within rows every distance is the least of the others and the way from there. */
static void test_rows_of_distances(void **state)
{
    enum { MAX_X = 37, MAX_Y = 20 };
    uint32_t random = 5;
    for (int nx = 1; nx <= MAX_X; nx++) {
        const int ny = 1 + nx % MAX_Y, n = nx * ny;
        int16_t before[MAX_X * MAX_Y], d[MAX_X * MAX_Y], columns[MAX_X * SHAPE_ROWS];
        for (int i = 0; i < n; i++)
            d[i] = before[i] = (int16_t)(next(&random) >> 28 ? SHAPE_FAR : next(&random) >> 24);
        cts_shape_reach_rows(d, (const int[2]){nx, ny}, columns);
        for (int i = 0; i < n; i++) {
            int least = SHAPE_FAR;
            for (int j = i / nx * nx; j < i / nx * nx + nx; j++)
                least = before[j] + SHAPE_SIDE * abs(j - i) < least ? before[j] + SHAPE_SIDE * abs(j - i) : least;
            if (d[i] != least)
                fail_msg("block %d of %d x %d: %d, expected %d", i, nx, ny, d[i], least);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layers),        cmocka_unit_test(test_shape),
        cmocka_unit_test(test_shape_at_rest), cmocka_unit_test(test_rows_of_distances),
        cmocka_unit_test(test_parabola),      cmocka_unit_test(test_uneven_parabola),
        cmocka_unit_test(test_slice_layers),  cmocka_unit_test(test_when),
        cmocka_unit_test(test_smooth),        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_box),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
