/* The frame around the visible part: its extent by formula, and the resulting picture. */
#include "base/vec3.h"
#include "core/scene/view.h"
#include "render/framing/framing.h"
#include "scenes.h"

enum { SIDE = 61 };
static const double middle_vox[3] = {21.5, 33, 38}, radius_vox = 14;

/* A ball of 500 HU away from the volume's middle, in air, on a sheared lattice; its border is as sharp as it gets. */
static CtsVolume *make_ball(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, SIDE, SIDE, SIDE, &err), CTS_OK);
    for (int k = 0; k < SIDE; k++)
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++) {
                const double d[3] = {i - middle_vox[0], j - middle_vox[1], k - middle_vox[2]};
                v->grey[(k * SIDE + j) * SIDE + i] = cts_norm3(d) <= radius_vox ? 1524 : 0;
            }
    return v;
}

/* The edges of a cube, a voxel thick: all that is visible are outlines around nothing. */
static CtsVolume *make_cage(void)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, SIDE, SIDE, SIDE, &err), CTS_OK);
    for (int k = 10; k <= 50; k++)
        for (int j = 10; j <= 50; j++)
            for (int i = 10; i <= 50; i++)
                v->grey[(k * SIDE + j) * SIDE + i] = (i % 40 == 10) + (j % 40 == 10) + (k % 40 == 10) > 1 ? 1524 : 0;
    return v;
}

static CtsPreset preset_above(double hu)
{
    CtsPreset p = *cts_preset_builtin(0);
    p.mode = CTS_MODE_COMPOSITE;
    p.shade = false;
    p.n_opacity = 2;
    p.opacity[0] = (CtsOpacityPoint){hu, 0};
    p.opacity[1] = (CtsOpacityPoint){hu, 0.5};
    return p;
}

static CtsRenderSettings settings_of(CtsEngineId engine, double azimuth_deg, double elevation_deg)
{
    CtsRenderSettings s;
    cts_render_defaults(&s);
    s.width = 200;
    s.height = 260;
    s.fit = CTS_FIT_VISIBLE;
    s.engine = engine;
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    return s;
}

/* The frame of a picture by these settings. */
static CtsRenderSettings framed(const CtsVolume *v, const CtsPreset *p, const CtsRenderSettings *settings)
{
    CtsRenderSettings s = *settings;
    CtsError err;
    assert_int_equal(cts_framing_settle(MODEL_OF(v), p, &s, &err), CTS_OK);
    return s;
}

static double width_mm(const CtsRenderSettings *s)
{
    return 0.9 * s->mm_per_pixel * s->width;
}

static double width_framed_mm(const CtsVolume *v, const CtsPreset *p, const CtsRenderSettings *settings)
{
    const CtsRenderSettings s = framed(v, p, settings);
    return width_mm(&s);
}

/* On a sheared lattice: as wide as the visible voxels lie apart, and up to a voxel more on either side; a ray's
 * distance off. */
static void check_ends(CtsVolume *v)
{
    v->step_lps[1][2] = 0.3;
    v->step_lps[2][2] = 2;
    v->origin_lps[0] = -50;
    const CtsPreset p = preset_above(200);
    for (int i = 0; i < 12; i++) {
        CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 70 * i, 10 * i - 60);
        s.height = 9999;
        s = framed(v, &p, &s);
        CtsViewAxes axes;
        double low = INFINITY, high = -INFINITY, voxel_mm = 0;
        cts_view_axes(&axes, s.azimuth_deg, s.elevation_deg);
        for (int n = 0; n < SIDE * SIDE * SIDE; n++) {
            const double vox[3] = {n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE};
            double at = cts_dot3(v->origin_lps, axes.right_lps);
            for (int axis = 0; axis < 3; axis++)
                at += vox[axis] * cts_dot3(v->step_lps[axis], axes.right_lps);
            low = v->grey[n] ? fmin(low, at) : low;
            high = v->grey[n] ? fmax(high, at) : high;
        }
        for (int axis = 0; axis < 3; axis++)
            voxel_mm += fabs(cts_dot3(v->step_lps[axis], axes.right_lps));
        const double ray_mm = 2 * width_mm(&s) / 64;
        assert_true(width_mm(&s) > high - low - ray_mm && width_mm(&s) < high - low + 2 * voxel_mm + ray_mm);
        assert_true(fabs(cts_dot3(s.centre_lps, axes.right_lps) - (low + high) / 2) < ray_mm);
    }
    cts_volume_free(&v);
}

static void test_ends(void **state)
{
    check_ends(make_ball());
    check_ends(make_cage());
}

/* From the front, haze of the whole volume: the frame holds the ball alone while a ray loses less than 1/16 in it, and
 * everything from there on; without the ball it holds the haze. */
static void test_haze(void **state)
{
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0);
    for (int i = 0; i < 3; i++) {
        CtsVolume *v = make_ball();
        CtsPreset p = preset_above(200);
        const double opacity = 1 - pow(15.0 / 16, (i == 1 ? 1.1 : 0.9) / (SIDE - 1));
        p.n_opacity = 4;
        memcpy(p.opacity, (CtsOpacityPoint[]){{-1000, 0}, {-1000, opacity}, {200, opacity}, {200, 0.5}},
               4 * sizeof *p.opacity);
        for (int n = 0; n < SIDE * SIDE * SIDE; n++)
            v->grey[n] = v->grey[n] && i < 2 ? v->grey[n] : 124;
        const CtsRenderSettings f = framed(v, &p, &s);
        if (i == 0)
            assert_true(fabs(width_mm(&f) - 27.4) < 0.5);
        else
            assert_true(fabs(width_mm(&f) - (SIDE - 1)) < 1);
        cts_volume_free(&v);
    }
}

/* The visible area of a voxel far from the ball is less than 0.1 % of the ball's, that of 5 x 5 more. From the first of
 * the ball's voxels to its last are 27 mm, and a fifth of a voxel on either side is still visible. */
static void test_specks(void **state)
{
    const CtsPreset p = preset_above(200);
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0);
    for (int side = 1; side <= 5; side += 4) {
        CtsVolume *v = make_ball();
        for (int i = 0; i < side; i++)
            for (int k = 0; k < side; k++)
                v->grey[((50 + k) * SIDE + 30) * SIDE + 50 + i] = side == 1 ? 1250 : 1524;
        const CtsRenderSettings f = framed(v, &p, &s);
        assert_true(fabs(width_mm(&f) - (side == 1 ? 27.4 : 46.4)) < 0.8);
        cts_volume_free(&v);
    }
}

/* From the front, a small part beside the ball of 0.24 % of its visible area, with an opacity of 0.09 as what is left
 * of a head holder beside a skull: a speck by its weight of 0.02 %. As opaque as the ball it is framed. */
static void test_faint_specks(void **state)
{
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0);
    static const uint16_t greys[] = {0, 1124, 1524};
    double width[3];
    CtsPreset p = preset_above(200);
    p.n_opacity = 4;
    memcpy(p.opacity, (CtsOpacityPoint[]){{0, 0}, {1, 0.04}, {200, 0.04}, {201, 0.9}}, 4 * sizeof *p.opacity);
    for (int n = 0; n < 3; n++) {
        CtsVolume *v = make_ball();
        for (int k = 0; k < 2; k++)
            for (int j = 0; j < 3; j++)
                for (int i = 0; i < 2; i++)
                    v->grey[((50 + k) * SIDE + 29 + j) * SIDE + 50 + i] = greys[n];
        width[n] = width_framed_mm(v, &p, &s);
        cts_volume_free(&v);
    }
    if (fabs(width[1] - width[0]) > 0.01 || width[2] < width[0] + 10)
        fail_msg("width without part %.2f mm, with a faint one expected as wide, actual %.2f, with an opaque one "
                 "expected 10 mm more, actual %.2f",
                 width[0], width[1], width[2]);
}

/* In a small visible area one ray is no measure of a speck: many specks of a hundredth of a voxel's area around a small
 * block. */
static void test_small_specks(void **state)
{
    const CtsPreset p = preset_above(200);
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0);
    CtsVolume *v = make_ball();
    for (int n = 0; n < SIDE * SIDE * SIDE; n++) {
        const int i = n % SIDE, j = n / SIDE % SIDE, k = n / SIDE / SIDE;
        const bool block = abs(i - 30) <= 4 && abs(j - 30) <= 4 && abs(k - 30) <= 4;
        v->grey[n] = block ? 1524 : i % 7 == 2 && j == 30 && k % 7 == 2 ? 1470 : 0;
    }
    assert_true(fabs(width_framed_mm(v, &p, &s) - 8.4) < 0.5);
    cts_volume_free(&v);
}

/* Layers thinner than the distance of rays in a probe rendering of the whole are framed from the side too, at any
 * position. */
static void test_thin(void **state)
{
    CtsVolume *v = make_ball();
    const CtsPreset p = preset_above(200);
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 90, 0);
    memcpy(v->grey, v->grey + 38 * SIDE * SIDE, sizeof(uint16_t) * 2 * SIDE * SIDE);
    v->dims[2] = 2;
    v->step_lps[2][2] = 0.05;
    assert_true(fabs(width_framed_mm(v, &p, &s) - 26.4) < 1);
    cts_volume_free(&v);
}

/* A small object in a large, potentially visible volume is probed again at a finer scale. */
static void test_small(void **state)
{
    CtsVolume *v = make_ball();
    CtsPreset p = preset_above(200);
    p.n_opacity = 4;
    memcpy(p.opacity, (CtsOpacityPoint[]){{-1100, 1e-7}, {200, 1e-7}, {200, 0.9}, {300, 0.9}}, 4 * sizeof *p.opacity);
    for (int n = 0; n < SIDE * SIDE * SIDE; n++)
        v->grey[n] = 0;
    for (int n = 0; n < 27; n++)
        v->grey[((20 + n / 9) * SIDE + 20 + n / 3 % 3) * SIDE + 40 + n % 3] = 1524;
    const CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0), f = framed(v, &p, &s);
    assert_true(fabs(width_mm(&f) - 2.4) < 0.3);
    cts_volume_free(&v);
}

/* A slab in front of the ball's middle is framed by the disc that it cuts out, from the front, oblique, and in a
 * rotation by the widest of them. */
static void test_slab(void **state)
{
    CtsVolume *v = make_ball();
    const CtsPreset p = preset_above(200);
    CtsRenderSettings s;
    cts_render_defaults(&s);
    s.fit = CTS_FIT_VISIBLE;
    s.width = s.height = 100;
    const double views[][2] = {{0, 0}, {30, 20}, {90, 0}};
    for (int i = 0; i < 3; i++) {
        CtsViewAxes axes;
        double from_ball[3];
        cts_volume_centre_lps(v, from_ball);
        for (int c = 0; c < 3; c++)
            from_ball[c] -= middle_vox[c];
        s.azimuth_deg = views[i][0];
        s.elevation_deg = views[i][1];
        cts_view_axes(&axes, s.azimuth_deg, s.elevation_deg);
        for (int off = 0; off <= 10; off += 5) {
            CtsRenderSettings slab = s;
            slab.slab_mm = 0.1;
            slab.slab_at_mm = cts_dot3(from_ball, axes.forward_lps) + off;
            slab = framed(v, &p, &slab);
            /* Cells between voxels count whole: a voxel more at most, the nearer side of the disc's plane too. */
            const double radius_mm = 0.9 * 50 * slab.mm_per_pixel;
            assert_true(radius_mm > sqrt(13.5 * 13.5 - off * off) - 0.5 &&
                        radius_mm < sqrt(16 * 16 - (off - 1) * (off - 1)));
        }
        CtsRenderSettings far = s, whole = s, turned = s;
        far.slab_mm = 1;
        far.slab_at_mm = 1e4;
        far = framed(v, &p, &far);
        assert_true(far.mm_per_pixel == 0 && !far.centre_given);
        whole.rotation_frames = turned.rotation_frames = 5;
        turned.slab_mm = 1;
        turned.slab_at_mm = 20;
        whole = framed(v, &p, &whole);
        turned = framed(v, &p, &turned);
        assert_true(turned.mm_per_pixel > 0 && turned.mm_per_pixel < whole.mm_per_pixel);
    }
    cts_volume_free(&v);
}

/* The rows and columns of a picture that are not empty. */
static void bounds_of(const CtsPicture *p, int box[4])
{
    memcpy(box, (int[]){p->width, -1, p->height, -1}, 4 * sizeof *box);
    for (int y = 0; y < p->height; y++)
        for (int x = 0; x < p->width; x++)
            if (p->pixels[4 * (y * p->width + x) + 3] > 0.002f) {
                box[0] = x < box[0] ? x : box[0];
                box[1] = x > box[1] ? x : box[1];
                box[2] = y < box[2] ? y : box[2];
                box[3] = y > box[3] ? y : box[3];
            }
}

/* In every engine the ball fills 90 % of the width, in the middle; the reference and the depth mean the same place. */
static void test_pictures(void **state)
{
    CtsVolume *v = make_ball();
    const CtsPreset p = preset_above(200);
    const CtsEngineId engines[] = {CTS_ENGINE_TILED, CTS_ENGINE_COMBINED, CTS_ENGINE_RAYCAST};
    for (int i = 0; i < 6; i++) {
        CtsRenderSettings s = settings_of(engines[i % 3], i < 3 ? 0 : 35, i < 3 ? 0 : 20);
        CtsPicture *picture = NULL;
        CtsError err;
        int box[4];
        s.verify = 1000;
        CtsReport report = {0};
        assert_int_equal(cts_render(MODEL_OF(v), &p, &s, &picture, &report, &err), CTS_OK);
        bounds_of(picture, box);
        assert_in_range(box[1] - box[0] + 1, 160, 182);
        assert_in_range(box[0] + box[1], 195, 203);
        assert_in_range(box[2] + box[3], 255, 263);
        assert_true(report.verified.pixels > 0 && report.verified.rmse < 0.04);
        cts_report_free(&report);
        cts_picture_free(&picture);
    }
    cts_volume_free(&v);
}

/* One scale for all frames, nothing cut, and the ball keeps its place: it is round, and on the axis. */
static void test_rotation(void **state)
{
    CtsVolume *v = make_ball();
    const CtsPreset p = preset_above(200);
    CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 10, 15);
    CtsRenderer *renderer = NULL;
    CtsError err;
    double mm_per_pixel = 0;
    s.rotation_frames = 5;
    assert_int_equal(cts_render_begin(&renderer, MODEL_OF(v), &p, &s, &err), CTS_OK);
    for (int i = 0; i < 5; i++) {
        CtsPicture *picture = NULL;
        int box[4];
        assert_int_equal(cts_render_frame(renderer, 10 + 72 * i, 15, &picture, NULL, &err), CTS_OK);
        bounds_of(picture, box);
        assert_in_range(box[1] - box[0] + 1, 160, 182);
        assert_in_range(box[0] + box[1], 195, 203);
        assert_in_range(box[2] + box[3], 255, 263);
        assert_true(mm_per_pixel == 0 || mm_per_pixel == picture->info.mm_per_pixel);
        mm_per_pixel = picture->info.mm_per_pixel;
        cts_picture_free(&picture);
    }
    cts_render_end(&renderer);
    cts_volume_free(&v);
}

static double scale_of(const CtsVolume *v, const CtsPreset *p, const CtsRenderSettings *s, CtsReport *report)
{
    CtsPicture *picture = NULL;
    CtsError err;
    assert_int_equal(cts_render(MODEL_OF(v), p, s, &picture, report, &err), CTS_OK);
    const double mm = picture->info.mm_per_pixel;
    cts_picture_free(&picture);
    return mm;
}

/* Without any visible voxel the whole volume is framed, with a warning; a given scale is kept. */
static void test_otherwise(void **state)
{
    CtsVolume *v = make_ball();
    const CtsPreset nothing = preset_above(2000), p = preset_above(200);
    CtsRenderSettings s = settings_of(CTS_ENGINE_TILED, 0, 0), whole = s;
    CtsReport report = {0};
    whole.fit = CTS_FIT_VOLUME;
    assert_true(scale_of(v, &nothing, &s, &report) == scale_of(v, &p, &whole, NULL));
    assert_int_equal(report.diagnostics.n, 1);
    assert_string_equal(report.diagnostics.items[0].code, "nothing_visible");
    cts_report_free(&report);
    for (int mode = CTS_MODE_COMPOSITE; mode < CTS_N_MODES; mode++) {
        s.mode = mode;
        assert_true(scale_of(v, &p, &s, NULL) < 0.6 * scale_of(v, &p, &whole, NULL));
    }
    s.mm_per_pixel = 0.5;
    assert_true(scale_of(v, &p, &s, NULL) == 0.5);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ends),         cmocka_unit_test(test_haze),      cmocka_unit_test(test_specks),
        cmocka_unit_test(test_faint_specks), cmocka_unit_test(test_small),     cmocka_unit_test(test_slab),
        cmocka_unit_test(test_small_specks), cmocka_unit_test(test_thin),      cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_rotation),     cmocka_unit_test(test_otherwise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
