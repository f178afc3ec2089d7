/* An uneven stack becomes an even one. */
#include "core/volume/linear_layers.h"
#include "core/volume/shape_interpolation.h"
#include "core/volume/threshold.h"
#include "ctsplat/series.h"
#include "unit.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Slices of a field that is linear along the stack must give that field at every layer; voxels in a layer differ, and
 * so do neighbours, so that a wrong slice shows. */
static double field(double layer, size_t voxel)
{
    return 100 + 40 * layer + (double)(voxel % 97) * 3;
}

/* Positions of slices in layers. */
typedef struct Stack {
    const double *layer;
    int n_slices, n_layers;
    size_t voxels; /* of a layer */
} Stack;

static void resample(const Stack *s, const uint16_t *slices, uint16_t *layers, CtsInterpolation how, int threads)
{
    CtsInterpolationCounts made = {0};
    cts_shape_interpolate_layers(&(CtsShapeStack){.slices = slices,
                                                  .layers = layers,
                                                  .n_columns = (int)s->voxels,
                                                  .n_rows = 1,
                                                  .n_slices = s->n_slices,
                                                  .end = {(int)s->voxels, 1, s->n_layers},
                                                  .layer = s->layer,
                                                  .n_parts = 1,
                                                  .scale = &(CtsVolume){.hu_step = 1}},
                                 how, threads, &made);
}

static void check_stack_by(const Stack *s, CtsInterpolation how, int threads)
{
    uint16_t *slices = malloc((size_t)s->n_slices * s->voxels * sizeof *slices);
    uint16_t *layers = malloc((size_t)s->n_layers * s->voxels * sizeof *layers);
    assert_true(slices && layers);
    memset(layers, 0xEE, (size_t)s->n_layers * s->voxels * sizeof *layers);
    for (int i = 0; i < s->n_slices; i++)
        for (size_t v = 0; v < s->voxels; v++)
            slices[(size_t)i * s->voxels + v] = (uint16_t)lround(field(s->layer[i], v));
    resample(s, slices, layers, how, threads);
    for (int j = 0; j < s->n_layers; j++)
        for (size_t v = 0; v < s->voxels; v++)
            if (fabs(layers[(size_t)j * s->voxels + v] - field(j, v)) > 1.01)
                fail_msg("layer %d of %d, voxel %zu: %d, not %g", j, s->n_layers, v, layers[(size_t)j * s->voxels + v],
                         field(j, v));
    free(slices);
    free(layers);
}

/* A straight line is one for cubics too. */
static void check_stack(const double *layer, int n_slices, int n_layers, size_t voxels, int threads)
{
    const Stack stack = {layer, n_slices, n_layers, voxels};
    check_stack_by(&stack, CTS_INTERPOLATION_LINEAR, threads);
    check_stack_by(&stack, CTS_INTERPOLATION_CUBIC, threads);
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

/* Bits of layers that are not stored are those of stored ones. */
static void check_bits(const Stack *r, const uint16_t *slices, const uint16_t *layers)
{
    const CtsLinearLayers linear = {slices, r->n_slices, r->layer};
    const int dims[3] = {(int)r->voxels, 1, r->n_layers};
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
        const CtsLinearLayer layer = cts_linear_layer(&linear, r->voxels, k);
        const size_t at = (size_t)k * r->voxels + 7;
        assert_memory_equal(cts_linear_layer_row(&layer, 7, 3, made), layers + at, sizeof made);
    }
    cts_bits_free(&stored);
    cts_bits_free(&read);
}

/* Of any values, cubics stay between those of the two slices around a layer. */
static void check_range(const double *layer, int n_slices, int n_layers)
{
    enum { VOXELS = 133 };
    const Stack stack = {layer, n_slices, n_layers, VOXELS};
    uint16_t *grey = malloc((size_t)n_layers * VOXELS * sizeof *grey);
    uint16_t *slices = malloc((size_t)n_slices * VOXELS * sizeof *slices);
    assert_true(grey && slices);
    for (int i = 0; i < n_slices * VOXELS; i++)
        slices[i] = (uint16_t)(rand() % 4 ? rand() & 0xffff : 65535 * (rand() & 1));
    resample(&stack, slices, grey, CTS_INTERPOLATION_LINEAR, 1);
    check_bits(&stack, slices, grey);
    resample(&stack, slices, grey, CTS_INTERPOLATION_CUBIC, 3);
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
        check_stack_by(&(Stack){layer, n, n_layers, 40}, CTS_INTERPOLATION_LINEAR, 1);
        check_range(layer, n, n_layers);
    }
}

/* Slices on whole layers keep every bit. */
static void test_kept_slices(void **state)
{
    const double layer[] = {0, 1, 3};
    uint16_t grey[4 * 3];
    const uint16_t slices[3][3] = {{1, 65535, 0}, {7, 8, 9}, {11, 65535, 4}};
    resample(&(Stack){layer, 3, 4, 3}, slices[0], grey, CTS_INTERPOLATION_LINEAR, 1);
    const uint16_t wanted[4][3] = {{1, 65535, 0}, {7, 8, 9}, {9, 32772, 7}, {11, 65535, 4}};
    assert_memory_equal(grey, wanted, sizeof wanted);
}

/* Noise of this standard deviation in soft tissue, beside air and the edges of a block of bone; without soft tissue,
 * and of another quantity, it is not known. */
static void test_noise(void **state)
{
    enum { SIDE = 128, SLICES = 20 };
    uint16_t *const grey = malloc(sizeof(uint16_t[SLICES][SIDE][SIDE]));
    assert_non_null(grey);
    CtsVolume even = {.dims = {SIDE, SIDE, SLICES}, .grey = grey, .hu_offset = -1024, .hu_step = 0.5};
    const CtsScanned scanned = {.n_slices = SLICES, .even = &even};
    for (double sd = 0; sd <= 60; sd += 20) {
        uint64_t random = 5;
        for (size_t i = 0; i < (size_t)SLICES * SIDE * SIDE; i++) {
            const size_t x = i % SIDE, y = i / SIDE % SIDE;
            double sum = 0; /* of 12 numbers of 0 to 1: nearly normal */
            for (int k = 0; k < 12; k++) {
                random = random * 6364136223846793005u + 1442695040888963407u;
                sum += (double)(random >> 40) / (1 << 24);
            }
            const double hu = x < 40 ? -1000 : x > 80 && x < 100 && y > 50 && y < 70 ? 700 : 45;
            grey[i] = (uint16_t)lround((hu + sd * (sum - 6) + 1024) / even.hu_step);
        }
        const double found = cts_scanned_noise_hu(&scanned);
        if (fabs(found - sd) > 1 + 0.05 * sd)
            fail_msg("noise of %g HU: found %g", sd, found);
    }
    even.quantity = CTS_QUANTITY_STORED;
    assert_true(cts_scanned_noise_hu(&scanned) == 0);
    even.quantity = CTS_QUANTITY_HU;
    even.hu_offset = -2000;
    assert_true(cts_scanned_noise_hu(&scanned) == 0);
    free(grey);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_linear_field),
        cmocka_unit_test(test_random_stacks),
        cmocka_unit_test(test_kept_slices),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
