/* The tiled engine's lighting against formulas: a gradient that reverses within a slab, and a ball; and reported errors
 * of lighting. */
#include "base/cpu.h"
#include "scenes.h"

static const unsigned masks[] = {0, CTS_CPU_AVX2, ~0u};
enum { N_MASKS = sizeof masks / sizeof masks[0] };

/* HU = 40 u (y - 1/2) between two layers: on a ray at u, the gradient (40 (y - 1/2), 40 u) faces the camera by |u| /
 * hypot(u, y - 1/2), in the mean over the slab 2 |u| asinh(1 / (2 |u|)). Only in the middle it faces the camera
 * directly. */
static void turns_round(void **state)
{
    enum { NX = 41, NZ = 9, SIZE = 40 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, NX, 2, NZ, &err), CTS_OK);
    for (int k = 0, at = 0; k < NZ; k++)
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < NX; i++, at++)
                v->grey[at] = (uint16_t)(1024 + 20 * (i - NX / 2) * (2 * j - 1));
    CtsPreset preset = {.name = "haze", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2, .diffuse = 1, .power = 1};
    for (int i = 0; i < 2; i++) {
        preset.opacity[i] = (CtsOpacityPoint){-2000 + 4000 * i, 0.05};
        preset.colour[i] = (CtsColourPoint){-2000 + 4000 * i, {1, 1, 1}};
    }
    for (int mask = 0; mask < N_MASKS; mask++)
        for (int side = 0; side < 2; side++) {
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 180 * side, 0);
            cts_cpu_set_mask(masks[mask]);
            s.shade = CTS_ON;
            s.mm_per_pixel = 0.5;
            CtsPicture *p = render(v, &preset, &s, NULL);
            for (int x = 0; x < SIZE; x++) {
                const float *pixel = p->pixels + 4 * (SIZE / 2 * SIZE + x);
                const double u = fabs((x + 0.5 - SIZE / 2.0) * s.mm_per_pixel);
                const double facing = (double)pixel[0] / (double)pixel[3];
                const double expected = 2 * u * asinh(0.5 / u);
                if (!(fabs(facing - expected) < 0.015))
                    fail_msg("mask %d, %g mm off the middle: %g, not %g", mask, u, facing, expected);
            }
            cts_picture_free(&p);
        }
    cts_volume_free(&v);
}

/* A ball that is opaque right below its surface: at b from its middle its normal faces the camera by
 * sqrt(1 - b^2 / R^2), from all sides, through windows, gathers and lane by lane. */
static void ball(void **state)
{
    static const double views[][2] = {{0, 0}, {90, 0}, {30, 20}, {45, 35}, {-120, -50}};
    static const double mm[] = {0.4, 2.6, 40};
    enum { N = 45, RADIUS = 17 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, N, N, N, &err), CTS_OK);
    v->hu_step = 0.25;
    for (int k = 0, at = 0; k < N; k++)
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++, at++) {
                const double r =
                    sqrt((i - N / 2) * (i - N / 2) + (j - N / 2) * (j - N / 2) + (k - N / 2) * (k - N / 2));
                v->grey[at] = (uint16_t)lrint((40 * (RADIUS - r) - v->hu_offset) / v->hu_step);
            }
    CtsPreset preset = {.name = "ball", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
    preset.opacity[0] = (CtsOpacityPoint){0, 0};
    preset.opacity[1] = (CtsOpacityPoint){20, 1};
    preset.colour[0] = (CtsColourPoint){0, {0.5, 0.7, 0.6}};
    preset.colour[1] = (CtsColourPoint){20, {0.5, 0.7, 0.6}};
    preset.ambient = 0.2;
    preset.diffuse = 0.8;
    preset.specular = 0.3;
    preset.power = 20;
    for (size_t view = 0; view < sizeof views / sizeof *views; view++)
        for (size_t scale = 0; scale < sizeof mm / sizeof *mm; scale++)
            for (int mask = 0; mask < N_MASKS; mask++) {
                const int size = mm[scale] < 1 ? 80 : mm[scale] < 10 ? 15 : 1;
                CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, size, views[view][0], views[view][1]);
                cts_cpu_set_mask(masks[mask]);
                s.shade = CTS_ON;
                s.mm_per_pixel = mm[scale];
                CtsPicture *p = render(v, &preset, &s, NULL);
                for (int at = 0; at < size * size; at++) {
                    const double b = mm[scale] * hypot(at % size + 0.5 - size / 2.0, at / size + 0.5 - size / 2.0);
                    if (b > 0.6 * RADIUS)
                        continue;
                    const double facing = sqrt(1 - b * b / RADIUS / RADIUS);
                    const double expected = 0.7 * (0.2 + 0.8 * facing) + 0.3 * pow(facing, 20);
                    if (!(fabs((double)p->pixels[4 * at + 1] - expected) < 0.015))
                        fail_msg("at %g,%g, %g mm a pixel, mask %d, %g mm off the middle: %g, not %g", views[view][0],
                                 views[view][1], mm[scale], mask, b, (double)p->pixels[4 * at + 1], expected);
                }
                cts_picture_free(&p);
            }
    cts_volume_free(&v);
}

/* All levels are equal, so there is no gradient, and lighting is known. */
static void flat(void **state)
{
    enum { N = 12, SIZE = 160 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, N, N, N, &err), CTS_OK);
    for (int at = 0; at < N * N * N; at++)
        v->grey[at] = 1064;
    CtsPreset preset = {
        .name = "fog", .unit_distance_mm = 1, .n_opacity = 1, .n_colour = 1, .ambient = 0.25, .diffuse = 1, .power = 1};
    preset.opacity[0] = (CtsOpacityPoint){0, 0.1};
    preset.colour[0] = (CtsColourPoint){0, {1, 1, 1}};
    for (int mask = 0; mask < N_MASKS; mask++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 30, 20);
        CtsReport report = {0};
        cts_cpu_set_mask(masks[mask]);
        s.shade = CTS_ON;
        CtsPicture *p = render(v, &preset, &s, &report);
        for (int at = 0; at < SIZE * SIZE; at++)
            if (!(fabs((double)(p->pixels[4 * at] - p->pixels[4 * at + 3] / 4)) < 1e-5))
                fail_msg("mask %d, pixel %d: %g of %g", mask, at, (double)p->pixels[4 * at],
                         (double)p->pixels[4 * at + 3]);
        assert_true(report.bound.known && report.bound.max < 1 / 255.0);
        cts_report_free(&report);
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
}

/* A lit picture's error, against the ray caster's, is not above the reported one. These scenes are the same from row to
 * row, so the middle rows stand for all; and one path for all, since their bytes are equal (test_tiled). */
static void held(const CtsVolume *v, const CtsPreset *preset, CtsRenderSettings s)
{
    enum { ROWS = 6 };
    const int first = (s.height - ROWS) / 2;
    CtsReport report = {0};
    double square = 0;
    cts_cpu_set_mask(~0u);
    s.shade = CTS_ON;
    s.engine = CTS_ENGINE_TILED;
    CtsPicture *p = render(v, preset, &s, &report);
    s.engine = CTS_ENGINE_RAYCAST;
    s.height = ROWS;
    CtsPicture *q = render(v, preset, &s, NULL);
    for (int at = 0; at < s.width * ROWS; at++)
        square += pow((double)(p->pixels[4 * (first * s.width + at)] - q->pixels[4 * at]), 2);
    const double rms = sqrt(square / s.width / ROWS);
    if (!(rms <= report.bound.rmse))
        fail_msg("error %.3g/255 rms, reported at most %.3g", 255 * rms, 255 * report.bound.rmse);
    cts_report_free(&report);
    cts_picture_free(&p);
    cts_picture_free(&q);
}

/* White where HU lie from low to high, by so much opacity at the latter; lit where it faces the camera alone. */
static CtsPreset white(double low, double high, double opacity)
{
    CtsPreset p = {.name = "white", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 1, .diffuse = 1, .power = 2};
    p.opacity[0] = (CtsOpacityPoint){low, 0};
    p.opacity[1] = (CtsOpacityPoint){high, opacity};
    p.colour[0] = (CtsColourPoint){low, {1, 1, 1}};
    return p;
}

/* Plates so thin and of so low opacity that each is shaded as one: in front and behind they face the camera, in the
 * middle they do not. */
static void faint_turns(void **state)
{
    enum { NX = 12, NY = 42, SIZE = 48 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, NX, NY, NX, &err), CTS_OK);
    for (int at = 0; at < NX * NY * NX; at++)
        v->grey[at] = (uint16_t)(1024 + at % NX + (at / NX % NY % 5 == 2 ? 1000 : 0));
    const CtsPreset preset = white(100, 1000, 0.01);
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
    s.mm_per_pixel = 0.2;
    s.max_error = 12;
    held(v, &preset, s);
    cts_volume_free(&v);
}

/* HU = 1000 x + (0, 25, 25, 0) by layers: between the inner two a normal varies little, but past perpendicular. */
static void past_perpendicular(void **state)
{
    enum { N = 12, SIZE = 48 };
    static const int layer[4] = {0, 25, 25, 0};
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, N, 4, N, &err), CTS_OK);
    for (int at = 0; at < N * 4 * N; at++)
        v->grey[at] = (uint16_t)(1024 + 1000 * (at % N) + layer[at / N % 4]);
    const CtsPreset preset = white(-4000, 20000, 0.3);
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
    s.mm_per_pixel = 0.2;
    held(v, &preset, s);
    cts_volume_free(&v);
}

/* Plates whose faces are visible between two levels: a ray has the same error at each of them, and so has its reference
 * sample. */
static void errs_alike(void **state)
{
    enum { NX = 12, NY = 102, SIZE = 48 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, NX, NY, NX, &err), CTS_OK);
    for (int at = 0; at < NX * NY * NX; at++)
        v->grey[at] = at / NX % NY % 3 == 1 ? 3524 : 1024;
    CtsPreset preset = white(1485.02, 1485.5, 1);
    preset.n_opacity = 3;
    preset.opacity[2] = (CtsOpacityPoint){1485.98, 0};
    preset.ambient = 1;
    preset.diffuse = 0;
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 3.2);
    s.mm_per_pixel = 0.2;
    s.max_error = 0.25;
    held(v, &preset, s);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(turns_round),
                                       cmocka_unit_test(ball),
                                       cmocka_unit_test(flat),
                                       cmocka_unit_test(faint_turns),
                                       cmocka_unit_test(past_perpendicular),
                                       cmocka_unit_test(errs_alike)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
