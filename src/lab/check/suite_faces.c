/* A box of one tissue, filled to the border of the volume: beyond it is air, so that the faces where a scan cuts
 * through the body are lit as surfaces, and nothing inside is. */
#include "lab/check/suite.h"

#include <math.h>
#include <string.h>

typedef struct Scene {
    const CtsVolume *volume;
    const CtsPreset *preset;
    double per_mm[3][3]; /* of what differences are taken over, along each axis: how many a millimetre along each
                            patient axis spans */
} Scene;

static int layers(const CtsVolume *volume, int axis)
{
    return axis == 2 ? volume->slice_layers : 1;
}

/* The differences at the voxels are alike on all faces, as far in as they reach to the air, and 0 inside: what is
 * interpolated of one. */
static double rise(const CtsVolume *volume, int axis, double vox)
{
    const int reach = layers(volume, axis);
    return fmin(fmax(reach - vox, 0), 1) - fmin(fmax(vox - (volume->dims[axis] - 1 - reach), 0), 1);
}

/* |n.v| where the ray is at t; -1 without a gradient, which the preset makes the same as 0. */
static double facing_at(const Scene *s, const CtsTruthRay *ray, double t_mm)
{
    double vox[3], mm[3] = {0}, along = 0, length = 0;
    cts_truth_ray_voxel(s->volume, ray, t_mm, vox);
    for (int axis = 0; axis < 3; axis++)
        for (int c = 0; c < 3; c++)
            mm[c] += rise(s->volume, axis, vox[axis]) * s->per_mm[axis][c];
    for (int c = 0; c < 3; c++) {
        along += mm[c] * ray->direction_lps[c];
        length += mm[c] * mm[c];
    }
    return length > 1e-20 ? fmin(fabs(along) / sqrt(length), 1) : 0;
}

/* Where the ray passes from the cells at a face to those inside, in order; returns how many. */
static int find_cuts(const Scene *s, const CtsTruthRay *ray, double cut[8])
{
    double va[3], vb[3];
    int n = 0;
    cts_truth_ray_voxel(s->volume, ray, 0, va);
    cts_truth_ray_voxel(s->volume, ray, 1, vb);
    cut[n++] = ray->from_mm;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            const int reach = layers(s->volume, axis), plane = side ? s->volume->dims[axis] - 1 - reach : reach;
            const double t = (plane - va[axis]) / (vb[axis] - va[axis]);
            if (!(t > ray->from_mm && t < ray->to_mm))
                continue;
            int at = n++;
            for (; at > 1 && cut[at - 1] > t; at--)
                cut[at] = cut[at - 1];
            cut[at] = t;
        }
    cut[n++] = ray->to_mm;
    return n;
}

/* At one face the direction of the gradient does not change; where faces meet it turns, and short stretches follow. */
static void truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { TURN = 400 };
    const Scene *s = data;
    if (!ray)
        return;
    const double hu = cts_volume_hu(s->volume, s->volume->grey[0]);
    CtsTruthStretch stretches[8 * TURN];
    double cut[8];
    const int n_cuts = find_cuts(s, ray, cut);
    int n = 0;
    for (int i = 0; i + 1 < n_cuts; i++) {
        double vox[3];
        /* Not in the middle: between two layers it has no gradient. */
        const double aside = cut[i] + 0.3 * (cut[i + 1] - cut[i]);
        cts_truth_ray_voxel(s->volume, ray, aside, vox);
        int faces = 0;
        for (int axis = 0; axis < 3; axis++)
            faces += rise(s->volume, axis, vox[axis]) != 0;
        const int parts = faces > 1 ? TURN : 1;
        const double length = (cut[i + 1] - cut[i]) / parts;
        for (int p = 0; p < parts; p++) {
            const double at = parts > 1 ? cut[i] + (p + 0.5) * length : aside;
            stretches[n++] = (CtsTruthStretch){hu, hu, length, facing_at(s, ray, at)};
        }
    }
    cts_truth_stretches(s->preset, 1, stretches, n, rgba);
}

static void find_axes(Scene *s)
{
    double vox[3], beside[3];
    cts_truth_voxel(s->volume, s->volume->origin_lps, vox);
    for (int c = 0; c < 3; c++) {
        double point[3];
        memcpy(point, s->volume->origin_lps, sizeof point);
        point[c] += 1;
        cts_truth_voxel(s->volume, point, beside);
        for (int axis = 0; axis < 3; axis++)
            s->per_mm[axis][c] = (beside[axis] - vox[axis]) / layers(s->volume, axis);
    }
}

static CtsStatus box(CtsCheckRun *run, const void *data, CtsError *err)
{
    CtsMadeScene m;
    CtsStatus st = cts_check_make(run, data, &m, err);
    if (st)
        return st;
    Scene scene = {.volume = m.volume, .preset = &m.preset};
    find_axes(&scene);
    st = cts_check_picture(run, &m, truth, &scene, cts_check_bound(run, data), err);
    cts_volume_free(&m.volume);
    return st;
}

static const CtsCheckPoint of_3[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.03, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint of_10[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.1, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint of_90[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.9, {0.2, 0.5, 0.9}}};

#define BOX(NAME, AZ, EL, ...)                                                                                         \
    CHECK_SCENE(NAME, CHECK_OF_ALL, box, .hu = {500}, .lit = true, CHECK_SIZE(21, 21), CHECK_VIEW(AZ, EL), __VA_ARGS__)
#define SIZE .dims = {17, 14, 11}
#define HAZE CHECK_POINTS(of_3)
#define FOG CHECK_POINTS(of_10)

/* A layer's gradient at the faces ends within a voxel: the paper's planes, one a layer, give it half of that. */
static const CtsCheckCase cases[] = {
    BOX("cut faces: anterior", 0, 0, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: left", 90, 0, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: head", 0, 90, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: feet, nearly opaque", 0, -90, SIZE, .samples = 16, CHECK_POINTS(of_90),
        .bound = {8e-3, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: oblique", 20, 15, SIZE, HAZE, .bound = {3e-2, 1.2e-2, 2e-6}),
    BOX("cut faces: oblique, more samples", 20, 15, SIZE, .samples = 16, HAZE, .bound = {3e-3, 1e-3, 2e-6}),
    BOX("cut faces: onto an edge", 45, 0, SIZE, .samples = 16, FOG, .bound = {6e-3, 1e-3, 2e-6}),
    BOX("cut faces: onto a corner", 45, 35.26, SIZE, .samples = 16, FOG, .bound = {6e-3, 4e-3, 2e-6}),
    BOX("cut faces: leaning slices, spacing 1:2:3", -15, 70, SIZE, .spacing_mm = {1, 2, 3}, .lean = 0.3, .samples = 16,
        HAZE, .bound = {6e-3, 6e-3, 2e-6}),
    BOX("cut faces: 3 layers to a slice", -35, 40, SIZE, .layers = 3, .samples = 16, HAZE, .bound = {6e-3, 4e-3, 2e-6}),
    BOX("cut faces: two layers", 10, 60, .dims = {17, 14, 2}, .samples = 16, FOG, .bound = {6e-3, 1e-3, 2e-6}),
};

const CtsCheckTable cts_check_faces = {cases, sizeof cases / sizeof *cases};
