/* The ray caster's lighting: highlights narrower than a cell, normals that reverse within a point. */
#include "rays.h"
#include <stdint.h>

/* Black except for its highlight, so that a missed highlight cannot be compensated. */
static CtsPreset shining(double opacity, double power)
{
    CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{0, opacity, {0, 0, 0}}}, 1);
    preset.shade = true;
    preset.ambient = preset.diffuse = 0;
    preset.specular = 1;
    preset.power = power;
    return preset;
}

static void aim(Rays *r, const int dims[3], CtsHuFormula hu, const void *data, double azimuth_deg, double elevation_deg)
{
    CtsError err = {0};
    const double spacing_mm[3] = {1, 1, 1};
    assert_int_equal(cts_check_volume(&r->volume, dims, spacing_mm, 1, hu, data, &err), CTS_OK);
    rays_aim(r, azimuth_deg, elevation_deg, 0.05, NULL);
}

/* A normal that sweeps past the viewing direction within one segment: tan(n, v) = slope (u - u0), hence the highlight
 * is (1 + slope^2 (u - u0)^2)^(-p/2), whose integral over all u is sqrt(pi) G((p-1)/2) / G(p/2) / slope and whose
 * variance is 1 / (p - 3) / slope^2; transmittance is exp(-depth u). */
static void test_narrow_highlights(void **state)
{
    static const double powers[] = {20, 200, 1000}, slopes[] = {300, 1e4, 1e6, 1e9}, depths[] = {0.01, 1, 6};
    const double hu = 100;
    for (int k = 0; k < 3 * 4 * 3; k++) {
        const double power = powers[k % 3], slope = slopes[k / 3 % 4], depth = depths[k / 12];
        Rays r = {.preset = shining(-expm1(-depth / 10), power)};
        aim(&r, (const int[3]){3, 3, 3}, cts_hu_constant, &hu, 0, 0);
        for (int i = 1; i < 60; i++) {
            const double at = i / 60.0 + 0.001, from_mm = 3, length_mm = 10;
            const CtsRaySegment segment = {.t0_mm = from_mm, .t1_mm = from_mm + length_mm, .hu = {hu}};
            /* Anterior: right is +x, forward +y. */
            const double gradient[3][4] = {{-7 * slope * at, 7 * slope}, {7}, {0}};
            CtsRaySum light = {.transmittance = 1, .surface_mm = INFINITY};
            cts_raycast_segment(r.caster, &r.caster->transfer, &(CtsRay){.t1_mm = 20}, &segment, gradient, &light);
            const double area = sqrt(M_PI) * exp(lgamma((power - 1) / 2) - lgamma(power / 2)) / slope;
            const double variance = 1 / (power - 3) / (slope * slope);
            const double expected = depth * exp(-depth * at) * area * (1 + depth * depth * variance / 2);
            /* The tails beyond the segment's ends are less than this. */
            assert_near(light.rgb[0], expected, 1e-8);
            assert_near(light.depth, depth, 1e-12);
        }
        rays_free(&r);
    }
}

enum { SIDE = 5 };

static int noise_at(int x, int y, int z)
{
    uint32_t h = (uint32_t)x * 73856093u ^ (uint32_t)y * 19349663u ^ (uint32_t)z * 83492791u;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    return (int)((h ^ (h >> 15)) % 1000);
}

static double noise_hu(const double vox[3], const void *data)
{
    return noise_at((int)vox[0], (int)vox[1], (int)vox[2]);
}

static double difference(int x, int y, int z, int axis)
{
    int low[3] = {x, y, z}, high[3] = {x, y, z};
    low[axis] -= low[axis] > 0;
    high[axis] += high[axis] < SIDE - 1;
    return (double)(noise_at(high[0], high[1], high[2]) - noise_at(low[0], low[1], low[2])) / (high[axis] - low[axis]);
}

/* |n.v| at a place, from the gradients of its cell's corners. */
static double facing_at(const double vox[3], const double forward[3])
{
    int cell[3];
    double part[3], g[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++) {
        cell[a] = (int)fmin(fmax(floor(vox[a]), 0), SIDE - 2);
        part[a] = vox[a] - cell[a];
    }
    for (int m = 0; m < 8; m++) {
        double weight = 1;
        for (int a = 0; a < 3; a++)
            weight *= m >> a & 1 ? part[a] : 1 - part[a];
        for (int a = 0; a < 3; a++)
            g[a] += weight * difference(cell[0] + (m & 1), cell[1] + (m >> 1 & 1), cell[2] + (m >> 2 & 1), a);
    }
    return fabs(g[0] * forward[0] + g[1] * forward[1] + g[2] * forward[2]) /
           sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
}

/* Noise, whose normals vary in every cell, against a plain sum over very short steps. */
static void test_noise(void **state)
{
    enum { STEPS = 60000 };
    const double opacity = 0.2, power = 1000;
    Rays r = {.preset = shining(opacity, power)};
    aim(&r, (const int[3]){SIDE, SIDE, SIDE}, noise_hu, NULL, 31, 17);
    for (int x = 2; x < 64; x += 3) {
        CtsTruthRay ray;
        double found[4], vox[2][3], point[3], forward[3], expected = 0;
        assert_true(rays_truth(&r, x, 31, &ray));
        for (int end = 0; end < 2; end++) {
            cts_truth_ray_point(&ray, end ? ray.to_mm : ray.from_mm, point);
            cts_truth_voxel(r.volume, point, vox[end]);
        }
        const double length = ray.to_mm - ray.from_mm, step = length / STEPS;
        for (int a = 0; a < 3; a++)
            forward[a] = (vox[1][a] - vox[0][a]) / length;
        for (int i = 0; i < STEPS; i++) {
            const double t = (i + 0.5) / STEPS;
            const double at[3] = {vox[0][0] + t * (vox[1][0] - vox[0][0]), vox[0][1] + t * (vox[1][1] - vox[0][1]),
                                  vox[0][2] + t * (vox[1][2] - vox[0][2])};
            expected +=
                -expm1(log1p(-opacity) * step) * exp(log1p(-opacity) * step * i) * pow(facing_at(at, forward), power);
        }
        rays_shoot(&r, x, 31, found);
        assert_near(found[0], expected, 1e-7);
    }
    rays_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_narrow_highlights),
        cmocka_unit_test(test_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
