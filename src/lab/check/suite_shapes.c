/* Balls, checkerboards, markers, halves: properties that any true picture has. */
#include "lab/check/suite.h"

#include <math.h>
#include <string.h>

typedef struct Ball {
    double centre_vox, hu_centre, hu_per_vox;
} Ball;

static double hu_ball(const double vox[3], const void *data)
{
    const Ball *b = data;
    const double x = vox[0] - b->centre_vox, y = vox[1] - b->centre_vox, z = vox[2] - b->centre_vox;
    return b->hu_centre - b->hu_per_vox * sqrt(x * x + y * y + z * z);
}

static CtsStatus cube_volume(CtsVolume **volume, int n, double spacing_mm, CtsHuFormula hu, const void *data,
                             CtsError *err)
{
    return cts_check_volume(volume, (const int[3]){n, n, n}, (const double[3]){spacing_mm, spacing_mm, spacing_mm}, 1,
                            hu, data, err);
}

/* What a family may miss of a shape: bounds by CtsCheckFamily. */
typedef struct Bounds {
    double bound[CHECK_N_FAMILIES];
} Bounds;

static double bound_of(const CtsCheckRun *run, const void *bounds)
{
    return ((const Bounds *)bounds)->bound[cts_check_family(run->engine)];
}

/* Red counts along rays through a ball of radius 10 mm, closed form of the chord: L = 2 sqrt(R^2 - b^2). */
static CtsStatus ball(CtsCheckRun *run, const void *data, CtsError *err)
{
    const double h = 0.5;
    const Ball b = {.centre_vox = 26, .hu_centre = 36200, .hu_per_vox = 3000 * h};
    const CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{6200, 0, {1, 1, 1}}, {6200, 0.1, {1, 1, 1}}}, 2);
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsStatus st;
    CtsRenderSettings s = cts_check_settings(run, 48, 48);
    s.azimuth_deg = 25;
    s.elevation_deg = 15;
    s.mm_per_pixel = 0.5;
    if ((st = cube_volume(&volume, 53, h, hu_ball, &b, err)) ||
        (st = cts_check_render(run, volume, &preset, &s, &picture, err)))
        goto end;
    CtsCheckWorst worst = {0};
    for (int y = 0; y < 48; y++)
        for (int x = 0; x < 48; x++) {
            const double off = hypot((x + 0.5 - 24) * 0.5, (24 - y - 0.5) * 0.5);
            if (off < 9 || off > 10.5)
                cts_check_worst(&worst, x, y, off < 10 ? -expm1(2 * sqrt(100 - off * off) * log(0.9)) : 0,
                                (double)picture->pixels[4 * (48 * y + x) + 3]);
        }
    cts_check_worst_value(run, &worst, bound_of(run, data));
end:
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

/* Half the spacing, a quarter of the distance from the ball: the voxels' own order, 2. */
static CtsStatus ball_order(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{6200, 0, {1, 1, 1}}, {6200, 0.1, {1, 1, 1}}}, 2);
    CtsStatus st = CTS_OK;
    double rms[2] = {0, 0};
    for (int level = 0; level < 2 && !st; level++) {
        const double h = level == 0 ? 1 : 0.5;
        const int n = level == 0 ? 27 : 53;
        const Ball b = {.centre_vox = n / 2, .hu_centre = 36200, .hu_per_vox = 3000 * h};
        CtsVolume *volume = NULL;
        CtsPicture *picture = NULL;
        CtsRenderSettings s = cts_check_settings(run, 60, 60);
        s.azimuth_deg = 37;
        s.elevation_deg = 21;
        s.mm_per_pixel = 0.22;
        s.samples = 8;
        if (!(st = cube_volume(&volume, n, h, hu_ball, &b, err)))
            st = cts_check_render(run, volume, &preset, &s, &picture, err);
        for (int i = 0; i < 60 * 60 && !st; i++) {
            const double off = hypot((i % 60 + 0.5 - 30) * 0.22, (i / 60 + 0.5 - 30) * 0.22);
            const double d = -expm1(2 * sqrt(100 - off * off) * log(0.9)) - (double)picture->pixels[4 * i + 3];
            rms[level] += d * d / 3600;
        }
        cts_picture_free(&picture);
        cts_volume_free(&volume);
    }
    if (!st)
        cts_check_value(run, 2, 0.5 * log2(rms[0] / rms[1]), bound_of(run, data));
    return st;
}

static double hu_checkers(const double vox[3], const void *data)
{
    (void)data;
    return fmod(vox[0] + vox[1] + vox[2], 2) > 0 ? 64511 : -1024;
}

/* Along a column of 16-bit extremes HU runs straight up and down between voxels. */
static void checkers_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { N = 11 };
    CtsTruthStretch stretch[N - 1];
    double p[3];
    if (!ray)
        return;
    cts_truth_ray_point(ray, ray->from_mm, p);
    for (int j = 0; j < N - 1; j++) {
        const double a[3] = {round(p[0]), j, round(p[2])}, b[3] = {a[0], j + 1, a[2]};
        stretch[j] = (CtsTruthStretch){hu_checkers(a, NULL), hu_checkers(b, NULL), 1, -1};
    }
    cts_truth_stretches(data, 1, stretch, N - 1, rgba);
}

static CtsStatus checkers(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsPreset preset = cts_check_preset(
        (const CtsCheckPoint[]){{-1024, 0, {0, 0, 1}}, {20000, 0.3, {0, 1, 0}}, {64511, 0.1, {1, 0.5, 0}}}, 3);
    CtsVolume *volume = NULL;
    CtsRenderSettings s = cts_check_settings(run, 11, 11);
    s.mm_per_pixel = 1;
    CtsStatus st = cube_volume(&volume, 11, 1, hu_checkers, NULL, err);
    if (!st)
        st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &s, checkers_truth, &preset},
                               bound_of(run, data), err);
    cts_volume_free(&volume);
    return st;
}

static double hu_marker(const double vox[3], const void *data)
{
    const double *at = data;
    return fabs(vox[0] - at[0]) + fabs(vox[1] - at[1]) + fabs(vox[2] - at[2]) < 2 ? 1500 : -1024;
}

/* A marker at the patient's left, front and head: the share of light in the quarter of the picture where it belongs. */
typedef struct MarkerView {
    double azimuth_deg, elevation_deg;
    int right, up;
} MarkerView;

static CtsStatus marker(CtsCheckRun *run, const void *data, CtsError *err)
{
    const MarkerView *view = data;
    const double at[3] = {20, 5, 19};
    const CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{0, 0, {1, 1, 1}}, {400, 0.9, {1, 1, 1}}}, 2);
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsStatus st;
    CtsRenderSettings s = cts_check_settings(run, 50, 50);
    s.azimuth_deg = view->azimuth_deg;
    s.elevation_deg = view->elevation_deg;
    if ((st = cube_volume(&volume, 25, 1, hu_marker, at, err)) ||
        (st = cts_check_render(run, volume, &preset, &s, &picture, err)))
        goto end;
    double all = 0, inside = 0;
    for (int y = 0; y < 50; y++)
        for (int x = 0; x < 50; x++) {
            const double alpha = (double)picture->pixels[4 * (50 * y + x) + 3];
            all += alpha;
            inside += (x >= 25) == (view->right > 0) && (y < 25) == (view->up > 0) ? alpha : 0;
        }
    cts_check_value(run, 1, all > 1 ? inside / all : 0, 0);
end:
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

/* Two pictures' largest difference; b is seen mirrored left to right where asked. */
static double largest(const CtsPicture *a, const CtsPicture *b, bool mirrored)
{
    double most = 0;
    for (int y = 0; y < a->height; y++)
        for (int x = 0; x < a->width; x++)
            for (int c = 0; c < 4; c++) {
                const int from = mirrored ? a->width - 1 - x : x;
                const double d = fabs((double)a->pixels[4 * (y * a->width + x) + c] -
                                      (double)b->pixels[4 * (y * a->width + from) + c]);
                most = d > most || isnan(d) ? d : most;
            }
    return most;
}

static const double noise_range[3] = {-200, 1200, 5};

static double hu_noise_mirrored(const double vox[3], const void *data)
{
    return cts_hu_noise((const double[3]){18 - vox[0], vox[1], vox[2]}, data);
}

static CtsPreset noise_preset(void)
{
    return cts_check_preset(
        (const CtsCheckPoint[]){{100, 0, {0.9, 0.4, 0.3}}, {700, 0.2, {1, 0.9, 0.6}}, {1100, 0.5, {1, 1, 1}}}, 3);
}

/* Renders the same noise twice, changed as the case says, and states the largest difference. */
static CtsStatus render_both(CtsCheckRun *run, CtsVolume *const volume[2], const double azimuth_deg[2], bool mirrored,
                             double bound, CtsError *err)
{
    const CtsPreset preset = noise_preset();
    CtsPicture *picture[2] = {NULL, NULL};
    CtsStatus st = CTS_OK;
    for (int i = 0; i < 2 && !st; i++) {
        CtsRenderSettings s = cts_check_settings(run, 40, 40);
        s.azimuth_deg = azimuth_deg[i];
        s.elevation_deg = 14;
        st = cts_check_render(run, volume[i], &preset, &s, &picture[i], err);
    }
    if (!st)
        cts_check_value(run, 0, largest(picture[0], picture[1], mirrored), bound);
    cts_picture_free(&picture[0]);
    cts_picture_free(&picture[1]);
    return st;
}

/* Patient and camera turned by the same quarter turn. */
static CtsStatus turned(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsVolume *volume[2] = {NULL, NULL};
    CtsStatus st;
    if (!(st = cube_volume(&volume[0], 19, 1, cts_hu_noise, noise_range, err)) &&
        !(st = cube_volume(&volume[1], 19, 1, cts_hu_noise, noise_range, err))) {
        const double steps[3][3] = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}};
        memcpy(volume[1]->step_lps, steps, sizeof steps);
        st = render_both(run, volume, (const double[2]){23, 113}, false, bound_of(run, data), err);
    }
    cts_volume_free(&volume[0]);
    cts_volume_free(&volume[1]);
    return st;
}

/* The mirrored patient from the mirrored side is the mirrored picture. */
static CtsStatus mirrored(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsVolume *volume[2] = {NULL, NULL};
    CtsStatus st;
    if (!(st = cube_volume(&volume[0], 19, 1, cts_hu_noise, noise_range, err)) &&
        !(st = cube_volume(&volume[1], 19, 1, hu_noise_mirrored, noise_range, err)))
        st = render_both(run, volume, (const double[2]){31, -31}, true, bound_of(run, data), err);
    cts_volume_free(&volume[0]);
    cts_volume_free(&volume[1]);
    return st;
}

static double hu_noise_from(const double vox[3], const void *data)
{
    const double *range = data;
    return cts_hu_noise((const double[3]){vox[0], vox[1] + range[3], vox[2]}, range);
}

/* Front and back half, one over the other, are the whole: layer `cut` bounds both. */
static CtsStatus halves(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsPreset preset = noise_preset();
    const int first[3] = {0, 0, 7}, length[3] = {21, 8, 14};
    CtsPicture *picture[3] = {NULL, NULL, NULL};
    CtsStatus st = CTS_OK;
    for (int i = 0; i < 3 && !st; i++) {
        const double range[4] = {-200, 1200, 9, first[i]};
        CtsVolume *volume = NULL;
        CtsRenderSettings s = cts_check_settings(run, 40, 40);
        s.mm_per_pixel = 0.37;
        if (!(st = cts_check_volume(&volume, (const int[3]){19, length[i], 19}, (const double[3]){1, 1, 1}, 1,
                                    hu_noise_from, range, err)))
            st = cts_check_render(run, volume, &preset, &s, &picture[i], err);
        cts_volume_free(&volume);
    }
    CtsCheckWorst worst = {0};
    for (int i = 0; i < 40 * 40 && !st; i++)
        for (int c = 0; c < 4; c++)
            cts_check_worst(&worst, i % 40, i / 40,
                            (double)picture[1]->pixels[4 * i + c] +
                                (1 - (double)picture[1]->pixels[4 * i + 3]) * (double)picture[2]->pixels[4 * i + c],
                            (double)picture[0]->pixels[4 * i + c]);
    if (!st)
        cts_check_worst_value(run, &worst, bound_of(run, data));
    for (int i = 0; i < 3; i++)
        cts_picture_free(&picture[i]);
    return st;
}

static double hu_wall(const double vox[3], const void *data)
{
    const double *range = data;
    return vox[1] < 4 ? 3000 : cts_hu_noise(vox, range);
}

/* What stands behind an opaque wall is not seen. */
static CtsStatus wall(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsPreset preset = noise_preset();
    preset.opacity[2].opacity = 1;
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsStatus st;
    CtsRenderSettings s = cts_check_settings(run, 40, 40);
    s.mm_per_pixel = 0.3;
    if (!(st = cube_volume(&volume, 19, 1, hu_wall, noise_range, err)))
        st = cts_check_render(run, volume, &preset, &s, &picture, err);
    CtsCheckWorst worst = {0};
    for (int i = 0; i < 4 * 40 * 40 && !st; i++)
        cts_check_worst(&worst, i / 4 % 40, i / 160, 1, (double)picture->pixels[i]);
    if (!st)
        cts_check_worst_value(run, &worst, bound_of(run, data));
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

/* One cell of eight unlike voxels, along which HU rises and falls: dense straight stretches stand for the cubic. */
typedef struct CellTruth {
    const CtsVolume *volume;
    const CtsPreset *preset;
} CellTruth;

static double cell_hu(const CtsVolume *v, const CtsTruthRay *ray, double t_mm)
{
    double point[3], at[3], hu = 0;
    cts_truth_ray_point(ray, t_mm, point);
    cts_truth_voxel(v, point, at);
    for (int m = 0; m < 8; m++) {
        double weight = 1;
        for (int a = 0; a < 3; a++)
            weight *= m >> a & 1 ? at[a] : 1 - at[a];
        hu += weight * cts_volume_hu(v, v->grey[m]);
    }
    return hu;
}

static void cell_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { N = 1500 };
    static const double length = 1.0 / N;
    const CellTruth *c = data;
    CtsTruthStretch stretch[N];
    double most = -INFINITY;
    if (!ray)
        return;
    for (int i = 0; i < N; i++) {
        const double step = (ray->to_mm - ray->from_mm) * length, t = ray->from_mm + i * step;
        stretch[i] = (CtsTruthStretch){cell_hu(c->volume, ray, t), cell_hu(c->volume, ray, t + step), step, -1};
        most = fmax(most, stretch[i].hu1);
    }
    if (c->preset->mode == CTS_MODE_COMPOSITE) {
        cts_truth_stretches(c->preset, 1, stretch, N, rgba);
        return;
    }
    rgba[0] = rgba[1] = rgba[2] = fmin(fmax(fmax(most, stretch[0].hu0) / 1000, 0), 1);
    rgba[3] = 1;
}

static const double cell_range[3] = {0, 1000, 77};

static CtsStatus one_cell(CtsCheckRun *run, CtsMode mode, double bound, CtsError *err)
{
    /* Stripes, so that HU turns within one of them on most rays. */
    CtsCheckPoint stripes[20];
    for (int i = 0; i < 20; i++)
        stripes[i] =
            (CtsCheckPoint){50 * (i / 2 * 2 + 1), i % 4 == 1 || i % 4 == 2 ? 0.1 : 0.01, {1, 0.1 * (i / 2), 0.5}};
    CtsPreset preset = cts_check_preset(stripes, 20);
    CtsVolume *volume = NULL;
    CtsRenderSettings s = cts_check_settings(run, 10, 10);
    s.azimuth_deg = 38;
    s.elevation_deg = 33;
    preset.mode = mode;
    CtsStatus st = cts_check_volume(&volume, (const int[3]){2, 2, 2}, (const double[3]){10, 10, 10}, 1, cts_hu_noise,
                                    cell_range, err);
    const CellTruth truth = {volume, &preset};
    if (!st)
        st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &s, cell_truth, &truth}, bound, err);
    cts_volume_free(&volume);
    return st;
}

static CtsStatus cell(CtsCheckRun *run, const void *data, CtsError *err)
{
    return one_cell(run, CTS_MODE_COMPOSITE, bound_of(run, data), err);
}

static CtsStatus cell_mip(CtsCheckRun *run, const void *data, CtsError *err)
{
    return one_cell(run, CTS_MODE_MIP, bound_of(run, data), err);
}

/* Haze of one grey level for 200 mm, then a wall of the largest extinction: the one must not spoil the other. */
static double hu_haze(const double vox[3], const void *data)
{
    (void)data;
    return vox[1] <= 200 ? 200 : 3000;
}

static void haze_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    const CtsTruthStretch stretch[3] = {{200, 200, 200, -1}, {200, 3000, 1, -1}, {3000, 3000, 4, -1}};
    if (ray)
        cts_truth_stretches(data, 1, stretch, 3, rgba);
}

static CtsStatus haze(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsPreset preset = cts_check_preset(
        (const CtsCheckPoint[]){{0, 2.36e-4, {1, 0, 0}}, {400, 2.36e-4, {1, 0, 0}}, {401, 1, {0, 1, 0}}}, 3);
    CtsVolume *volume = NULL;
    CtsRenderSettings s = cts_check_settings(run, 9, 9);
    s.mm_per_pixel = 0.3;
    CtsStatus st =
        cts_check_volume(&volume, (const int[3]){5, 206, 5}, (const double[3]){1, 1, 1}, 1, hu_haze, NULL, err);
    if (!st)
        st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &s, haze_truth, &preset}, bound_of(run, data),
                               err);
    cts_volume_free(&volume);
    return st;
}

/* Distance of an opaque plane from the camera plane, which touches the box's bounding sphere. */
static CtsStatus plane_depth(CtsCheckRun *run, const void *data, CtsError *err)
{
    const double slope[4] = {0, 0, 100, 0};
    const CtsPreset preset = cts_check_preset((const CtsCheckPoint[]){{770, 0, {1, 1, 1}}, {770, 1, {1, 1, 1}}}, 2);
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsStatus st;
    CtsRenderSettings s = cts_check_settings(run, 20, 20);
    s.mm_per_pixel = 0.4;
    s.want_depth = true;
    if (!(st = cube_volume(&volume, 17, 1, cts_hu_linear, slope, err)))
        st = cts_check_render(run, volume, &preset, &s, &picture, err);
    CtsCheckWorst worst = {0};
    for (int i = 0; i < 20 * 20 && !st; i++)
        cts_check_worst(&worst, i % 20, i / 20, 8 * sqrt(3) - 8 + 7.7,
                        picture->depth_mm ? (double)picture->depth_mm[i] : NAN);
    if (!st)
        cts_check_worst_value(run, &worst, bound_of(run, data));
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

/* No NaN, no alpha outside 0..1, no colour above alpha, roundings apart: the number of values that break this. */
static CtsStatus sane(CtsCheckRun *run, const void *data, CtsError *err)
{
    const double range[3] = {-1024, 64511, 3};
    CtsPreset preset = noise_preset();
    CtsVolume *volume = NULL;
    CtsStatus st = cts_check_volume(&volume, (const int[3]){23, 17, 29}, (const double[3]){0.3, 7, 1.1}, 1,
                                    cts_hu_noise, range, err);
    double bad = 0;
    (void)data;
    for (int v = 0; v < 12 && !st; v++) {
        CtsRenderSettings s = cts_check_settings(run, 31, 33);
        CtsPicture *picture = NULL;
        s.azimuth_deg = 30 * v + (v % 3 ? 0 : 1e-9);
        s.elevation_deg = 15 * v - 90;
        preset.shade = v % 2;
        preset.ambient = 0.5;
        preset.diffuse = 0.5;
        preset.power = 5;
        st = cts_check_render(run, volume, &preset, &s, &picture, err);
        for (int i = 0; i < 31 * 33 && !st; i++) {
            const float *p = picture->pixels + 4 * i;
            for (int c = 0; c < 4; c++)
                bad += !(p[c] >= 0 && p[c] <= 1 + 1e-5f && p[c] <= p[3] + 1e-5f);
        }
        cts_picture_free(&picture);
    }
    cts_volume_free(&volume);
    if (!st)
        cts_check_value(run, 0, bad, 0);
    return st;
}

#define BOUNDS(PAPER, TILED, RAYCAST)                                                                                  \
    &(const Bounds)                                                                                                    \
    {                                                                                                                  \
        {                                                                                                              \
            PAPER, TILED, RAYCAST                                                                                      \
        }                                                                                                              \
    }
#define MARKER(AZ, EL, RIGHT, UP)                                                                                      \
    CHECK_OF_ALL, marker, &(const MarkerView)                                                                          \
    {                                                                                                                  \
        AZ, EL, RIGHT, UP                                                                                              \
    }

static const CtsCheckCase cases[] = {
    {"ball: chords", CHECK_OF_ALL, ball, BOUNDS(3e-2, 3e-3, 2e-3)},
    {"ball: order in spacing", CHECK_OF_TILED | CHECK_OF_RAYCAST, ball_order, BOUNDS(0, 0.15, 0.15)},
    {"range: checkerboard of 16-bit extremes", CHECK_OF_TILED | CHECK_OF_RAYCAST, checkers, BOUNDS(0, 1e-3, 1e-6)},
    {"cell: HU turns inside", CHECK_OF_TILED | CHECK_OF_RAYCAST, cell, BOUNDS(0, 1.2e-2, 1e-5)},
    {"cell: HU turns inside, mip", CHECK_OF_TILED | CHECK_OF_RAYCAST, cell_mip, BOUNDS(0, 1e-5, 1e-5)},
    {"marker: left, front, head from anterior", MARKER(0, 0, 1, 1)},
    {"marker: left, front, head from posterior", MARKER(180, 0, -1, 1)},
    {"marker: left, front, head from left", MARKER(90, 0, -1, 1)},
    {"marker: left, front, head from right", MARKER(-90, 0, 1, 1)},
    {"marker: left, front, head from head", MARKER(0, 90, 1, -1)},
    {"marker: left, front, head from feet", MARKER(0, -90, 1, 1)},
    {"same: patient and camera turned", CHECK_OF_ALL, turned, BOUNDS(1e-5, 1e-5, 1e-6)},
    {"same: mirrored patient, mirrored picture", CHECK_OF_ALL, mirrored, BOUNDS(1e-5, 4 * CHECK_PROMISED, 1e-6)},
    {"same: two halves are the whole", CHECK_OF_ALL, halves, BOUNDS(1e-5, 2 * CHECK_PROMISED, 1e-6)},
    {"same: an opaque wall hides what is behind", CHECK_OF_ALL, wall, BOUNDS(1e-5, 1e-5, 1e-6)},
    {"range: faint haze before an opaque wall", CHECK_OF_ALL, haze, BOUNDS(1e-4, 5e-4, 1e-6)},
    {"depth: an opaque plane", CHECK_OF_ALL, plane_depth, BOUNDS(0.4, 0.03, 0.02)},
    {"range: no NaN, alpha 0 to 1", CHECK_OF_ALL, sane, NULL},
};

const CtsCheckTable cts_check_shapes = {cases, sizeof cases / sizeof *cases};
