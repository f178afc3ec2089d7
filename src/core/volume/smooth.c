/* A Gaussian on the grey levels, axis by axis. */
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "ctsplat/volume.h"
#include <math.h>

/* Half width of the kernel in standard deviations: 0.3 % of a Gaussian lies beyond; the weights are scaled to a sum of
 * 1. */
#define REACH_SD 3

enum { LANES = 16 }; /* lines smoothed side by side: a register of the widest vectors in float */

/* The lines along one axis: line (o, i) begins at o * outer_step + i * lane_step. */
typedef struct VoxelLines {
    uint16_t *grey;
    int n;       /* voxels of a line */
    size_t step; /* from one of them to the next */
    size_t n_lanes, lane_step, n_outer, outer_step;
    int reach;      /* of the kernel on one side, in voxels */
    float *weight;  /* reach + 1 of them, from the centre outwards */
    float *scratch; /* scratch_size for each worker: LANES lines with padding at their ends */
    size_t scratch_size;
} VoxelLines;

static VoxelLines lines_along(const CtsVolume *v, int axis)
{
    const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1], nz = (size_t)v->dims[2];
    if (axis == 0)
        return (VoxelLines){.step = 1, .n_lanes = ny * nz, .lane_step = nx, .n_outer = 1};
    if (axis == 1)
        return (VoxelLines){.step = nx, .n_lanes = nx, .lane_step = 1, .n_outer = nz, .outer_step = nx * ny};
    return (VoxelLines){.step = nx * ny, .n_lanes = nx * ny, .lane_step = 1, .n_outer = 1};
}

/* Lines are continued with their end voxels, so that constants are preserved. */
static void smooth_lines(const VoxelLines *s, uint16_t *at, int n_lanes, float *line)
{
    const int reach = s->reach;
    for (int i = -reach; i < s->n + reach; i++) {
        const uint16_t *const from = at + (size_t)(i < 0 ? 0 : i < s->n ? i : s->n - 1) * s->step;
        for (int l = 0; l < LANES; l++)
            line[(i + reach) * LANES + l] = l < n_lanes ? from[(size_t)l * s->lane_step] : 0;
    }
    for (int i = 0; i < s->n; i++) {
        const float *const centre = line + (size_t)(i + reach) * LANES;
        float sum[LANES];
        for (int l = 0; l < LANES; l++)
            sum[l] = s->weight[0] * centre[l];
        for (int r = 1; r <= reach; r++)
            for (int l = 0; l < LANES; l++)
                sum[l] += s->weight[r] * (centre[l - r * LANES] + centre[l + r * LANES]);
        for (int l = 0; l < n_lanes; l++)
            at[(size_t)i * s->step + (size_t)l * s->lane_step] =
                (uint16_t)(int32_t)((sum[l] < 65535 ? sum[l] : 65535) + 0.5f);
    }
}

static void smooth_some(void *context, int worker, size_t first, size_t end)
{
    const VoxelLines *const s = context;
    const size_t n_groups = (s->n_lanes + LANES - 1) / LANES;
    for (size_t item = first; item < end; item++) {
        const size_t lane = item % n_groups * LANES, left = s->n_lanes - lane;
        smooth_lines(s, s->grey + item / n_groups * s->outer_step + lane * s->lane_step,
                     (int)(left < LANES ? left : LANES), s->scratch + (size_t)worker * s->scratch_size);
    }
}

static void find_weights(VoxelLines *s, double sd_voxels)
{
    double sum = 0;
    for (int r = 0; r <= s->reach; r++)
        sum += (r ? 2 : 1) * exp(-0.5 * r * r / (sd_voxels * sd_voxels));
    for (int r = 0; r <= s->reach; r++)
        s->weight[r] = (float)(exp(-0.5 * r * r / (sd_voxels * sd_voxels)) / sum);
}

static CtsStatus smooth_axis(CtsVolume *v, int axis, double sd_voxels, int n_threads, CtsError *err)
{
    CtsStatus st;
    VoxelLines s = lines_along(v, axis);
    s.grey = v->grey;
    s.n = v->dims[axis];
    s.reach = (int)ceil(REACH_SD * sd_voxels);
    s.scratch_size = (size_t)(s.n + 2 * s.reach) * LANES;
    if (!(st = cts_alloc_array(&s.weight, (size_t)s.reach + 1, err)) &&
        !(st = cts_alloc_array(&s.scratch, (size_t)n_threads * s.scratch_size, err))) {
        find_weights(&s, sd_voxels);
        cts_parallel(n_threads, s.n_outer * ((s.n_lanes + LANES - 1) / LANES), 0, smooth_some, &s);
    }
    cts_free(&s.weight);
    cts_free(&s.scratch);
    return st;
}

CtsStatus cts_volume_smooth(CtsVolume *v, double sd_mm, int n_threads, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!(sd_mm >= 0 && sd_mm <= CTS_MAX_SMOOTH_MM))
        return cts_fail(err, CTS_ERR_USAGE, "smoothing with a standard deviation of %g mm (0 to %d)", sd_mm,
                        CTS_MAX_SMOOTH_MM);
    for (int axis = 0; axis < 3 && !st; axis++) {
        const double sd_voxels = sd_mm / cts_volume_spacing_mm(v, axis);
        /* Below a tenth of a voxel a neighbour's weight is less than exp(-50). */
        if (v->dims[axis] > 1 && sd_voxels > 0.1)
            st = smooth_axis(v, axis, sd_voxels, cts_threads(n_threads), err);
    }
    return st;
}
