/* Partially rendered volumes: the inside of the body in minip and average, a slab in any mode. Truth from formulas, for
 * the tiled engine and the ray caster alike. */
#include "unit.h"

#include "ctsplat/ctsplat.h"
#include "ctsplat/table.h"
#include <math.h>
#include <stdbool.h>

enum { N = 96, SIZE = 64 };
static const double STEP_MM = 1.5, MIDDLE_MM = STEP_MM * (N - 1) / 2;
static const CtsEngineId engines[] = {CTS_ENGINE_TILED, CTS_ENGINE_RAYCAST};

typedef double (*Hu)(double x, double y, double z);

static CtsVolume *make(Hu hu)
{
    CtsVolume *v = NULL;
    assert_int_equal(cts_volume_new(&v, N, N, N, NULL), CTS_OK);
    for (int axis = 0; axis < 3; axis++)
        v->step_lps[axis][axis] = STEP_MM;
    uint16_t *grey = v->grey;
    for (int k = 0; k < N; k++)
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++)
                *grey++ = (uint16_t)lround(
                    hu(i * STEP_MM - MIDDLE_MM, j * STEP_MM - MIDDLE_MM, k * STEP_MM - MIDDLE_MM) + 1024);
    return v;
}

/* A trunk of 40 HU with a lung of -900 HU in it, on a table; air around is -1000 HU, and -980 HU in the table. */
static double trunk(double x, double y, double z)
{
    if (x * x + y * y + z * z < 20 * 20)
        return -900;
    if (x * x / (50 * 50) + y * y / (45 * 45) + z * z / (200 * 200) < 1)
        return 40;
    return fabs(y - 55) < 1 ? 100 : y > 55 ? -980 : -1000;
}

/* HU rises from front to back. */
static double ramp(double x, double y, double z)
{
    return 8 * y;
}

static double full(double x, double y, double z)
{
    return 100;
}

/* A window of 0 to 1 for 0 to 1000 HU above -1000, so that a level is an HU. */
static CtsPreset preset_of(CtsMode mode)
{
    CtsPreset p = {.name = "test",
                   .window_low_hu = -1000,
                   .window_high_hu = 1000,
                   .mode = mode,
                   .unit_distance_mm = 1,
                   .n_opacity = 2,
                   .n_colour = 1,
                   .opacity = {{-1000, 0}, {100, 0.01}},
                   .colour = {{0, {1, 1, 1}}}};
    return p;
}

static CtsPicture *render_model(const CtsModel *model, const CtsPreset *p, CtsRenderSettings s, CtsEngineId engine)
{
    CtsPicture *picture = NULL;
    CtsError err = {0};
    s.engine = engine;
    s.width = s.height = SIZE;
    s.mm_per_pixel = 2;
    if (cts_render(model, p, &s, &picture, NULL, &err))
        fail_msg("%s", err.text);
    return picture;
}

static CtsPicture *render(CtsVolume *v, const CtsPreset *p, CtsRenderSettings s, CtsEngineId engine)
{
    return render_model(&(CtsModel){.volume = v}, p, s, engine);
}

static CtsRenderSettings settings(double azimuth_deg, double elevation_deg)
{
    CtsRenderSettings s;
    cts_render_defaults(&s);
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    return s;
}

/* HU and alpha of the pixel whose centre lies right_mm to the right of the picture's centre, and 1 mm above it. */
static double hu_at(const CtsPicture *p, double right_mm, float *alpha)
{
    const int x = SIZE / 2 + (int)floor(right_mm / 2), y = SIZE / 2 - 1;
    const float *at = p->pixels + 4 * (y * SIZE + x);
    *alpha = at[3];
    return -1000 + 2000 * (double)at[0];
}

static void check_body(const CtsModel *model, int grey_bits, CtsMode mode, double at_lung, double bound, double around)
{
    const CtsPreset p = preset_of(mode);
    for (int e = 0; e < 2; e++) {
        CtsRenderSettings s = settings(0, 0);
        s.grey_bits = grey_bits;
        CtsPicture *picture = render_model(model, &p, s, engines[e]);
        float alpha;
        assert_true(fabs(hu_at(picture, 1, &alpha) - at_lung) < bound && alpha == 1);
        assert_true(fabs(hu_at(picture, 35, &alpha) - (at_lung < -950 ? at_lung : 40)) < 1 && alpha == 1);
        const double outside = hu_at(picture, 57, &alpha);
        assert_true(isnan(around) ? alpha == 0 : alpha == 1 && fabs(outside - around) < 2);
        cts_picture_free(&picture);
    }
}

/* Without a body air is the smallest everywhere; with one, the lung is, and beside it flesh, up to 3 mm under the
 * skin. The same after a crop that leaves the pixels where they are, and with fewer grey levels. */
static void test_body(void **state)
{
    CtsModel model = {.volume = make(trunk)};
    CtsError err;
    check_body(&model, 16, CTS_MODE_MINIP, -1000, 1, -1000);
    assert_int_equal(cts_model_remove_table(&model, true, 2, NULL, &err), CTS_OK);
    assert_non_null(model.body);
    check_body(&model, 16, CTS_MODE_MINIP, -900, 2, NAN);
    /* A ray through the middle has 20 mm of lung on either side, and flesh to 3 mm under the skin at 45 mm. */
    check_body(&model, 16, CTS_MODE_AVERAGE, 40 - 940 * 20.0 / 42, 15, NAN);
    check_body(&model, 16, CTS_MODE_MIP, 40, 1, -1000);
    check_body(&model, 12, CTS_MODE_MINIP, -900, 2, NAN);
    const double lo[3] = {0, 0, MIDDLE_MM - 30}, hi[3] = {2 * MIDDLE_MM, 2 * MIDDLE_MM, MIDDLE_MM + 30};
    assert_int_equal(cts_model_crop(&model, lo, hi, &err), CTS_OK);
    check_body(&model, 16, CTS_MODE_MINIP, -900, 2, NAN);
    cts_model_free(&model);
}

/* A slab's largest, smallest and mean value on a ramp along the view. */
static void test_slab_modes(void **state)
{
    CtsVolume *v = make(ramp);
    const double thick = 11.3, at = 7.7;
    for (int e = 0; e < 2; e++)
        for (int mode = CTS_MODE_MIP; mode < CTS_N_MODES; mode++) {
            const CtsPreset p = preset_of((CtsMode)mode);
            CtsRenderSettings s = settings(0, 0);
            s.slab_mm = thick;
            s.slab_at_mm = at;
            CtsPicture *picture = render(v, &p, s, engines[e]);
            const double end = mode == CTS_MODE_MIP ? thick / 2 : mode == CTS_MODE_MINIP ? -thick / 2 : 0;
            float alpha;
            assert_true(fabs(hu_at(picture, 1, &alpha) - 8 * (end - at)) < 0.1 && alpha == 1);
            cts_picture_free(&picture);
        }
    cts_volume_free(&v);
}

/* A homogeneous medium absorbs 1 - exp(-k * thickness) of the light, in any view; a slab outside shows nothing. */
static void test_slab_composite(void **state)
{
    CtsVolume *v = make(full);
    const CtsPreset p = preset_of(CTS_MODE_COMPOSITE);
    const double views[][2] = {{0, 0}, {90, 0}, {33, 21}, {45, 45}, {0, 90}, {-120, -64}};
    const double slabs[][2] = {{10, 0}, {3.3, 20.2}, {0.4, -13}, {500, 0}, {20, 300}};
    for (int view = 0; view < 6; view++)
        for (int slab = 0; slab < 5; slab++)
            for (int e = 0; e < 2; e++) {
                CtsRenderSettings s = settings(views[view][0], views[view][1]);
                s.shade = CTS_OFF;
                s.slab_mm = slabs[slab][0];
                s.slab_at_mm = slabs[slab][1];
                CtsPicture *picture = render(v, &p, s, engines[e]);
                float alpha;
                hu_at(picture, 1, &alpha);
                const double depth = -log1p(-0.01) * s.slab_mm;
                if (slab < 3)
                    assert_true(fabs(alpha + expm1(-depth)) < 1e-5);
                else if (slab == 3)
                    assert_true(alpha > 0.7 && alpha < 0.95);
                else
                    assert_true(alpha == 0);
                cts_picture_free(&picture);
            }
    cts_volume_free(&v);
}

/* The tiled engine's slabs against the ray caster's, in inhomogeneous tissue. */
static void test_slab_cut(void **state)
{
    CtsVolume *v = make(trunk);
    CtsPreset p = preset_of(CTS_MODE_COMPOSITE);
    p.opacity[1].opacity = 0.2;
    CtsRenderSettings s = settings(25, 15);
    s.shade = CTS_OFF;
    s.slab_mm = 30;
    s.slab_at_mm = 12.4;
    CtsPicture *tiled = render(v, &p, s, CTS_ENGINE_TILED), *truth = render(v, &p, s, CTS_ENGINE_RAYCAST);
    double sum = 0;
    for (int i = 0; i < SIZE * SIZE; i++)
        sum += pow((double)tiled->pixels[4 * i] - (double)truth->pixels[4 * i], 2);
    assert_true(sqrt(sum / (SIZE * SIZE)) < 0.5 / 255);
    cts_picture_free(&tiled);
    cts_picture_free(&truth);
    cts_volume_free(&v);
}

static void test_refused(void **state)
{
    CtsVolume *v = make(full);
    const CtsPreset p = preset_of(CTS_MODE_COMPOSITE);
    CtsPicture *picture;
    CtsError err;
    for (int e = 0; e < CTS_N_ENGINES; e++) {
        CtsRenderSettings s = settings(0, 0);
        s.width = s.height = 8;
        s.engine = (CtsEngineId)e;
        s.slab_mm = 10;
        const bool cuts = e == CTS_ENGINE_SHEETS || e == CTS_ENGINE_TILED || e == CTS_ENGINE_RAYCAST;
        assert_int_equal(cts_render(&(CtsModel){.volume = v}, &p, &s, &picture, NULL, &err),
                         cuts ? CTS_OK : CTS_ERR_USAGE);
        if (cuts)
            cts_picture_free(&picture);
    }
    CtsRenderSettings s = settings(0, 0);
    s.slab_at_mm = 3;
    assert_int_equal(cts_render(&(CtsModel){.volume = v}, &p, &s, &picture, NULL, &err), CTS_ERR_USAGE);
    s.slab_mm = -1;
    assert_int_equal(cts_render(&(CtsModel){.volume = v}, &p, &s, &picture, NULL, &err), CTS_ERR_USAGE);
    s.slab_mm = NAN;
    assert_int_equal(cts_render(&(CtsModel){.volume = v}, &p, &s, &picture, NULL, &err), CTS_ERR_USAGE);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_body),     cmocka_unit_test(test_slab_modes), cmocka_unit_test(test_slab_composite),
        cmocka_unit_test(test_slab_cut), cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
