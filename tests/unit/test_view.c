/* The geometry of ctsplat(1), PICTURES, to half a pixel: the position of a voxel in the picture. */
#include "base/vec3.h"
#include "core/scene/view.h"
#include "unit.h"
#include <string.h>

/* 5 x 7 x 9 voxels of 1 x 2 x 3 mm; the centre lies at (12, 26, 42), the corner voxel (4, 6, 8) at (14, 32, 54). */
static CtsVolume straight_volume(void)
{
    return (CtsVolume){.dims = {5, 7, 9}, .origin_lps = {10, 20, 30}, .step_lps = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}}};
}

static CtsView view_of(const CtsVolume *v, double azimuth, double elevation, int width, int height, double mm)
{
    CtsView view;
    CtsError err;
    const CtsRenderSettings asked = {
        .azimuth_deg = azimuth, .elevation_deg = elevation, .width = width, .height = height, .mm_per_pixel = mm};
    assert_int_equal(cts_view_init(&view, v, &asked, &err), CTS_OK);
    return view;
}

static void assert_vector(const double v[3], double x, double y, double z)
{
    assert_true(fabs(v[0] - x) < 1e-12 && fabs(v[1] - y) < 1e-12 && fabs(v[2] - z) < 1e-12);
}

/* The named views: right, up and forward, exactly, and the corner voxel's pixel in a picture of 101 x 81 pixels of half
 * a millimetre. The centre pixel is (50, 40); calculated by hand from the patient directions. */
static void test_named_views(void **state)
{
    const struct {
        const char *name;
        double azimuth, elevation;
        double right[3], up[3], forward[3];
        double x, y;
        int axis, sign;
    } cases[] = {
        {"anterior", 0, 0, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 54, 16, 1, 1},
        {"left", 90, 0, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, 62, 16, 0, -1},
        {"posterior", 180, 0, {-1, 0, 0}, {0, 0, 1}, {0, -1, 0}, 46, 16, 1, -1},
        {"right", 270, 0, {0, -1, 0}, {0, 0, 1}, {1, 0, 0}, 38, 16, 0, 1},
        {"right", -90, 0, {0, -1, 0}, {0, 0, 1}, {1, 0, 0}, 38, 16, 0, 1},
        {"head", 0, 90, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, 54, 28, 2, -1},
        {"feet", 0, -90, {1, 0, 0}, {0, -1, 0}, {0, 0, 1}, 54, 52, 2, 1},
        {"anterior", 360, 0, {1, 0, 0}, {0, 0, 1}, {0, 1, 0}, 54, 16, 1, 1},
        {"left", -630, 0, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, 62, 16, 0, -1},
    };
    const CtsVolume v = straight_volume();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const CtsView view = view_of(&v, cases[i].azimuth, cases[i].elevation, 101, 81, 0.5);
        for (int c = 0; c < 3; c++) {
            assert_true(view.right_lps[c] == cases[i].right[c]);
            assert_true(view.up_lps[c] == cases[i].up[c]);
            assert_true(view.forward_lps[c] == cases[i].forward[c]);
        }
        double vox[3];
        cts_view_ray(&view, cases[i].x, cases[i].y, vox);
        const double corner[3] = {4, 6, 8}, centre[3] = {2, 3, 4};
        for (int a = 0; a < 3; a++)
            assert_true(vox[a] == (view.forward_vox[a] != 0 ? centre[a] : corner[a]));
        assert_int_equal(view.axis, cases[i].axis);
        assert_int_equal(view.axis_sign, cases[i].sign);
        assert_true(view.layer_mm == view.axis + 1);
    }
}

/* Even sizes put the centre between pixels, at i + 0.5 = W / 2. */
static void test_half_pixels(void **state)
{
    const CtsVolume v = straight_volume();
    const CtsView view = view_of(&v, 0, 0, 100, 80, 0.5);
    double vox[3];
    cts_view_ray(&view, 49.5, 39.5, vox);
    assert_vector(vox, 2, 3, 4);
    cts_view_ray(&view, 0, 0, vox); /* (0.5 - 50) * 0.5 mm left of the centre, (40 - 0.5) * 0.5 mm above it */
    assert_vector(vox, 2 - 24.75, 3, 4 + 19.75 / 3);
    cts_view_ray(&view, 99, 79, vox);
    assert_vector(vox, 2 + 24.75, 3, 4 - 19.75 / 3);
}

/* Azimuth 30 toward the patient's left, elevation 20 toward the head, from sines and cosines by hand. */
static void test_oblique_view(void **state)
{
    const CtsVolume v = straight_volume();
    const CtsView view = view_of(&v, 30, 20, 200, 100, 0.4);
    const double s20 = 0.34202014332566873, c20 = 0.93969262078590838, c30 = 0.86602540378443865;
    assert_vector(view.forward_lps, -0.5 * c20, c30 * c20, -s20);
    assert_vector(view.right_lps, c30, 0.5, 0);
    assert_vector(view.up_lps, -0.5 * s20, c30 * s20, c20);
    /* A ray through a pixel meets every point that projects there. */
    const double p[3] = {14, 20, 54}, d[3] = {2, -6, 12};
    const double u = 2 * c30 - 6 * 0.5, w = -2 * 0.5 * s20 - 6 * c30 * s20 + 12 * c20;
    double vox[3];
    cts_view_ray(&view, u / 0.4 + 100 - 0.5, 50 - 0.5 - w / 0.4, vox);
    const double depth = cts_dot3(d, view.forward_lps);
    for (int a = 0; a < 3; a++)
        vox[a] += depth * view.forward_vox[a];
    assert_vector(vox, (p[0] - 10) / 1, (p[1] - 20) / 2, (p[2] - 30) / 3);
    assert_true(fabs(cts_dot3(view.right_lps, view.up_lps)) < 1e-15);
    assert_true(fabs(cts_norm3(view.forward_lps) - 1) < 1e-15);
}

/* The same body stored along other axes, and sheared by a tilted gantry: the rays meet the same points. */
static void test_other_steps(void **state)
{
    const CtsVolume volumes[] = {
        straight_volume(),
        {.dims = {5, 9, 7}, .origin_lps = {10, 20, 54}, .step_lps = {{1, 0, 0}, {0, 0, -3}, {0, 2, 0}}},
        {.dims = {7, 9, 5}, .origin_lps = {14, 20, 54}, .step_lps = {{0, 2, 0}, {0, 0, -3}, {-1, 0, 0}}},
    };
    for (size_t n = 0; n < sizeof volumes / sizeof *volumes; n++) {
        const CtsVolume *v = &volumes[n];
        const CtsView view = view_of(v, -40, 15, 64, 48, 0);
        assert_vector(view.centre_lps, 12, 26, 42);
        assert_true(fabs(view.mm_per_pixel - sqrt(16 + 144 + 576) / (0.95 * 48)) < 1e-12);
        for (int y = 0; y < 48; y += 11)
            for (int x = 0; x < 64; x += 13) {
                double vox[3], lps[3];
                cts_view_ray(&view, x, y, vox);
                for (int c = 0; c < 3; c++) {
                    lps[c] = v->origin_lps[c] - 12 * (c == 0) - 26 * (c == 1) - 42 * (c == 2);
                    for (int a = 0; a < 3; a++)
                        lps[c] += vox[a] * v->step_lps[a][c];
                }
                assert_true(fabs(cts_dot3(lps, view.right_lps) - (x + 0.5 - 32) * view.mm_per_pixel) < 1e-10);
                assert_true(fabs(cts_dot3(lps, view.up_lps) - (24 - y - 0.5) * view.mm_per_pixel) < 1e-10);
                assert_true(fabs(cts_dot3(lps, view.forward_lps)) < 1e-10);
            }
    }
}

/* The principal axis is the one that the ray crosses fastest, counted in voxels. */
static void test_axis(void **state)
{
    CtsVolume v = straight_volume();
    /* Along x a voxel is 1 mm, along y 2 mm: x wins from atan(1/2) = 26.57 degrees on. */
    assert_int_equal(view_of(&v, 26, 0, 64, 64, 0).axis, 1);
    assert_int_equal(view_of(&v, 27, 0, 64, 64, 0).axis, 0);
    assert_int_equal(view_of(&v, 27, 0, 64, 64, 0).axis_sign, -1);
    assert_int_equal(view_of(&v, -27, 0, 64, 64, 0).axis_sign, 1);
    v.step_lps[1][1] = v.step_lps[2][2] = 1;
    /* Ties go to the later axis, in every quarter. */
    for (int quarter = 0; quarter < 4; quarter++)
        assert_int_equal(view_of(&v, 45 + 90 * quarter, 0, 64, 64, 0).axis, 1);
    assert_int_equal(view_of(&v, 0, 45, 64, 64, 0).axis, 2);
    const CtsView view = view_of(&v, 60, 0, 64, 64, 0);
    assert_true(view.axis == 0 && fabs(view.layer_mm - 1 / 0.86602540378443865) < 1e-12);
    /* A tilted gantry: step 2 leans to the back, but the layers of the anterior view are still rows. */
    v.step_lps[2][1] = 0.6;
    assert_int_equal(view_of(&v, 0, 0, 64, 64, 0).axis, 1);
}

static void test_default_scale(void **state)
{
    const CtsVolume v = straight_volume();
    const double d = sqrt(4 * 4 + 12 * 12 + 24 * 24);
    assert_true(fabs(view_of(&v, 12, 34, 1024, 512, 0).mm_per_pixel - d / (0.95 * 512)) < 1e-12);
    assert_true(fabs(view_of(&v, 12, 34, 300, 800, 0).mm_per_pixel - d / (0.95 * 300)) < 1e-12);
    assert_true(view_of(&v, 12, 34, 300, 800, 0.25).mm_per_pixel == 0.25);
    CtsVolume point = straight_volume();
    point.dims[0] = point.dims[1] = point.dims[2] = 1;
    assert_true(view_of(&point, 0, 0, 10, 10, 0).mm_per_pixel > 0);
}

static void test_flat_volume(void **state)
{
    CtsVolume v = straight_volume();
    CtsView view;
    CtsError err;
    memset(v.step_lps[2], 0, sizeof v.step_lps[2]);
    assert_int_equal(cts_view_init(&view, &v, &(CtsRenderSettings){.width = 64, .height = 64}, &err), CTS_ERR_GEOMETRY);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_named_views), cmocka_unit_test(test_half_pixels), cmocka_unit_test(test_oblique_view),
        cmocka_unit_test(test_other_steps), cmocka_unit_test(test_axis),        cmocka_unit_test(test_default_scale),
        cmocka_unit_test(test_flat_volume),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
