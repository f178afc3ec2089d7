/* The reference against closed forms, independent of other renderers. */
#include "base/compare.h"
#include "engine/raycast/cubic.h"
#include "rays.h"
#include <string.h>

static const CtsCheckPoint hard_points[] = {
    {100, 0, {0.9, 0.2, 0.1}}, {300, 0.05, {0.8, 0.7, 0.2}}, {400, 0.6, {0.1, 0.9, 0.5}}, {400, 0.1, {0.3, 0.3, 0.9}},
    {700, 1, {1, 1, 0.5}},     {900, 0.2, {0.2, 0.1, 0.6}},  {950, 0, {0, 0, 0}},
};

static double random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) / 9007199254740992.0;
}

static void make(Rays *r, int nx, int ny, int nz, const double spacing_mm[3], CtsHuFormula hu, const void *data)
{
    const int dims[3] = {nx, ny, nz};
    CtsError err;
    assert_int_equal(cts_check_volume(&r->volume, dims, spacing_mm, 1, hu, data, &err), CTS_OK);
}

static void set_steps(CtsVolume *v, const double step_lps[3][3])
{
    memcpy(v->step_lps, step_lps, sizeof v->step_lps);
    v->origin_lps[0] = 17;
    v->origin_lps[1] = -230;
    v->origin_lps[2] = 911.5;
}

/* HU at a point of a linear volume. */
static double linear_at(const CtsVolume *v, const double c[4], const double point_lps[3])
{
    double inverse[3][3], hu = c[0];
    assert_true(cts_volume_inverse(v, inverse));
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < 3; k++)
            hu += c[a + 1] * inverse[a][k] * (point_lps[k] - v->origin_lps[k]);
    return hu;
}

static void expect_linear(const Rays *r, const double c[4], double x, double y, double facing, double expected[4])
{
    CtsTruthRay ray;
    CtsTruthInterval s = {0, 0, 0, facing};
    double p[3];
    memset(expected, 0, 4 * sizeof *expected);
    if (!rays_truth(r, x, y, &ray))
        return;
    cts_truth_ray_point(&ray, ray.from_mm, p);
    s.hu0 = linear_at(r->volume, c, p);
    cts_truth_ray_point(&ray, ray.to_mm, p);
    s.hu1 = linear_at(r->volume, c, p);
    s.length_mm = ray.to_mm - ray.from_mm;
    cts_truth_intervals(&r->preset, r->scene.extinction_scale, &s, 1, expected);
}

static void test_slab(void **state)
{
    Rays r = {0};
    const double spacing[3] = {1, 0.7, 2}, hu = 500;
    make(&r, 21, 31, 11, spacing, cts_hu_constant, &hu);
    const double opacity[] = {1e-8, 1e-4, 0.03, 0.5, 0.999999, 1};
    for (int i = 0; i < 6; i++) {
        r.preset = cts_check_even_preset(opacity[i], 0.2, 0.5, 0.9);
        const double extinction = opacity[i] == 1 ? 50 : -log1p(-opacity[i]);
        const struct {
            double az, el, length_mm;
        } views[] = {{0, 0, 21},  {180, 0, 21},          {90, 0, 20},
                     {0, 90, 20}, {45, 0, 20 * sqrt(2)}, {0, 60, 20 / sin(M_PI / 3)}};
        for (int v = 0; v < 6; v++) {
            rays_aim(&r, views[v].az, views[v].el, 0.01, NULL);
            double rgba[4];
            rays_shoot(&r, 31, 33, rgba);
            const double alpha = -expm1(-extinction * views[v].length_mm);
            const double expected[4] = {0.2 * alpha, 0.5 * alpha, 0.9 * alpha, alpha};
            assert_rgba(rgba, expected, 1e-13 + 1e-9 * alpha);
        }
    }
    rays_free(&r);
}

/* Any view, any spacing, sheared steps, hard transfer function: a linear field is exact in trilinear interpolation. */
static void test_linear(void **state)
{
    uint64_t seed = 1;
    const double steps[4][3][3] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                   {{0.5, 0, 0}, {0, 0.5, 0}, {0, 0, 5}},
                                   {{0.4, 0.1, 0}, {-0.1, 0.4, 0.3}, {0.2, 0.9, 2.5}},
                                   {{0, 0, -1}, {1, 0, 0}, {0, 0.02, 0}}};
    const double c[4] = {60, 37, -11, 53};
    int seen = 0;
    for (int s = 0; s < 4; s++) {
        Rays r = {0};
        const double spacing[3] = {1, 1, 1};
        make(&r, 17, 9, 13, spacing, cts_hu_linear, c);
        r.preset = cts_check_preset(hard_points, 7);
        set_steps(r.volume, steps[s]);
        for (int v = 0; v < 60; v++) {
            rays_aim(&r, 720 * random_unit(&seed) - 360, 180 * random_unit(&seed) - 90, 0, NULL);
            const double x = 64 * random_unit(&seed), y = 64 * random_unit(&seed);
            double found[4], expected[4];
            rays_shoot(&r, x, y, found);
            expect_linear(&r, c, x, y, -1, expected);
            assert_rgba(found, expected, 1e-7);
            seen += expected[3] > 0.01;
        }
        rays_free(&r);
    }
    assert_true(seen > 30);
}

static void test_linear_lit(void **state)
{
    uint64_t seed = 2;
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, c[4] = {100, 20, -30, 25};
    const double steps[3][3] = {{0.7, 0, 0}, {0, 0.9, 0}, {0.3, -0.2, 1.5}};
    make(&r, 12, 14, 10, spacing, cts_hu_linear, c);
    set_steps(r.volume, steps);
    r.preset = cts_check_preset(hard_points, 7);
    r.preset.opacity[0].opacity = 0.01; /* in air too: at the border the field is continued */
    r.preset.shade = true;
    r.preset.ambient = 0.2;
    r.preset.diffuse = 0.7;
    r.preset.specular = 0.3;
    r.preset.power = 20;
    /* The gradient in mm from differences of HU over points a millimetre apart. */
    double gradient[3], length = 0;
    for (int k = 0; k < 3; k++) {
        double p[3] = {0, 0, 0}, q[3] = {0, 0, 0};
        p[k] = 1;
        gradient[k] = linear_at(r.volume, c, p) - linear_at(r.volume, c, q);
        length += gradient[k] * gradient[k];
    }
    for (int v = 0; v < 40; v++) {
        rays_aim(&r, 360 * random_unit(&seed), 180 * random_unit(&seed) - 90, 0, NULL);
        const double x = 15 + 34 * random_unit(&seed), y = 15 + 34 * random_unit(&seed);
        CtsTruthRay ray;
        double facing = 0, found[4], expected[4];
        if (rays_truth(&r, x, y, &ray))
            for (int k = 0; k < 3; k++)
                facing += gradient[k] * ray.direction_lps[k] / sqrt(length);
        rays_shoot(&r, x, y, found);
        expect_linear(&r, c, x, y, fabs(facing), expected);
        assert_rgba(found, expected, 1e-7);
    }
    rays_free(&r);
}

/* No gradient: ambient light alone, even with power 0. */
static void test_lit_without_gradient(void **state)
{
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, hu = 500;
    make(&r, 5, 5, 5, spacing, cts_hu_constant, &hu);
    r.preset = cts_check_even_preset(0.5, 1, 0.5, 0.25);
    r.preset.shade = true;
    r.preset.ambient = 0.3;
    r.preset.diffuse = 0.6;
    r.preset.specular = 0.5;
    rays_aim(&r, 0, 0, 0.05, NULL);
    double found[4];
    rays_shoot(&r, 31, 31, found);
    const double alpha = 1 - pow(0.5, 4), expected[4] = {0.3 * alpha, 0.15 * alpha, 0.075 * alpha, alpha};
    assert_rgba(found, expected, 1e-12);
    rays_free(&r);
}

/* An opaque step on a linear field: the entry depth is exact, so that the light behind is correct to the last digit. */
static void test_step_entry(void **state)
{
    const CtsCheckPoint points[] = {{0, 0.1, {1, 0, 0}}, {500.25, 0.1, {1, 0, 0}}, {500.25, 1, {0, 1, 0}}};
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, c[4] = {0, 0, 100, 0};
    make(&r, 11, 11, 11, spacing, cts_hu_linear, c);
    r.preset = cts_check_preset(points, 3);
    rays_aim(&r, 0, 0, 0.1, NULL);
    double found[4];
    rays_shoot(&r, 30, 30, found);
    const double front = 1 - pow(0.9, 5.0025), expected[4] = {front, 1 - front, 0, 1};
    assert_rgba(found, expected, 1e-9);
    /* In the view from behind the opaque part comes first. */
    rays_aim(&r, 180, 0, 0.1, NULL);
    rays_shoot(&r, 30, 30, found);
    const double behind[4] = {0, 1, 0, 1};
    assert_rgba(found, behind, 1e-9);
    rays_free(&r);
}

/* Exactly on a step the later point holds. */
static void test_on_the_step(void **state)
{
    const CtsCheckPoint points[] = {{500, 0, {1, 0, 0}}, {500, 0.5, {0, 1, 0}}};
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, hu[2] = {500, 499};
    for (int i = 0; i < 2; i++) {
        make(&r, 3, 3, 3, spacing, cts_hu_constant, &hu[i]);
        r.preset = cts_check_preset(points, 2);
        rays_aim(&r, 30, 10, 0.01, NULL);
        double found[4];
        rays_shoot(&r, 31, 31, found);
        assert_true(i == 0 ? found[3] > 0.5 && fabs(found[1] - found[3]) < 1e-12 && found[0] == 0 : found[3] == 0);
        rays_free(&r);
    }
}

typedef struct SphereField {
    CtsField field;
    double centre[3], hu_per_voxel, hu_centre;
    double step_mm;
} SphereField;

static double sphere_hu(const double vox[3], const void *data)
{
    const SphereField *s = data;
    return s->hu_centre - s->hu_per_voxel * sqrt((vox[0] - s->centre[0]) * (vox[0] - s->centre[0]) +
                                                 (vox[1] - s->centre[1]) * (vox[1] - s->centre[1]) +
                                                 (vox[2] - s->centre[2]) * (vox[2] - s->centre[2]));
}

static bool sphere_next(const CtsField *field, CtsRayWalk *walk, CtsRaySegment *segment)
{
    const SphereField *s = (const SphereField *)field;
    if (walk->t_mm >= walk->ray->t1_mm)
        return false;
    segment->t0_mm = walk->t_mm;
    segment->t1_mm = walk->t_mm = fmin(walk->t_mm + s->step_mm, walk->ray->t1_mm);
    const double at[4] = {0, 0.25, 0.75, 1};
    double v[4], vox[3];
    for (int i = 0; i < 4; i++) {
        for (int a = 0; a < 3; a++)
            vox[a] = walk->ray->start_vox[a] +
                     (segment->t0_mm + (segment->t1_mm - segment->t0_mm) * at[i]) * walk->ray->step_vox[a];
        v[i] = sphere_hu(vox, field);
    }
    cts_cubic_through(at, v, segment->hu);
    return true;
}

/* A ball by a formula: HU falls from the centre, the preset shows radii below R. L = 2 sqrt(R^2 - b^2). */
static void test_sphere_formula(void **state)
{
    const CtsCheckPoint points[] = {{0, 0, {0, 0, 0}}, {0, 0.2, {1, 0.6, 0.2}}};
    const SphereField s = {{.next = sphere_next}, {20, 20, 20}, 100, 1000, 0.02}; /* HU 0 at R = 10 */
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, hu = 0;
    make(&r, 41, 41, 41, spacing, cts_hu_constant, &hu);
    r.preset = cts_check_preset(points, 2);
    rays_aim(&r, 33, -27, 0.5, &s.field);
    for (int x = 8; x < 40; x++) {
        const double b = hypot((x + 0.5 - 32) * 0.5, 0.25), length = b < 10 ? 2 * sqrt(100 - b * b) : 0;
        const double alpha = -expm1(length * log(0.8)), expected[4] = {alpha, 0.6 * alpha, 0.2 * alpha, alpha};
        double found[4];
        rays_shoot(&r, x, 31, found);
        assert_rgba(found, expected, 1e-6);
    }
    rays_free(&r);
}

/* The same ball on voxels: the trilinear field is less curved than the ball; half the spacing, a quarter of the
 * error. */
static void test_sphere_voxels(void **state)
{
    const CtsCheckPoint points[] = {{6200, 0, {0, 0, 0}}, {6200, 0.2, {1, 1, 1}}};
    double error[3];
    for (int level = 0; level < 3; level++) {
        const double h = 1.0 / (1 << level);
        const int n = 30 * (1 << level) + 1;
        const SphereField s = {{0}, {n / 2, n / 2, n / 2}, 3000 * h, 36200, 0};
        Rays r = {0};
        const double spacing[3] = {h, h, h};
        make(&r, n, n, n, spacing, sphere_hu, &s);
        r.preset = cts_check_preset(points, 2);
        rays_aim(&r, 20, 35, 0.5, NULL);
        double sum = 0;
        for (int x = 18; x < 46; x++) {
            const double b = hypot((x + 0.5 - 32) * 0.5, 0.25);
            double found[4];
            rays_shoot(&r, x, 31, found);
            sum += fabs(found[3] + expm1(2 * sqrt(100 - b * b) * log(0.8)));
        }
        error[level] = sum / 28;
        rays_free(&r);
    }
    assert_true(error[0] < 2e-3);
    assert_near(log2(error[0] / error[1]), 2, 0.3);
    assert_near(log2(error[1] / error[2]), 2, 0.3);
}

static double xyz_hu(const double vox[3], const void *data)
{
    const double scale = *(const double *)data;
    return scale * vox[0] * vox[1] * vox[2];
}

static double shoot_grey(Rays *r, CtsMode mode, double x, double y)
{
    double rgba[4];
    r->preset.mode = mode;
    rays_aim(r, r->settings.azimuth_deg, r->settings.elevation_deg, r->settings.mm_per_pixel, NULL);
    rays_shoot(r, x, y, rgba);
    assert_true(rgba[0] == rgba[1] && rgba[1] == rgba[2]);
    return rgba[3] == 1 ? rgba[0] * (r->preset.window_high_hu - r->preset.window_low_hu) + r->preset.window_low_hu
                        : NAN;
}

/* xyz is its own trilinear interpolation: along a ray a cubic with extremes inside the cells. */
static void test_modes_cubic(void **state)
{
    uint64_t seed = 3;
    const double scale = 7, spacing[3] = {1, 1.5, 0.8};
    Rays r = {0};
    make(&r, 9, 8, 10, spacing, xyz_hu, &scale);
    r.preset = cts_check_even_preset(0.5, 1, 1, 1);
    r.preset.window_high_hu = 7 * 8 * 7 * 9;
    int hits = 0;
    for (int v = 0; v < 50; v++) {
        const double x = 64 * random_unit(&seed), y = 64 * random_unit(&seed);
        rays_aim(&r, 360 * random_unit(&seed), 180 * random_unit(&seed) - 90, 0, NULL);
        CtsTruthRay ray;
        if (!rays_truth(&r, x, y, &ray)) {
            assert_true(isnan(shoot_grey(&r, CTS_MODE_MIP, x, y)));
            continue;
        }
        hits++;
        /* The cubic's coefficients in t from its three linear factors. */
        double poly[4] = {scale, 0, 0, 0};
        for (int a = 0; a < 3; a++) {
            const double p = (ray.point_lps[a] - r.volume->origin_lps[a]) / spacing[a],
                         d = ray.direction_lps[a] / spacing[a];
            for (int i = 3; i >= 0; i--)
                poly[i] = poly[i] * p + (i > 0 ? poly[i - 1] * d : 0);
        }
        double low = INFINITY, high = -INFINITY, mean = 0;
        for (int i = 0; i <= 20000; i++) {
            const double t = ray.from_mm + (ray.to_mm - ray.from_mm) * i / 20000, hu = cts_cubic_at(poly, t);
            cts_lower_to(&low, hu);
            cts_raise_to(&high, hu);
        }
        for (int i = 0; i < 4; i++)
            mean += poly[i] * (pow(ray.to_mm, i + 1) - pow(ray.from_mm, i + 1)) / (i + 1);
        mean /= ray.to_mm - ray.from_mm;
        assert_near(shoot_grey(&r, CTS_MODE_MIP, x, y), high, 1e-4);
        assert_near(shoot_grey(&r, CTS_MODE_MINIP, x, y), fmax(low, 0), 1e-4);
        assert_near(shoot_grey(&r, CTS_MODE_AVERAGE, x, y), mean, 1e-8 * r.preset.window_high_hu);
    }
    assert_true(hits > 20);
    rays_free(&r);
}

static double noise_hu(const double vox[3], const void *data)
{
    uint64_t state = *(const uint64_t *)data + (uint64_t)vox[0] * 73856093u + (uint64_t)vox[1] * 19349663u +
                     (uint64_t)vox[2] * 83492791u;
    random_unit(&state);
    random_unit(&state);
    return 1100 * random_unit(&state);
}

/* Trilinear HU by the textbook's seven mixes, and its gradient by mixing differences of neighbours, along the slice
 * axis of those a slice distance away: air beyond the border, or the voxel itself. */
static double mix_at(const CtsVolume *v, const double vox[3], int difference_axis, bool air_beyond)
{
    double sum = 0;
    int cell[3];
    for (int a = 0; a < 3; a++)
        cell[a] = (int)fmin(fmax(floor(vox[a]), 0), v->dims[a] - 2);
    for (int m = 0; m < 8; m++) {
        double weight = 1, value = 0;
        int at[3];
        for (int a = 0; a < 3; a++) {
            at[a] = cell[a] + (m >> a & 1);
            weight *= m >> a & 1 ? vox[a] - cell[a] : 1 - (vox[a] - cell[a]);
        }
        const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1];
        if (difference_axis < 0) {
            value = v->grey[((size_t)at[2] * ny + (size_t)at[1]) * nx + (size_t)at[0]] - 1024.0;
        } else {
            const int i = at[difference_axis], last = v->dims[difference_axis] - 1;
            const int step = difference_axis == 2 ? v->slice_layers : 1;
            double hu[2];
            int inside = 0;
            for (int side = 0; side < 2; side++) {
                int of[3] = {at[0], at[1], at[2]};
                const int to = side ? i + step : i - step;
                const bool beyond = to < 0 || to > last;
                of[difference_axis] = beyond ? i : to;
                hu[side] = v->grey[((size_t)of[2] * ny + (size_t)of[1]) * nx + (size_t)of[0]] - 1024.0;
                if (air_beyond && beyond)
                    hu[side] = -1024;
                inside += !beyond;
            }
            value = (hu[1] - hu[0]) / (step * (air_beyond || inside == 2 ? 2 : 1));
        }
        sum += weight * value;
    }
    return sum;
}

/* Noise, lit, sheared: without a closed form, so a plain midpoint sum with very short steps is the reference. The
 * preset shows no air, or, in the second half, a little: then there is none beyond the border. */
static void test_noise_midpoint(void **state)
{
    uint64_t seed = 4;
    const double spacing[3] = {1, 1, 1}, steps[3][3] = {{1, 0, 0.2}, {0, 0.8, 0}, {0.3, 0.1, 1.3}};
    const CtsCheckPoint points[] = {
        {200, 0, {1, 0.5, 0}}, {600, 0.3, {0.5, 1, 0.2}}, {600, 0.02, {0.2, 0.4, 1}}, {1000, 0.7, {1, 1, 1}}};
    Rays r = {0};
    make(&r, 6, 7, 5, spacing, noise_hu, &seed);
    set_steps(r.volume, steps);
    r.preset = cts_check_preset(points, 4);
    r.preset.ambient = 0.1;
    r.preset.diffuse = 0.8;
    r.preset.specular = 0.4;
    r.preset.power = 8;
    double inverse[3][3];
    assert_true(cts_volume_inverse(r.volume, inverse));
    for (int v = 0; v < 16; v++) {
        const bool air = v < 10;
        r.preset.opacity[0].opacity = air ? 0 : 0.01;
        r.volume->slice_layers = 1 + v / 2 % 3;
        r.preset.shade = v % 2;
        rays_aim(&r, 360 * random_unit(&seed), 180 * random_unit(&seed) - 90, 0, NULL);
        const double x = 20 + 24 * random_unit(&seed), y = 20 + 24 * random_unit(&seed);
        CtsTruthRay ray;
        double found[4], expected[4] = {0, 0, 0, 0}, depth = 0;
        rays_shoot(&r, x, y, found);
        const bool hit = rays_truth(&r, x, y, &ray);
        const int n = hit ? 200000 : 0;
        const double h = hit ? (ray.to_mm - ray.from_mm) / n : 0;
        for (int i = 0; i < n; i++) {
            double p[3], vox[3], rgb[3], g[3], mm[3] = {0, 0, 0}, facing = 0, length = 0;
            cts_truth_ray_point(&ray, ray.from_mm + (i + 0.5) * h, p);
            for (int a = 0; a < 3; a++) {
                vox[a] = 0;
                for (int k = 0; k < 3; k++)
                    vox[a] += inverse[a][k] * (p[k] - r.volume->origin_lps[k]);
            }
            const double hu = mix_at(r.volume, vox, -1, air), add = cts_preset_extinction_per_mm(&r.preset, hu) * h;
            cts_preset_colour(&r.preset, hu, rgb);
            for (int a = 0; a < 3 && r.preset.shade; a++) {
                g[a] = mix_at(r.volume, vox, a, air);
                for (int k = 0; k < 3; k++)
                    mm[k] += inverse[a][k] * g[a];
            }
            for (int k = 0; k < 3; k++) {
                facing += mm[k] * ray.direction_lps[k];
                length += mm[k] * mm[k];
            }
            facing = fabs(facing) / sqrt(length);
            for (int c = 0; c < 3; c++) {
                const double colour = r.preset.shade ? rgb[c] * (0.1 + 0.8 * facing) + 0.4 * pow(facing, 8) : rgb[c];
                expected[c] += exp(-depth) * -expm1(-add) * colour;
            }
            depth += add;
        }
        expected[3] = -expm1(-depth);
        assert_rgba(found, expected, 2e-5);
    }
    rays_free(&r);
}

/* The number of threads may not change a picture. */
static void test_threads(void **state)
{
    uint64_t seed = 5;
    const double spacing[3] = {1, 1, 1};
    const CtsCheckPoint points[] = {{1060, 0, {1, 0.5, 0}}, {1080, 0.8, {0.5, 1, 0.2}}};
    Rays r = {0};
    make(&r, 40, 37, 33, spacing, noise_hu, &seed);
    r.preset = cts_check_preset(points, 2);
    enum { N = 64 * 64 };
    static int xy[N][2];
    static double rgba[3][N][4];
    for (int i = 0; i < N; i++) {
        xy[i][0] = i % 64;
        xy[i][1] = i / 64;
    }
    for (int mode = 0; mode < CTS_N_MODES; mode++) {
        r.preset.mode = (CtsMode)mode;
        rays_aim(&r, 23, 31, 0, NULL);
        CtsError err;
        for (int i = 0; i < N; i++)
            cts_raycast_ray(r.caster, xy[i][0], xy[i][1], rgba[0][i], NULL);
        for (int n = 1; n < 3; n++) {
            r.settings.n_threads = n == 1 ? 1 : 7;
            assert_int_equal(cts_raycast_pixels(&r.scene, xy, N, rgba[n], &err), CTS_OK);
        }
        assert_memory_equal(rgba[0], rgba[1], sizeof rgba[0]);
        assert_memory_equal(rgba[0], rgba[2], sizeof rgba[0]);
    }
    rays_free(&r);
}

/* An axis of one voxel is a box without thickness. */
static void test_thin(void **state)
{
    Rays r = {0};
    const double spacing[3] = {1, 1, 1}, c[4] = {100, 50, 0, 0};
    double rgba[4];
    make(&r, 11, 5, 1, spacing, cts_hu_linear, c);
    r.preset = cts_check_even_preset(0.5, 1, 1, 1);
    r.settings.mm_per_pixel = 0.25;
    /* From the head every ray meets it in a point: an integral of length 0, but a HU to show. */
    r.settings.elevation_deg = 90;
    rays_aim(&r, 0, 90, 0.25, NULL);
    rays_shoot(&r, 31.5, 31.5, rgba);
    assert_true(rgba[3] == 0);
    assert_near(shoot_grey(&r, CTS_MODE_MIP, 31.5, 31.5), 350, 1e-9);
    assert_near(shoot_grey(&r, CTS_MODE_AVERAGE, 35.5, 31.5), 400, 1e-9);
    assert_true(isnan(shoot_grey(&r, CTS_MODE_MINIP, 31.5, 45)));
    /* Within its plane the ray runs through it. */
    r.preset.mode = CTS_MODE_COMPOSITE;
    rays_aim(&r, 90, 0, 0.25, NULL);
    rays_shoot(&r, 31.5, 31.5, rgba);
    assert_near(rgba[3], 1 - pow(0.5, 10), 1e-12);
    rays_shoot(&r, 31.5, 32, rgba);
    assert_true(rgba[3] == 0);
    rays_free(&r);

    make(&r, 1, 1, 1, spacing, cts_hu_linear, c);
    for (int v = 0; v < 20; v++) {
        r.preset.mode = CTS_MODE_COMPOSITE;
        rays_aim(&r, 18 * v, 9 * v - 90, 0.25, NULL);
        rays_shoot(&r, 31.5, 31.5, rgba);
        assert_true(rgba[3] == 0);
        assert_near(shoot_grey(&r, CTS_MODE_MIP, 31.5, 31.5), 100, 1e-9);
        assert_true(isnan(shoot_grey(&r, CTS_MODE_MIP, 32, 31.5)));
    }
    rays_free(&r);
}

/* A millionth of a degree and 1e-9 degrees off an axis or a diagonal give the same picture as on it. */
static void test_nearly_on_axis(void **state)
{
    uint64_t seed = 6;
    const double spacing[3] = {1, 1, 1};
    Rays r = {0};
    make(&r, 12, 12, 12, spacing, noise_hu, &seed);
    r.preset = cts_check_preset(hard_points, 7);
    const double views[][2] = {{0, 0}, {90, 0}, {180, 0}, {0, 90}, {0, -90}, {45, 0}, {0, 45}, {45, 45}};
    for (int v = 0; v < 8; v++)
        for (int y = 0; y < 64; y += 7)
            for (int x = 0; x < 64; x += 7) {
                double on[4], off[4];
                rays_aim(&r, views[v][0], views[v][1], 0.21, NULL);
                rays_shoot(&r, x, y, on);
                rays_aim(&r, views[v][0] + 1e-9, fmin(views[v][1] + 1e-9, 90), 0.21, NULL);
                rays_shoot(&r, x, y, off);
                assert_rgba(off, on, 1e-7);
            }
    rays_free(&r);
}

/* Turning the data by a quarter about z and the camera with it changes nothing. */
static void test_rotated_together(void **state)
{
    uint64_t seed = 7;
    const double spacing[3] = {1, 1.2, 0.9}, turned[3][3] = {{0, 1, 0}, {-1.2, 0, 0}, {0, 0, 0.9}};
    Rays a = {0}, b = {0};
    make(&a, 9, 8, 7, spacing, noise_hu, &seed);
    make(&b, 9, 8, 7, spacing, noise_hu, &seed);
    set_steps(b.volume, turned);
    a.preset = b.preset = cts_check_preset(hard_points, 7);
    for (int v = 0; v < 30; v++) {
        const double az = 360 * random_unit(&seed), el = 180 * random_unit(&seed) - 90;
        const double x = 64 * random_unit(&seed), y = 64 * random_unit(&seed);
        double on[4], off[4];
        rays_aim(&a, az, el, 0.3, NULL);
        rays_aim(&b, az + 90, el, 0.3, NULL);
        rays_shoot(&a, x, y, on);
        rays_shoot(&b, x, y, off);
        assert_rgba(off, on, 1e-9);
    }
    rays_free(&a);
    rays_free(&b);
}

static double marker_hu(const double vox[3], const void *data)
{
    const double *at = data;
    return vox[0] == at[0] && vox[1] == at[1] && vox[2] == at[2] ? 1000 : -1024;
}

/* One bright voxel: its position in the patient determines its pixel in each view. */
static void test_marker(void **state)
{
    const double spacing[3] = {1, 1, 1}, at[3] = {9, 1, 8}; /* left, front, head */
    const struct {
        double az, el;
        int right, up; /* +1: in the picture's right (upper) half */
    } views[] = {{0, 0, 1, 1}, {180, 0, -1, 1}, {90, 0, -1, 1}, {-90, 0, 1, 1}, {0, 90, 1, -1}, {0, -90, 1, 1}};
    Rays r = {0};
    make(&r, 11, 11, 11, spacing, marker_hu, at);
    r.preset = cts_check_preset((CtsCheckPoint[]){{0, 0, {1, 1, 1}}, {500, 0.9, {1, 1, 1}}}, 2);
    for (int v = 0; v < 6; v++) {
        rays_aim(&r, views[v].az, views[v].el, 0.2, NULL);
        double sum[2][2] = {{0, 0}, {0, 0}};
        for (int y = 0; y < 64; y++)
            for (int x = 0; x < 64; x++) {
                double rgba[4];
                rays_shoot(&r, x, y, rgba);
                sum[y < 32][x >= 32] += rgba[3];
            }
        const double inside = sum[views[v].up > 0][views[v].right > 0];
        assert_true(inside > 1);
        assert_near(sum[0][0] + sum[0][1] + sum[1][0] + sum[1][1], inside, 0);
    }
    rays_free(&r);
}

/* Extinction times spacing from 1e-8 to 1e6, opacity 1, ramps that end at 1: alpha and colour from the closed form. */
static void test_stiff(void **state)
{
    const double c[4] = {0, 0, 100, 0};
    for (int i = 0; i < 15; i++) {
        const double target = pow(10, i - 8); /* extinction * spacing at the far end */
        const double spacing_mm = fmax(target / 45, 0.01), spacing[3] = {spacing_mm, spacing_mm, spacing_mm};
        const double opacity = i == 14 ? 1 : -expm1(-target / spacing_mm);
        const CtsCheckPoint points[] = {
            {100, 0, {1, 0.2, 0}}, {600, opacity, {0, 0.9, 1}}, {900, opacity, {0.3, 0.3, 0.3}}};
        Rays r = {0};
        make(&r, 4, 11, 4, spacing, cts_hu_linear, c);
        r.preset = cts_check_preset(points, 3);
        for (int az = 0; az < 181; az += 60) {
            rays_aim(&r, az, 0, 0.01 * spacing_mm, NULL);
            double found[4], expected[4];
            rays_shoot(&r, 31, 31, found);
            expect_linear(&r, c, 31, 31, -1, expected);
            for (int k = 0; k < 4; k++)
                assert_near(found[k], expected[k], 1e-6 * fmin(target, 1) * 10);
        }
        rays_free(&r);
    }
}

/* HU where the ray is at t_mm, on the field's cubics. */
static double field_value(const CtsField *field, const CtsRay *ray, double t_mm)
{
    const CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRaySegment segment;
    do
        assert_true(field->next(field, &walk, &segment));
    while (segment.t1_mm < t_mm);
    return cts_cubic_at(segment.hu, (t_mm - segment.t0_mm) / (segment.t1_mm - segment.t0_mm));
}

/* The field of any kernel: a tent is the trilinear field, B-splines keep lines straight, a constant stays constant. */
static void test_kernel_fields(void **state)
{
    uint64_t seed = 9;
    const double spacing[3] = {1, 1.1, 0.9}, c[4] = {100, 20, 9, 25}, hu = 333;
    Rays r = {0};
    CtsField *field = NULL;
    CtsError err;
    make(&r, 12, 11, 10, spacing, noise_hu, &seed);
    r.preset = cts_check_preset(hard_points, 7);
    r.preset.ambient = 0.3;
    r.preset.diffuse = 0.7;
    for (int v = 0; v < 20; v++) {
        r.preset.shade = v % 2;
        const double az = 360 * random_unit(&seed), el = 180 * random_unit(&seed) - 90;
        double plain[4], fitted[4];
        rays_aim(&r, az, el, 0.2, NULL);
        rays_shoot(&r, 20 + v, 33, plain);
        assert_int_equal(cts_field_kernel(&field, r.volume, &r.scene.view, CTS_KERNEL_TENT, 1, &r.preset, &err),
                         CTS_OK);
        rays_aim(&r, az, el, 0.2, field);
        rays_shoot(&r, 20 + v, 33, fitted);
        assert_rgba(fitted, plain, r.preset.shade ? 2e-5 : 2e-6);
        cts_raycaster_free(&r.caster);
        free(field);
    }
    rays_free(&r);
    r.preset.shade = false;
    const double radius[CTS_N_KERNELS] = {1, 2, 1.5, 2, 1.5};
    for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++) {
        const bool linear = kernel == CTS_KERNEL_TENT || kernel == CTS_KERNEL_BSPLINE;
        make(&r, 30, 31, 29, spacing, linear ? cts_hu_linear : cts_hu_constant, linear ? c : &hu);
        rays_aim(&r, 0, 0, 0.2, NULL);
        assert_int_equal(
            cts_field_kernel(&field, r.volume, &r.scene.view, (CtsKernelId)kernel, radius[kernel], &r.preset, &err),
            CTS_OK);
        for (int i = 0; i < 20; i++) {
            const CtsRay ray = {.start_vox = {8 + 14 * random_unit(&seed), 0, 8 + 14 * random_unit(&seed)},
                                .step_vox = {0.1, 1, 0.2},
                                .t1_mm = 20};
            const double t = 20 * random_unit(&seed);
            const double vox[3] = {ray.start_vox[0] + 0.1 * t, t, ray.start_vox[2] + 0.2 * t};
            const double found = field_value(field, &ray, t);
            if (kernel == CTS_KERNEL_CONE_PAPER)
                assert_true(fabs(found - hu) > 1e-3 && fabs(found + 1024) < 2 * (hu + 1024));
            else
                assert_near(found, linear ? cts_hu_linear(vox, c) : hu, 1e-9);
        }
        cts_raycaster_free(&r.caster);
        free(field);
        rays_free(&r);
    }
}

static void test_cubic(void **state)
{
    const double line[4] = {-0.25, 1, 0, 0}, bump[4] = {0, 4, -4, 0}, wave[4] = {-0.096, 1.04, -2.4, 1.6};
    double u[3], low, high;
    assert_int_equal(cts_cubic_turns(line, u), 0);
    assert_near(cts_cubic_solve(line, 0, 0, 1), 0.25, 1e-16);
    assert_int_equal(cts_cubic_turns(bump, u), 1);
    assert_near(u[0], 0.5, 1e-16);
    cts_cubic_range(bump, &low, &high);
    assert_near(low, 0, 1e-16);
    assert_near(high, 1, 1e-16);
    assert_near(cts_cubic_mean(bump), 2.0 / 3, 1e-15);
    /* 1.6 (u - 0.12...)(...) crosses zero three times: each root must give zero and differ from the others. */
    const int n = cts_cubic_sign_changes(wave, u);
    for (int i = 0; i < n; i++) {
        assert_near(cts_cubic_at(wave, u[i]), 0, 1e-15);
        assert_true(i == 0 || u[i] > u[i - 1]);
    }
    const double roots[4] = {-0.1 * 0.5 * 0.7, 0.1 * 0.5 + 0.1 * 0.7 + 0.5 * 0.7, -1.3, 1};
    assert_int_equal(cts_cubic_sign_changes(roots, u), 3);
    assert_near(u[0], 0.1, 1e-15);
    assert_near(u[1], 0.5, 1e-15);
    assert_near(u[2], 0.7, 1e-15);
}

static void test_gauss(void **state)
{
    for (int n = 1; n <= CTS_GAUSS_FINE; n++) {
        CtsGauss g;
        cts_gauss_init(&g, n);
        for (int power = 0; power < 2 * n; power++) {
            double sum = 0;
            for (int i = 0; i < n; i++)
                sum += g.weight[i] * pow(g.node[i], power);
            assert_near(sum, 1.0 / (power + 1), 1e-14);
        }
        for (int power = 0; power < n; power++)
            for (int k = 0; k < n; k++) {
                double sum = 0;
                for (int j = 0; j < n; j++)
                    sum += g.upto[k][j] * pow(g.node[j], power);
                assert_near(sum, pow(g.node[k], power + 1) / (power + 1), 1e-14);
            }
    }
}

/* The spans must agree with the preset, cap included. */
static void test_transfer(void **state)
{
    uint64_t seed = 8;
    CtsPreset p = cts_check_preset(hard_points, 7);
    p.unit_distance_mm = 0.05; /* the cap lies at opacity 0.918 */
    CtsTransfer t;
    cts_transfer_init(&t, &p, 2);
    for (int i = 0; i < 20000; i++) {
        const double hu = 1100 * random_unit(&seed);
        const CtsSpan *s = &t.spans[cts_transfer_find(&t, hu)];
        assert_true(hu >= s->low_hu && hu < s->high_hu);
        const double expected = 2 * cts_preset_extinction_per_mm(&p, hu);
        const double found = s->flat_extinction
                                 ? s->extinction_per_mm
                                 : cts_transfer_extinction(&t, s->opacity + (hu - s->at_hu) * s->opacity_slope);
        assert_near(found, expected, 1e-10);
        assert_true(s->visible || expected == 0);
        assert_true(expected == 0 || cts_hu_wanted(&t.visible, hu, hu));
    }
    assert_false(cts_hu_wanted(&t.visible, -1000, 99.9));
    assert_false(cts_hu_wanted(&t.visible, 951, 3000));
    assert_true(cts_hu_wanted(&t.visible, 951, 3000) == 0 && cts_hu_wanted(&t.visible, 90, 3000));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slab),           cmocka_unit_test(test_linear),
        cmocka_unit_test(test_linear_lit),     cmocka_unit_test(test_lit_without_gradient),
        cmocka_unit_test(test_step_entry),     cmocka_unit_test(test_on_the_step),
        cmocka_unit_test(test_sphere_formula), cmocka_unit_test(test_sphere_voxels),
        cmocka_unit_test(test_modes_cubic),    cmocka_unit_test(test_noise_midpoint),
        cmocka_unit_test(test_threads),        cmocka_unit_test(test_thin),
        cmocka_unit_test(test_nearly_on_axis), cmocka_unit_test(test_rotated_together),
        cmocka_unit_test(test_marker),         cmocka_unit_test(test_stiff),
        cmocka_unit_test(test_kernel_fields),  cmocka_unit_test(test_cubic),
        cmocka_unit_test(test_gauss),          cmocka_unit_test(test_transfer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
