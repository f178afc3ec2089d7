/* An uneven stack becomes an even one in its own memory. */
#include "core/volume/linear_layers.h"
#include "core/volume/shape_interpolation.h"
#include "core/volume/threshold.h"
#include "input/load/load.h"
#include "unit.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Slices of a field that is linear along the stack must give that field at every layer; voxels in a layer differ, and
 * so do neighbours, so that a slice overwritten too early shows. */
static double field(double layer, size_t voxel)
{
    return 100 + 40 * layer + (double)(voxel % 97) * 3;
}

static void check_stack_by(const double *layer, int n_slices, int n_layers, size_t voxels, int threads, bool linear)
{
    const int offset = cts_resample_offset(layer, n_slices, n_layers);
    const int slots = offset + n_slices > n_layers ? offset + n_slices : n_layers;
    uint16_t *grey = malloc((size_t)slots * voxels * sizeof *grey);
    assert_non_null(grey);
    memset(grey, 0xEE, (size_t)slots * voxels * sizeof *grey);
    for (int i = 0; i < n_slices; i++)
        for (size_t v = 0; v < voxels; v++)
            grey[(size_t)(offset + i) * voxels + v] = (uint16_t)lround(field(layer[i], v));
    const CtsResampling resampling = {voxels, layer, n_slices, n_layers, offset, linear};
    cts_resample_stack(grey, &resampling, threads);
    for (int j = 0; j < n_layers; j++)
        for (size_t v = 0; v < voxels; v++)
            if (fabs(grey[(size_t)j * voxels + v] - field(j, v)) > 1.01)
                fail_msg("layer %d of %d, voxel %zu: %d, not %g", j, n_layers, v, grey[(size_t)j * voxels + v],
                         field(j, v));
    assert_true(slots <= n_layers + n_slices + 1);
    free(grey);
}

/* A straight line is one for cubics too. */
static void check_stack(const double *layer, int n_slices, int n_layers, size_t voxels, int threads)
{
    check_stack_by(layer, n_slices, n_layers, voxels, threads, true);
    check_stack_by(layer, n_slices, n_layers, voxels, threads, false);
}

static void test_linear_field(void **state)
{
    const double whole[] = {0, 1, 2, 4, 5, 6, 9};
    const double finer[] = {0, 1.5, 2.75, 4, 7.9, 9};
    const double two[] = {0, 9};
    const double late[] = {0, 39, 39.4, 39.8, 40.2, 40.6, 41, 41.4, 41.8, 42.2, 43}; /* many slices near the end */
    const double early[] = {0, 0.4, 0.8, 1.2, 1.6, 2, 2.4, 2.8, 3.2, 3.6, 43};
    for (int threads = 1; threads <= 3; threads++) {
        check_stack(whole, 7, 10, 5000, threads);
        check_stack(finer, 6, 10, 9001, threads);
        check_stack(two, 2, 10, 31, threads);
        check_stack(late, 11, 44, 4097, threads);
        check_stack(early, 11, 44, 4096, threads);
    }
}

/* Slices elsewhere give the same layers as slices in the memory of the layers. */
static void check_elsewhere(const CtsResampling *r, const uint16_t *slices, const uint16_t *expected)
{
    uint16_t *layers = calloc((size_t)r->n_layers * r->layer_voxels, sizeof *layers);
    CtsInterpolationCounts made = {0};
    assert_non_null(layers);
    cts_shape_interpolate_layers(&(CtsShapeStack){.slices = slices,
                                                  .layers = layers,
                                                  .n_columns = (int)r->layer_voxels,
                                                  .n_rows = 1,
                                                  .n_slices = r->n_slices,
                                                  .end = {(int)r->layer_voxels, 1, r->n_layers},
                                                  .layer = r->layer,
                                                  .n_parts = 1,
                                                  .scale = &(CtsVolume){.hu_step = 1}},
                                 CTS_INTERPOLATION_CUBIC, 3, &made);
    for (size_t i = 0; i < (size_t)r->n_layers * r->layer_voxels; i++)
        if (layers[i] != expected[i])
            fail_msg("layer %zu of %d, voxel %zu: %d, expected %d, of %d slices", i / r->layer_voxels, r->n_layers,
                     i % r->layer_voxels, layers[i], expected[i], r->n_slices);
    free(layers);
}

/* Bits of layers that are not stored are those of stored ones. */
static void check_bits(const CtsResampling *r, const uint16_t *slices, const uint16_t *layers)
{
    const CtsLinearLayers linear = {slices, r->n_slices, r->layer};
    const int dims[3] = {(int)r->layer_voxels, 1, r->n_layers};
    CtsBits stored = {0}, read = {0};
    CtsError err;
    uint64_t n_runs;
    assert_int_equal(cts_bits_new(&stored, dims, &err), CTS_OK);
    assert_int_equal(cts_bits_new(&read, dims, &err), CTS_OK);
    const uint64_t expected = cts_bits_threshold(&stored, layers, 30000, 1);
    assert_int_equal(cts_bits_threshold_layers(&read, &linear, 30000, 2, &n_runs, &err), CTS_OK);
    assert_int_equal(n_runs, expected);
    assert_memory_equal(read.words, stored.words, cts_bits_n_words(&read) * sizeof *read.words);
    for (int k = 0; k < r->n_layers; k++) {
        uint16_t made[3];
        const CtsLinearLayer layer = cts_linear_layer(&linear, r->layer_voxels, k);
        const size_t at = (size_t)k * r->layer_voxels + 7;
        assert_memory_equal(cts_linear_layer_row(&layer, 7, 3, made), layers + at, sizeof made);
    }
    cts_bits_free(&stored);
    cts_bits_free(&read);
}

/* Of any values, cubics stay between those of the two slices around a layer. */
static void check_range(const double *layer, int n_slices, int n_layers)
{
    enum { VOXELS = 133 };
    const int offset = cts_resample_offset(layer, n_slices, n_layers);
    uint16_t *grey = malloc((size_t)(offset + n_slices + n_layers) * VOXELS * sizeof *grey);
    uint16_t *slices = malloc((size_t)n_slices * VOXELS * sizeof *slices);
    assert_true(grey && slices);
    for (int i = 0; i < n_slices * VOXELS; i++)
        slices[i] = (uint16_t)(rand() % 4 ? rand() & 0xffff : 65535 * (rand() & 1));
    memcpy(grey + offset * VOXELS, slices, (size_t)n_slices * VOXELS * sizeof *grey);
    const CtsResampling lines = {VOXELS, layer, n_slices, n_layers, offset, true};
    cts_resample_stack(grey, &lines, 1);
    check_bits(&lines, slices, grey);
    memcpy(grey + offset * VOXELS, slices, (size_t)n_slices * VOXELS * sizeof *grey);
    const CtsResampling resampling = {VOXELS, layer, n_slices, n_layers, offset, false};
    cts_resample_stack(grey, &resampling, 1);
    check_elsewhere(&resampling, slices, grey);
    for (int j = 0, below = 0; j < n_layers; j++) {
        while (below + 2 < n_slices && layer[below + 1] <= j)
            below++;
        for (int v = 0; v < VOXELS; v++) {
            const int a = slices[below * VOXELS + v], b = slices[(below + 1) * VOXELS + v];
            assert_in_range(grey[j * VOXELS + v], a < b ? a : b, a < b ? b : a);
        }
    }
    free(grey);
    free(slices);
}

static void test_random_stacks(void **state)
{
    srand(5);
    for (int round = 0; round < 200; round++) {
        double layer[12];
        const int n = 2 + rand() % 11, n_layers = n + rand() % (3 * n + 1);
        layer[0] = 0;
        for (int i = 1; i < n; i++)
            layer[i] = layer[i - 1] + 0.01 + rand() % 100;
        for (int i = 1; i < n; i++)
            layer[i] *= (n_layers - 1) / layer[n - 1];
        layer[n - 1] = n_layers - 1;
        check_stack_by(layer, n, n_layers, 40, 1, true);
        check_range(layer, n, n_layers);
    }
}

/* Slices on whole layers keep every bit. */
static void test_kept_slices(void **state)
{
    const double layer[] = {0, 1, 3};
    uint16_t grey[6 * 3];
    const int offset = cts_resample_offset(layer, 3, 4);
    assert_int_equal(offset, 2);
    const uint16_t slices[3][3] = {{1, 65535, 0}, {7, 8, 9}, {11, 65535, 4}};
    memcpy(grey + 3 * offset, slices, sizeof slices);
    const CtsResampling resampling = {3, layer, 3, 4, offset, true};
    cts_resample_stack(grey, &resampling, 1);
    const uint16_t wanted[4][3] = {{1, 65535, 0}, {7, 8, 9}, {9, 32772, 7}, {11, 65535, 4}};
    assert_memory_equal(grey, wanted, sizeof wanted);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_linear_field),
        cmocka_unit_test(test_random_stacks),
        cmocka_unit_test(test_kept_slices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
