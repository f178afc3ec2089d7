/* Fields of kernels other than the trilinear one, approximated by fitted cubics. */
#include "base/clamp.h"
#include "base/compare.h"
#include "core/scene/shade.h"
#include "ctsplat/bounds.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/field.h"
#include <math.h>
#include <stdlib.h>

/* A cubic is good when it is within this: HU, and HU per voxel for gradients. */
#define FIT_HU 1e-3
#define FIT_GRADIENT 1e-2

typedef struct KernelField {
    CtsField field;
    const CtsVolume *volume;
    int axis, u_axis, v_axis;
    CtsKernelId kernel;
    double radius;
    double shortest_mm; /* of a segment */
    bool lit, air_beyond;
} KernelField;

static double cubic_bspline(double x)
{
    /* Polynomial pieces of the convolution of four unit boxes. */
    const double a = fmax(2 - fabs(x), 0), b = fmax(1 - fabs(x), 0);
    return (a * a * a - 4 * b * b * b) / 6;
}

/* A voxel's kernel at (u, v) voxels from it, ending at radius, by the kernels' definitions: independent of the
 * footprint tables, which it validates. Gaussians have a sigma of 0.3 radius; cone-paper has unit volume. */
static double kernel_at(CtsKernelId kernel, double u, double v, double radius)
{
    const double r = sqrt(u * u + v * v) / radius;
    switch (kernel) {
    case CTS_KERNEL_TENT:
        return fmax(1 - fabs(u / radius), 0) * fmax(1 - fabs(v / radius), 0);
    case CTS_KERNEL_BSPLINE:
        return cubic_bspline(2 * u / radius) * cubic_bspline(2 * v / radius);
    case CTS_KERNEL_GAUSSIAN:
        return r < 1 ? exp(-r * r / (2 * 0.3 * 0.3)) : 0;
    case CTS_KERNEL_CONE_PAPER:
        return fmax(1 - r, 0) * 3 / (M_PI * radius * radius);
    case CTS_KERNEL_CONE:
        return fmax(1 - r, 0);
    case CTS_N_KERNELS:
        break;
    }
    return NAN;
}

/* Grey level of a voxel, or its central difference along a volume axis. */
static double voxel_at(const KernelField *f, const int voxel[3], int difference_axis)
{
    const int *const n = f->volume->dims;
    if (difference_axis >= 0)
        return cts_field_difference(f->volume, voxel, difference_axis, f->air_beyond);
    return f->volume->grey[((size_t)voxel[2] * (size_t)n[1] + (size_t)voxel[1]) * (size_t)n[0] + (size_t)voxel[0]];
}

enum { MAX_SIDE = 2 * CTS_MAX_KERNEL_RADIUS + 2 };

/* The voxels that reach a place within a layer, and their weights, normalised. */
typedef struct Taps {
    int i0, j0, ni, nj;
    double weight[MAX_SIDE][MAX_SIDE]; /* [j][i] */
} Taps;

static void find_taps(const KernelField *f, double u, double v, Taps *taps)
{
    const double r = f->radius;
    taps->i0 = (int)ceil(u - r);
    taps->j0 = (int)ceil(v - r);
    taps->ni = (int)floor(u + r) - taps->i0 + 1;
    taps->nj = (int)floor(v + r) - taps->j0 + 1;
    double sum = 0;
    for (int j = 0; j < taps->nj; j++)
        for (int i = 0; i < taps->ni; i++)
            sum += taps->weight[j][i] = kernel_at(f->kernel, taps->i0 + i - u, taps->j0 + j - v, r);
    for (int j = 0; j < taps->nj && f->kernel != CTS_KERNEL_CONE_PAPER; j++)
        for (int i = 0; i < taps->ni; i++)
            taps->weight[j][i] /= sum;
}

/* The sheet of layer k at the taps' place. */
static double sheet_value_at(const KernelField *f, int k, const Taps *taps, int difference_axis)
{
    double sum = 0;
    int voxel[3];
    voxel[f->axis] = k;
    for (int j = 0; j < taps->nj; j++)
        for (int i = 0; i < taps->ni; i++) {
            voxel[f->u_axis] = taps->i0 + i;
            voxel[f->v_axis] = taps->j0 + j;
            if (taps->weight[j][i] > 0 && voxel[f->u_axis] >= 0 && voxel[f->v_axis] >= 0 &&
                voxel[f->u_axis] < f->volume->dims[f->u_axis] && voxel[f->v_axis] < f->volume->dims[f->v_axis])
                sum += taps->weight[j][i] * voxel_at(f, voxel, difference_axis);
        }
    return sum;
}

static double kernel_field_at(const KernelField *f, const CtsRay *ray, double t_mm, int difference_axis)
{
    double p[3];
    Taps taps;
    for (int axis = 0; axis < 3; axis++)
        p[axis] = cts_clamp(ray->start_vox[axis] + t_mm * ray->step_vox[axis], 0, f->volume->dims[axis] - 1);
    const int last = f->volume->dims[f->axis] - 1;
    const int k = (int)fmin(floor(p[f->axis]), last > 0 ? last - 1 : 0);
    const double part = p[f->axis] - k;
    find_taps(f, p[f->u_axis], p[f->v_axis], &taps);
    double value = part < 1 ? (1 - part) * sheet_value_at(f, k, &taps, difference_axis) : 0;
    if (part > 0)
        value += part * sheet_value_at(f, k + 1, &taps, difference_axis);
    return difference_axis < 0 ? f->volume->hu_offset + f->volume->hu_step * value : f->volume->hu_step * value;
}

/* False when no voxel that reaches the ray between t0 and t1, at most a layer apart, can contribute a wanted value. */
static bool wanted(const KernelField *f, const CtsRayWalk *walk, double t0, double t1)
{
    int low[3], high[3];
    bool outside = false;
    for (int axis = 0; axis < 3; axis++) {
        const double a = walk->ray->start_vox[axis] + t0 * walk->ray->step_vox[axis];
        const double b = walk->ray->start_vox[axis] + t1 * walk->ray->step_vox[axis];
        const double reach = axis == f->axis ? 1e-9 : f->radius, last = f->volume->dims[axis] - 1;
        outside = outside || (axis != f->axis && (fmin(a, b) - reach < 0 || fmax(a, b) + reach > last));
        low[axis] = (int)cts_clamp(floor(fmin(a, b) - reach), 0, last);
        high[axis] = (int)cts_clamp(ceil(fmax(a, b) + reach), 0, last);
    }
    double least = outside ? 0 : UINT16_MAX, most = 0;
    for (int k = low[2]; k <= high[2]; k++)
        for (int j = low[1]; j <= high[1]; j++)
            for (int i = low[0]; i <= high[0]; i++) {
                const double g = voxel_at(f, (const int[3]){i, j, k}, -1);
                cts_lower_to(&least, g);
                cts_raise_to(&most, g);
            }
    if (f->kernel == CTS_KERNEL_CONE_PAPER) { /* its weights sum to anything from 0 to 2 */
        least = 0;
        most *= 2;
    }
    return cts_hu_wanted(walk->wanted, f->volume->hu_offset + f->volume->hu_step * least,
                         f->volume->hu_offset + f->volume->hu_step * most);
}

/* The ray's intersection with the next layer after t, or its end. */
static double next_layer_mm(const KernelField *f, const CtsRay *ray, double t_mm)
{
    const double start = ray->start_vox[f->axis], step = ray->step_vox[f->axis];
    const double p = start + t_mm * step;
    const double plane = step > 0 ? floor(p + 1e-9) + 1 : ceil(p - 1e-9) - 1;
    return fmin((plane - start) / step, ray->t1_mm);
}

/* The earlier of until and the next position after t at which a voxel's kernel begins or ends on the ray:
 * discontinuities of value or slope that no cubic fits. */
static double next_edge_mm(const KernelField *f, const CtsRay *ray, double t_mm, double until_mm)
{
    const double u = ray->start_vox[f->u_axis], v = ray->start_vox[f->v_axis];
    const double du = ray->step_vox[f->u_axis], dv = ray->step_vox[f->v_axis], r = f->radius,
                 least = t_mm + f->shortest_mm;
    const bool round = f->kernel != CTS_KERNEL_TENT && f->kernel != CTS_KERNEL_BSPLINE;
    const double square = du * du + dv * dv;
    double edge = until_mm;
    if (square == 0)
        return edge;
    const double u0 = u + t_mm * du, u1 = u + until_mm * du, v0 = v + t_mm * dv, v1 = v + until_mm * dv;
    for (int j = (int)ceil(fmin(v0, v1) - r); j <= (int)floor(fmax(v0, v1) + r); j++)
        for (int i = (int)ceil(fmin(u0, u1) - r); i <= (int)floor(fmax(u0, u1) + r); i++) {
            double at[6];
            int n = 0;
            if (round) {
                const double along = ((i - u) * du + (j - v) * dv) / square;
                const double off =
                    (u + along * du - i) * (u + along * du - i) + (v + along * dv - j) * (v + along * dv - j);
                const double half = off < r * r ? sqrt((r * r - off) / square) : NAN;
                at[n++] = along - half;
                at[n++] = along; /* a cone's tip */
                at[n++] = along + half;
            } else {
                for (int k = -1; k <= 1; k++) {
                    at[n++] = (i + k * r - u) / du;
                    at[n++] = (j + k * r - v) / dv;
                }
            }
            while (n-- > 0)
                if (at[n] > least && at[n] < edge)
                    edge = at[n];
        }
    return edge;
}

/* Fits the cubic to t0..t1; true when it is accurate in between too. Does not evaluate the ends, where kernels may be
 * discontinuous. */
static bool fit_cubic(const KernelField *f, const CtsRay *ray, double t0, double t1, int difference_axis,
                      double cubic[4])
{
    static const double node[4] = {0.038060233744356624, 0.30865828381745511, 0.69134171618254489, 0.96193976625564337};
    static const double test[3] = {0.14644660940672624, 0.5, 0.85355339059327376};
    const double tolerance = difference_axis < 0 ? FIT_HU : FIT_GRADIENT;
    double at[4];
    for (int i = 0; i < 4; i++)
        at[i] = kernel_field_at(f, ray, t0 + (t1 - t0) * node[i], difference_axis);
    cts_cubic_through(node, at, cubic);
    for (int i = 0; i < 3; i++)
        if (fabs(cts_cubic_at(cubic, test[i]) - kernel_field_at(f, ray, t0 + (t1 - t0) * test[i], difference_axis)) >
            tolerance)
            return false;
    return true;
}

static bool fit_all(const KernelField *f, const CtsRay *ray, double t0, double t1, double hu[4])
{
    double unused[4];
    bool good = fit_cubic(f, ray, t0, t1, -1, hu);
    for (int axis = 0; axis < 3 && f->lit && good; axis++)
        good = fit_cubic(f, ray, t0, t1, axis, unused);
    return good;
}

static bool next(const CtsField *field, CtsRayWalk *walk, CtsRaySegment *segment)
{
    const KernelField *f = (const KernelField *)field;
    const CtsRay *ray = walk->ray;
    while (walk->t_mm < ray->t1_mm) {
        const double t0 = walk->t_mm, layer = fmax(next_layer_mm(f, ray, t0), t0);
        if (layer - t0 < f->shortest_mm || (!walk->within && !wanted(f, walk, t0, layer))) {
            walk->t_mm = layer > t0 ? layer : t0 + f->shortest_mm;
            walk->within = false;
            continue;
        }
        double t1 = next_edge_mm(f, ray, t0, layer);
        while (!fit_all(f, ray, t0, t1, segment->hu) && t1 - t0 > f->shortest_mm)
            t1 = 0.5 * (t0 + t1);
        segment->t0_mm = t0;
        segment->t1_mm = walk->t_mm = t1;
        walk->within = t1 < layer;
        return true;
    }
    return false;
}

static void gradient(const CtsField *field, const CtsRayWalk *walk, const CtsRaySegment *segment, double g[3][4])
{
    for (int axis = 0; axis < 3; axis++)
        fit_cubic((const KernelField *)field, walk->ray, segment->t0_mm, segment->t1_mm, axis, g[axis]);
}

CtsStatus cts_field_kernel(CtsField **field, const CtsVolume *volume, const CtsView *view, CtsKernelId kernel,
                           double radius, const CtsPreset *preset, CtsError *err)
{
    *field = NULL;
    const CtsStatus st = cts_setting_check(CTS_SETTING_KERNEL_RADIUS, radius, err);
    if (st)
        return st;
    KernelField *f = calloc(1, sizeof *f);
    if (!f)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *f = (KernelField){.field = {.next = next, .gradient = gradient},
                       .volume = volume,
                       .axis = view->axis,
                       .u_axis = view->axis == 0 ? 1 : 0,
                       .v_axis = view->axis == 2 ? 1 : 2,
                       .kernel = kernel,
                       .shortest_mm = 1e-6 / fabs(view->forward_vox[view->axis]),
                       .lit = preset->shade,
                       .air_beyond = cts_shade_air_beyond(preset, volume),
                       .radius = radius};
    *field = &f->field;
    return CTS_OK;
}
