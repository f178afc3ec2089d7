/* The trilinear field, cell by cell along the ray, without macro-cells, so as to be independent of the engines that it
 * validates. */
#include "base/clamp.h"
#include "base/mutation.h"
#include "core/model/macrocells.h"
#include "core/model/voxel_labels.h"
#include "core/scene/shade.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/field.h"
#include <math.h>
#include <stdlib.h>

double cts_field_difference(const CtsVolume *volume, const int voxel[3], int axis, bool air_beyond)
{
    const size_t stride[3] = {1, (size_t)volume->dims[0], (size_t)volume->dims[0] * (size_t)volume->dims[1]};
    const int at = voxel[axis], n = volume->dims[axis], step = cts_shade_step(volume, axis);
    const size_t away = stride[axis] * (size_t)step;
    const uint16_t *const v =
        volume->grey + (size_t)voxel[0] + (size_t)voxel[1] * stride[1] + (size_t)voxel[2] * stride[2];
    const bool before = at >= step, after = at < n - step;
    const double beyond = air_beyond ? 0 : *v;
    const double rise = (after ? (double)v[away] : beyond) - (before ? (double)*(v - away) : beyond);
    return n == 1 ? 0 : rise / ((air_beyond || (before && after) ? 2 : 1) * step);
}

typedef struct Trilinear {
    CtsField field;
    const CtsVolume *volume;
    const CtsVolume *shown; /* volume for gradients: air where labels are hidden */
    int n_cells[3];         /* dims - 1, but at least 1: an axis of one voxel is a cell without change along it */
    ptrdiff_t stride[3];    /* to the next voxel; 0 along an axis of one voxel */
    bool air_beyond;
} Trilinear;

static double hu_of_grey(const Trilinear *t, double grey)
{
    return t->volume->hu_offset + t->volume->hu_step * grey;
}

static bool wanted(const Trilinear *t, const CtsHuRanges *ranges, CtsRange grey)
{
    return cts_hu_wanted(ranges, hu_of_grey(t, grey.low), hu_of_grey(t, grey.high));
}

static const uint16_t *cell_voxel(const Trilinear *t, const int cell[3])
{
    return t->volume->grey + cell[0] * t->stride[0] + cell[1] * t->stride[1] + cell[2] * t->stride[2];
}

static CtsRange load_cell(const Trilinear *t, const int cell[3], uint16_t corner[8])
{
    const uint16_t *v = cell_voxel(t, cell);
    CtsRange r = {UINT16_MAX, 0};
    for (int m = 0; m < 8; m++) {
        const uint16_t g = v[(m & 1 ? t->stride[0] : 0) + (m & 2 ? t->stride[1] : 0) + (m & 4 ? t->stride[2] : 0)];
        corner[m] = g;
        r.low = g < r.low ? g : r.low;
        r.high = g > r.high ? g : r.high;
    }
    return r;
}

/* When the ray leaves box low..high (voxel coordinates) at the latest end of the ray. */
static double leave_box_mm(const CtsRay *ray, const int low[3], const int high[3])
{
    double t = ray->t1_mm;
    for (int axis = 0; axis < 3; axis++) {
        const double step = ray->step_vox[axis];
        if (step != 0) {
            const double plane = step > 0 ? high[axis] : low[axis];
            t = fmin(t, (plane - ray->start_vox[axis]) / step);
        }
    }
    return t;
}

/* The cell of the ray just after t; rounding may give the neighbour, in which case at most a point is missed. */
static void find_cell(const Trilinear *t, const CtsRay *ray, double t_mm, int cell[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const double p = ray->start_vox[axis] + t_mm * ray->step_vox[axis];
        const double near = nearbyint(p);
        double at = floor(p);
        if (fabs(p - near) < 1e-9)
            at = ray->step_vox[axis] < 0 ? near - 1 : near;
        cell[axis] = (int)cts_clamp(at, 0, t->n_cells[axis] - 1);
    }
}

static bool next(const CtsField *field, CtsRayWalk *walk, CtsRaySegment *segment)
{
    const Trilinear *t = (const Trilinear *)field;
    const CtsRay *ray = walk->ray;
    while (!walk->started || walk->t_mm < ray->t1_mm) {
        find_cell(t, ray, walk->t_mm, walk->cell);
        walk->started = true;
        int end[3];
        for (int axis = 0; axis < 3; axis++)
            end[axis] = walk->cell[axis] + 1;
        const double t0 = walk->t_mm, t1 = fmax(t0, leave_box_mm(ray, walk->cell, end));
        walk->t_mm = fmax(nextafter(t0, INFINITY), t1);
        uint16_t grey[8];
        if (!wanted(t, walk->wanted, load_cell(t, walk->cell, grey)) || (t1 <= t0 && ray->t0_mm < ray->t1_mm))
            continue;
        double corner[8];
        for (int m = 0; m < 8; m++)
            corner[m] = hu_of_grey(t, grey[m]);
        for (int axis = 0; axis < 3; axis++) {
            const double p = ray->start_vox[axis] - walk->cell[axis];
            walk->from[axis] = cts_clamp(p + t0 * ray->step_vox[axis], 0, 1);
            walk->to[axis] = cts_clamp(p + t1 * ray->step_vox[axis], 0, 1);
        }
        segment->t0_mm = t0;
        segment->t1_mm = t1;
        cts_cubic_in_cell(corner, walk->from, walk->to, segment->hu);
        return true;
    }
    return false;
}

static void gradient(const CtsField *field, const CtsRayWalk *walk, const CtsRaySegment *segment, double g[3][4])
{
    const Trilinear *t = (const Trilinear *)field;
    (void)segment;
    for (int axis = 0; axis < 3; axis++) {
        double corner[8];
        for (int m = 0; m < 8; m++) {
            int voxel[3];
            for (int a = 0; a < 3; a++)
                voxel[a] = walk->cell[a] + ((m >> a & 1) && t->volume->dims[a] > 1);
            corner[m] = t->volume->hu_step * cts_field_difference(t->shown, voxel, axis, t->air_beyond);
        }
        cts_cubic_in_cell(corner, walk->from, walk->to, g[axis]);
    }
}

CtsStatus cts_field_trilinear(CtsField **field, const CtsModel *model, const CtsPreset *preset, CtsError *err)
{
    *field = NULL;
    Trilinear *t = calloc(1, sizeof *t);
    if (!t)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    t->field = (CtsField){.next = next, .gradient = gradient};
    t->volume = model->volume;
    t->shown = cts_model_shown(model)->volume;
    t->air_beyond = cts_shade_air_beyond(preset, model->volume) && !CTS_MUTATED(BORDER_DIFFERENCE);
    cts_volume_cells(t->volume, t->n_cells, t->stride);
    *field = &t->field;
    return CTS_OK;
}
