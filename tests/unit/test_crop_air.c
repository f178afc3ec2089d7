/* Crop of the air that table removal leaves around a patient: the box that is kept, and pictures that stay the same but
 * for rounding. Truth are the pictures of the uncropped volume. */
#include "unit.h"

#include "core/model/body_mask.h"
#include "ctsplat/ctsplat.h"
#include "ctsplat/table.h"
#include "render/framing/framing.h"
#include <math.h>
#include <string.h>

enum { NX = 120, NY = 104, NZ = 30, SIZE = 64, N_PARTS = 2 };
/* Blocks of the field of occlusion have 3 voxels, of which 8 are no multiple. */
static const double STEP_MM = 0.9, SLICE_MM = 2;

/* HU of a trunk with a spine, off the middle of the field of view, on a table; x and y in voxels. */
static double trunk_on_table(double x, double y)
{
    const double r = hypot((x - 47) / 25, (y - 41) / 20), spine = hypot(x - 47, y - 52);
    if (r < 1.05)
        return spine < 5 ? 700 - 60 * spine : fmin(40, 40 + (1 - r) * 10000);
    return fabs(y - 77) < 2 ? 100 : -1000;
}

static CtsModel model_with_table(void)
{
    CtsModel model = {0};
    CtsError err = {0};
    assert_int_equal(cts_volume_new(&model.volume, NX, NY, NZ, &err), CTS_OK);
    for (int a = 0; a < 3; a++)
        model.volume->step_lps[a][a] = a < 2 ? STEP_MM : SLICE_MM;
    model.volume->origin_lps[0] = -31.25;
    for (int k = 0, at = 0; k < NZ; k++)
        for (int j = 0; j < NY; j++)
            for (int i = 0; i < NX; i++, at++)
                model.volume->grey[at] = (uint16_t)lround(fmax(trunk_on_table(i, j), -1024) + 1024);
    return model;
}

static CtsModel model_without_table(void)
{
    CtsModel model = model_with_table();
    CtsError err = {0};
    if (cts_model_remove_table(&model, true, 2, NULL, &err))
        fail_msg("%s", err.text);
    assert_non_null(model.body);
    return model;
}

static CtsModel with_layers(bool is_cropped)
{
    CtsModel model = model_without_table();
    CtsInterpolationCounts made = {0};
    CtsError err = {0};
    if (is_cropped)
        cts_model_crop_air(&model);
    assert_int_equal(cts_model_interpolate(&model, N_PARTS, CTS_INTERPOLATION_SHAPE, 1, &made, &err), CTS_OK);
    return model;
}

/* All voxels above grey 0 are in the box, at their places; centre, diagonal and box of the volume stay. */
static void test_box(void **state)
{
    CtsModel whole = model_without_table(), cropped = model_without_table();
    cts_model_crop_air(&cropped);
    const CtsVolume *const a = whole.volume, *const b = cropped.volume;
    uint64_t n[2] = {0, 0};
    assert_true(cts_volume_n_voxels(b) < 3 * cts_volume_n_voxels(a) / 4);
    for (int axis = 0; axis < 3; axis++)
        assert_int_equal(cts_volume_extent(b, axis), a->dims[axis]);
    for (int k = 0, at = 0; k < b->dims[2]; k++)
        for (int j = 0; j < b->dims[1]; j++)
            for (int i = 0; i < b->dims[0]; i++, at++) {
                const int from = ((k + b->air_before[2]) * NY + j + b->air_before[1]) * NX + i + b->air_before[0];
                if (b->grey[at] != a->grey[from])
                    fail_msg("voxel %d,%d,%d: expected grey %d, actual %d", i, j, k, a->grey[from], b->grey[at]);
                n[1] += b->grey[at] > 0;
            }
    for (int i = 0; i < NX * NY * NZ; i++)
        n[0] += a->grey[i] > 0;
    assert_int_equal(n[0], n[1]);
    double low[2][3], high[2][3], centre[2][3];
    for (int v = 0; v < 2; v++) {
        cts_volume_box_lps(v ? b : a, low[v], high[v]);
        cts_volume_centre_lps(v ? b : a, centre[v]);
    }
    for (int c = 0; c < 3; c++)
        if (fabs(low[0][c] - low[1][c]) > 1e-9 || fabs(high[0][c] - high[1][c]) > 1e-9 ||
            fabs(centre[0][c] - centre[1][c]) > 1e-9)
            fail_msg("axis %d: box %g to %g, centre %g; cropped %g to %g, centre %g", c, low[0][c], high[0][c],
                     centre[0][c], low[1][c], high[1][c], centre[1][c]);
    uint64_t *count[2];
    CtsError err = {0};
    for (int v = 0; v < 2; v++)
        assert_int_equal(cts_volume_histogram(v ? b : a, 2, &count[v], &err), CTS_OK);
    for (int g = 0; g < 65536; g++)
        if (count[0][g] != count[1][g])
            fail_msg("grey %d: expected %d voxels, actual %d", g, (int)count[0][g], (int)count[1][g]);
    for (int v = 0; v < 2; v++)
        cts_volume_histogram_free(&count[v]);
    assert_true(fabs(cts_volume_diagonal_mm(a) - cts_volume_diagonal_mm(b)) < 1e-9);
    cts_model_free(&whole);
    cts_model_free(&cropped);
}

/* Slices of the trunk at uneven distances, for N_LAYERS layers. */
enum { N_SLICES = 12, N_LAYERS = 38 };

static CtsScanned scan_of_trunk(double layer[N_SLICES])
{
    CtsScanned scanned = {.n_slices = N_SLICES, .layer = layer};
    CtsError err = {0};
    assert_int_equal(cts_volume_new(&scanned.even, NX, NY, N_LAYERS, &err), CTS_OK);
    for (int a = 0; a < 3; a++)
        scanned.even->step_lps[a][a] = a < 2 ? STEP_MM : SLICE_MM;
    uint16_t *to = scanned.even->grey;
    for (int k = 0; k < N_SLICES; k++) {
        layer[k] = k + 1 < N_SLICES ? 3.4 * k - 0.3 * (k % 3) : N_LAYERS - 1;
        for (int j = 0; j < NY; j++)
            for (int i = 0; i < NX; i++)
                *to++ = (uint16_t)lround(fmax(trunk_on_table(i + 0.9 * layer[k] - 15, j), -1024) + 1024);
    }
    return scanned;
}

/* The model with the scanner's axis along columns (0) or rows (1) of the volume. */
static CtsModel along_axis(int head)
{
    CtsModel model = {0}, whole = model_with_table();
    CtsError err = {0};
    const int dims[3] = {head == 0 ? NZ : NX, head == 0 ? NX : NZ, NY};
    assert_int_equal(cts_volume_new(&model.volume, dims[0], dims[1], dims[2], &err), CTS_OK);
    memset(model.volume->step_lps, 0, sizeof model.volume->step_lps);
    model.volume->step_lps[head][2] = SLICE_MM;
    model.volume->step_lps[1 - head][0] = STEP_MM;
    model.volume->step_lps[2][1] = STEP_MM;
    for (int z = 0, at = 0; z < NZ; z++)
        for (int y = 0; y < NY; y++)
            for (int x = 0; x < NX; x++, at++)
                model.volume->grey[(y * dims[1] + (head == 0 ? x : z)) * dims[0] + (head == 0 ? z : x)] =
                    whole.volume->grey[at];
    cts_model_free(&whole);
    return model;
}

/* The same box of the same volume. */
static void expect_same(const CtsModel models[2])
{
    const CtsVolume *const a = models[0].volume, *const b = models[1].volume;
    assert_memory_equal(a->dims, b->dims, sizeof a->dims);
    assert_memory_equal(a->air_before, b->air_before, sizeof a->air_before);
    assert_memory_equal(a->air_behind, b->air_behind, sizeof a->air_behind);
    assert_memory_equal(models[0].body->first, models[1].body->first, sizeof models[0].body->first);
    for (int c = 0; c < 3; c++)
        assert_true(fabs(a->origin_lps[c] - b->origin_lps[c]) < 1e-9);
    for (size_t i = 0; i < cts_volume_n_voxels(a); i++)
        if (a->grey[i] != b->grey[i])
            fail_msg("voxel %zu of %d x %d x %d: expected grey %d, actual %d", i, a->dims[0], a->dims[1], a->dims[2],
                     a->grey[i], b->grey[i]);
}

/* Clearing and cropping in one pass is clearing, then cropping: also where the scanner's axis runs along rows or
 * columns. */
static void test_crop_of_table(void **state)
{
    for (int head = 0; head < 3; head++) {
        CtsModel models[2];
        for (int at_once = 0; at_once < 2; at_once++) {
            CtsModel *const model = &models[at_once];
            CtsTableSearch *found;
            CtsError err = {0};
            *model = head == 2 ? model_with_table() : along_axis(head);
            assert_int_equal(cts_table_search(model->volume, NULL, true, 2, &found, NULL, &err), CTS_OK);
            if (at_once)
                cts_table_crop(found, model);
            else
                cts_table_clear(found, model, NULL);
            cts_table_search_free(&found);
            assert_true((model->volume->dims[0] < (head == 0 ? NZ : NX)) == (at_once && head > 0));
            cts_model_crop_air(model);
        }
        expect_same(models);
        cts_model_free(&models[0]);
        cts_model_free(&models[1]);
    }
}

/* Layers made only where the table search keeps voxels, and whole layers that are cleared and cropped, are the same. */
static void test_layers_in_box(void **state)
{
    CtsModel models[2] = {{0}};
    for (int in_box = 0; in_box < 2; in_box++) {
        double layer[N_SLICES];
        CtsScanned scanned = scan_of_trunk(layer);
        const CtsLinearLayers linear = cts_scanned_linear_layers(&scanned);
        CtsInterpolationCounts made = {0};
        CtsTableSearch *found;
        CtsError err = {0};
        CtsModel *const model = &models[in_box];
        int low[3], high[3];
        assert_int_equal(cts_table_search(scanned.even, &linear, true, 2, &found, NULL, &err), CTS_OK);
        cts_table_kept_box(found, scanned.even, low, high);
        assert_true(high[0] - low[0] < NX - 8 && high[1] - low[1] < NY - 8);
        if (in_box)
            assert_int_equal(
                cts_scanned_box(&scanned, CTS_INTERPOLATION_SHAPE, low, high, false, 2, &model->volume, &made, &err),
                CTS_OK);
        else
            assert_int_equal(
                cts_scanned_volume(&scanned, CTS_INTERPOLATION_SHAPE, false, 2, &model->volume, &made, &err), CTS_OK);
        assert_true(made.n_moved > 0);
        cts_table_clear(found, model, NULL);
        cts_table_search_free(&found);
        cts_model_crop_air(model);
        cts_volume_free(&scanned.even);
    }
    expect_same(models);
    cts_model_free(&models[0]);
    cts_model_free(&models[1]);
}

/* Air alone, and voxels up to all faces, stay as they are. */
static void test_nothing_to_crop(void **state)
{
    for (int full = 0; full < 2; full++) {
        CtsVolume *v = NULL;
        CtsError err = {0};
        int first[3];
        assert_int_equal(cts_volume_new(&v, 40, 30, 20, &err), CTS_OK);
        v->grey[0] = v->grey[40 * 30 * 20 - 1] = full ? 1000 : 0;
        cts_volume_crop_air(v, first);
        for (int a = 0; a < 3; a++)
            assert_true(first[a] == 0 && v->air_before[a] == 0 && v->air_behind[a] == 0);
        assert_true(v->dims[0] == 40 && v->dims[1] == 30 && v->dims[2] == 20);
        cts_volume_free(&v);
    }
}

static CtsPicture *render(const CtsModel *model, const char *preset_name, CtsEngineId engine, double azimuth_deg,
                          double elevation_deg, const CtsPreset **used)
{
    static CtsPreset preset;
    CtsPicture *picture = NULL;
    CtsError err = {0};
    CtsRenderSettings s;
    assert_int_equal(cts_preset_load(preset_name, &preset, &err), CTS_OK);
    cts_render_defaults(&s);
    s.width = s.height = SIZE;
    s.fit = CTS_FIT_VISIBLE;
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    s.engine = engine;
    s.level = engine == CTS_ENGINE_SHEETS ? CTS_LEVEL_SHEETS : CTS_LEVEL_AUTO;
    s.max_error = engine == CTS_ENGINE_SHEETS ? 100 : 0;
    s.want_depth = preset.mode == CTS_MODE_COMPOSITE;
    s.slab_mm = preset.mode == CTS_MODE_COMPOSITE ? 0 : 60;
    assert_true(cts_render_ignores_air(&preset, &s));
    if (cts_framing_settle(model, &preset, &s, &err) || cts_render(model, &preset, &s, &picture, NULL, &err))
        fail_msg("%s", err.text);
    *used = &preset;
    return picture;
}

/* Frame, light, the field of occlusion, the inside of the body and a slab have their places in the whole volume. */
static void test_same_pictures(void **state)
{
    static const struct {
        const char *preset;
        CtsEngineId engine;
        double azimuth_deg, elevation_deg;
    } cases[] = {{"skin", CTS_ENGINE_TILED, 0, 0},    {"skin", CTS_ENGINE_SHEETS, 30, 20},
                 {"bone", CTS_ENGINE_TILED, 120, 35}, {"bone", CTS_ENGINE_SHEETS, 90, 0},
                 {"abdomen", CTS_ENGINE_TILED, 0, 0}, {"lung-window", CTS_ENGINE_TILED, 40, 10}};
    CtsModel whole = with_layers(false), cropped = with_layers(true);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const CtsPreset *preset;
        CtsPicture *picture[2];
        CtsDifference d;
        CtsError err = {0};
        for (int c = 0; c < 2; c++)
            picture[c] = render(c ? &cropped : &whole, cases[i].preset, cases[i].engine, cases[i].azimuth_deg,
                                cases[i].elevation_deg, &preset);
        assert_int_equal(cts_picture_compare(picture[0], picture[1], &d, &err), CTS_OK);
        const CtsPictureInfo *const a = &picture[0]->info, *const b = &picture[1]->info;
        double seen = 0, depth_mm = 0;
        for (int at = 0; at < SIZE * SIZE; at++) {
            seen += picture[0]->pixels[4 * at + 3];
            if (preset->mode == CTS_MODE_COMPOSITE && isfinite(picture[0]->depth_mm[at]))
                depth_mm = fmax(depth_mm, fabs(picture[0]->depth_mm[at] - picture[1]->depth_mm[at]));
        }
        /* Rounding of a position by 1e-5 voxels changes the steepest edge here, 1000 HU a voxel, by 0.01 HU. */
        if (!(seen > SIZE) || d.rmse > 1e-4 || d.max > 0.01 || depth_mm > 0.01 ||
            fabs(a->mm_per_pixel - b->mm_per_pixel) > 1e-9 || fabs(a->camera_mm - b->camera_mm) > 1e-9)
            fail_msg("%s from %g,%g: expected the same picture, actual difference rms %g, largest %g, depth %g mm; %g "
                     "and %g mm per pixel, camera at %g and %g mm; %g pixels seen",
                     cases[i].preset, cases[i].azimuth_deg, cases[i].elevation_deg, d.rmse, d.max, depth_mm,
                     a->mm_per_pixel, b->mm_per_pixel, a->camera_mm, b->camera_mm, seen);
        for (int c = 0; c < 2; c++)
            cts_picture_free(&picture[c]);
    }
    cts_model_free(&whole);
    cts_model_free(&cropped);
}

/* The paper's engines and the reference have all voxels; air that a preset shows, and that mip shows black, stays. */
static void test_needs_air(void **state)
{
    CtsRenderSettings s;
    CtsPreset preset;
    CtsError err = {0};
    assert_int_equal(cts_preset_load("skin", &preset, &err), CTS_OK);
    for (CtsEngineId engine = 0; engine <= CTS_ENGINE_AUTO; engine++) {
        const bool crops = engine == CTS_ENGINE_AUTO || engine == CTS_ENGINE_SHEETS || engine == CTS_ENGINE_TILED;
        cts_render_defaults(&s);
        s.engine = engine;
        if (cts_render_ignores_air(&preset, &s) != crops)
            fail_msg("engine %d: expected %d", engine, crops);
    }
    cts_render_defaults(&s);
    s.mode = CTS_MODE_MIP;
    assert_false(cts_render_ignores_air(&preset, &s));
    s.mode = -1;
    s.grey_bits = 12;
    assert_false(cts_render_ignores_air(&preset, &s));
    s.grey_bits = 16;
    preset.n_opacity = 1;
    preset.opacity[0] = (CtsOpacityPoint){-1000, 0.5};
    assert_false(cts_render_ignores_air(&preset, &s));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_box),           cmocka_unit_test(test_layers_in_box),
        cmocka_unit_test(test_crop_of_table), cmocka_unit_test(test_nothing_to_crop),
        cmocka_unit_test(test_same_pictures), cmocka_unit_test(test_needs_air),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
