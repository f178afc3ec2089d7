/* Rays through voxels by a straightforward method. */
#include "lab/check/truth.h"

#include "base/vec3.h"
#include <math.h>

/* Segments in a cell: many where opacity is steep in it; with lighting, the gradient may vary where HU is constant, as
 * at an edge of the volume. */
enum { FEW = 32, MANY = 128, TURN = 400 };

typedef struct Cell {
    double hu[8], gradient[8][3]; /* at its voxels; the gradient in HU per voxel */
    double low, high;
    bool turns; /* with lighting: gradients of some voxels have different directions */
} Cell;

static double voxel_hu(const CtsVolume *v, const int at[3])
{
    return v->hu_offset +
           v->hu_step *
               v->grey[((size_t)at[2] * (size_t)v->dims[1] + (size_t)at[1]) * (size_t)v->dims[0] + (size_t)at[0]];
}

/* Central difference over two voxels, along the slice axis over two slices; beyond the volume is air if it is
 * invisible. */
static double true_difference(const CtsVolume *v, const int at[3], int axis, bool air_beyond)
{
    const int step = axis == 2 ? v->slice_layers : 1;
    double hu[2];
    int reach = 2 * step;
    for (int side = 0; side < 2; side++) {
        int there[3] = {at[0], at[1], at[2]};
        there[axis] += side ? step : -step;
        const bool inside = there[axis] >= 0 && there[axis] < v->dims[axis];
        reach -= inside || air_beyond ? 0 : step;
        hu[side] = inside ? voxel_hu(v, there) : air_beyond ? -1024 : voxel_hu(v, at);
    }
    return (hu[1] - hu[0]) / reach;
}

/* The area that two gradients span is more than rounding. */
static bool gradients_differ(const double a[3], const double b[3])
{
    double across[3];
    cts_cross3(a, b, across);
    return cts_norm3(across) > 1e-9 * (cts_dot3(a, a) + cts_dot3(b, b));
}

static void load_true_cell(Cell *cell, const CtsVolume *v, const int first[3], bool lit, bool air_beyond)
{
    *cell = (Cell){.low = INFINITY, .high = -INFINITY};
    for (int m = 0; m < 8; m++) {
        const int at[3] = {first[0] + (m & 1), first[1] + (m >> 1 & 1), first[2] + (m >> 2 & 1)};
        cell->hu[m] = voxel_hu(v, at);
        cell->low = fmin(cell->low, cell->hu[m]);
        cell->high = fmax(cell->high, cell->hu[m]);
        for (int axis = 0; axis < 3 && lit; axis++)
            cell->gradient[m][axis] = true_difference(v, at, axis, air_beyond);
        for (int before = 0; before < m && lit; before++)
            cell->turns |= gradients_differ(cell->gradient[m], cell->gradient[before]);
    }
}

static double weight(int corner, const double part[3])
{
    double w = 1;
    for (int a = 0; a < 3; a++)
        w *= corner >> a & 1 ? part[a] : 1 - part[a];
    return w;
}

/* Opacity above 0 somewhere on low..high: at a point of the preset, or beyond all of them. */
static bool shows_range(const CtsPreset *p, double low, double high)
{
    const CtsOpacityPoint *point = p->opacity;
    const int n = p->n_opacity;
    if ((low < point[0].hu && point[0].opacity > 0) || (high >= point[n - 1].hu && point[n - 1].opacity > 0))
        return true;
    for (int i = 0; i + 1 < n; i++)
        if (point[i].hu <= high && point[i + 1].hu >= low && (point[i].opacity > 0 || point[i + 1].opacity > 0))
            return true;
    return false;
}

/* True if two points of the preset are close to each other, relative to the cell's range. */
static bool steep_in(const CtsPreset *p, const Cell *cell)
{
    for (int i = 0; i + 1 < p->n_opacity; i++)
        if (p->opacity[i].hu <= cell->high && p->opacity[i + 1].hu >= cell->low &&
            p->opacity[i + 1].hu - p->opacity[i].hu < 0.25 * (cell->high - cell->low))
            return true;
    return false;
}

/* |n.v|: the gradient in HU/mm solves gradient . step = difference for each of the volume's steps. */
static double facing(const CtsVolume *v, const Cell *cell, const double part[3], const double forward_lps[3])
{
    double g[3] = {0, 0, 0}, mm[3] = {0, 0, 0}, normal[3];
    for (int m = 0; m < 8; m++)
        for (int a = 0; a < 3; a++)
            g[a] += weight(m, part) * cell->gradient[m][a];
    for (int a = 0; a < 3; a++) {
        cts_cross3(v->step_lps[(a + 1) % 3], v->step_lps[(a + 2) % 3], normal);
        for (int c = 0; c < 3; c++)
            mm[c] += g[a] * normal[c];
    }
    /* The volume of a voxel, by which mm is too long, has no effect on the angle. */
    const double length = cts_norm3(mm);
    return length > 0 ? fabs(cts_dot3(mm, forward_lps)) / length : 0;
}

typedef struct VoxelLine {
    double vox[3], per_mm[3]; /* voxel coordinates at t = 0, and their change */
} VoxelLine;

static double hu_at(const Cell *cell, const VoxelLine *line, const int first[3], double t_mm, double part[3])
{
    double hu = 0;
    for (int a = 0; a < 3; a++)
        part[a] = fmin(fmax(line->vox[a] + t_mm * line->per_mm[a] - first[a], 0), 1);
    for (int m = 0; m < 8; m++)
        hu += weight(m, part) * cell->hu[m];
    return hu;
}

static void add_light_of_cell(const CtsVolume *v, const CtsPreset *p, const CtsTruthRay *ray, const VoxelLine *line,
                              const int first[3], double from_mm, double to_mm, CtsTruthSum *light)
{
    Cell cell;
    double part[3];
    load_true_cell(&cell, v, first, p->shade, !shows_range(p, -1024, -1024));
    if (!shows_range(p, cell.low, cell.high))
        return;
    const int n = steep_in(p, &cell) ? MANY : cell.low < cell.high ? FEW : cell.turns ? TURN : 1;
    const double step = (to_mm - from_mm) / n;
    double hu = hu_at(&cell, line, first, from_mm, part);
    for (int i = 0; i < n; i++) {
        CtsTruthInterval s = {.hu0 = hu, .length_mm = step, .facing = -1};
        if (p->shade) {
            /* Not in the middle of a cell: between two layers it has no gradient. */
            hu_at(&cell, line, first, from_mm + (i + (n > 1 ? 0.5 : 0.3)) * step, part);
            s.facing = facing(v, &cell, part, ray->direction_lps);
        }
        s.hu1 = hu = hu_at(&cell, line, first, from_mm + (i + 1) * step, part);
        cts_truth_add(p, 1, &s, light);
    }
}

void cts_truth_volume(const CtsVolume *v, const CtsPreset *p, const CtsTruthRay *ray, double rgba[4])
{
    const double opaque = 30;
    CtsTruthSum light = {{0, 0, 0}, 0};
    VoxelLine line;
    cts_truth_ray_voxel(v, ray, 0, line.vox);
    cts_truth_ray_voxel(v, ray, 1, line.per_mm);
    for (int c = 0; c < 3; c++)
        line.per_mm[c] -= line.vox[c];
    for (double t = ray->from_mm; t < ray->to_mm && light.depth < opaque;) {
        /* The cell just behind t, and where the ray leaves it. */
        const double ahead = t + 1e-9;
        double end = ray->to_mm;
        int first[3];
        for (int c = 0; c < 3; c++) {
            const double at = line.vox[c] + ahead * line.per_mm[c];
            first[c] = (int)fmin(fmax(floor(at), 0), v->dims[c] - 2);
            if (fabs(line.per_mm[c]) > 1e-12)
                end = fmin(end, (first[c] + (line.per_mm[c] > 0) - line.vox[c]) / line.per_mm[c]);
        }
        end = fmax(end, ahead);
        add_light_of_cell(v, p, ray, &line, first, t, end, &light);
        t = end;
    }
    cts_truth_pixel(&light, rgba);
}
