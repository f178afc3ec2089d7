#include "core/volume/crop.h"

#include "base/bits.h"
#include <math.h>
#include <string.h>

static bool inside(const CtsVolume *v, int i, int j, int k, const double lo[3], const double hi[3])
{
    for (int c = 0; c < 3; c++) {
        const double x = v->origin_lps[c] + i * v->step_lps[0][c] + j * v->step_lps[1][c] + k * v->step_lps[2][c];
        if (!(x >= lo[c] - 1e-6 && x <= hi[c] + 1e-6)) /* mm: rounding of sums of steps */
            return false;
    }
    return true;
}

/* The first and last i of a row inside the box; the box is convex, so the row is one run. Empty: first > last. */
static void row_run(const CtsVolume *v, int j, int k, const double lo[3], const double hi[3], int *first, int *last)
{
    double t0 = 0, t1 = v->dims[0] - 1;
    for (int c = 0; c < 3; c++) {
        const double x = v->origin_lps[c] + j * v->step_lps[1][c] + k * v->step_lps[2][c], d = v->step_lps[0][c];
        if (d == 0)
            continue;
        const double a = (lo[c] - x) / d, b = (hi[c] - x) / d;
        t0 = fmax(t0, fmin(a, b));
        t1 = fmin(t1, fmax(a, b));
    }
    *first = (int)fmin(fmax(ceil(t0) - 1, 0), v->dims[0]);
    *last = (int)fmax(fmin(floor(t1) + 1, v->dims[0] - 1), -1);
    while (*first <= *last && !inside(v, *first, j, k, lo, hi))
        ++*first;
    while (*first <= *last && !inside(v, *last, j, k, lo, hi))
        --*last;
}

/* The bounding box of the voxels that the rows keep. */
static CtsVoxelBox find_box(const CtsVolume *v, const double lo[3], const double hi[3])
{
    CtsVoxelBox box = CTS_NO_VOXELS;
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++) {
            int first, last;
            row_run(v, j, k, lo, hi, &first, &last);
            if (first <= last)
                cts_voxel_box_grow(&box, first, last, j, k);
        }
    return box;
}

/* Moves rows of the box to the front; voxels outside first and last of a row become air. */
static void move_rows(CtsVolume *v, const CtsVoxelBox *box, const double lo[3], const double hi[3])
{
    const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1], n = (size_t)(box->hi[0] - box->lo[0] + 1);
    uint16_t *to = v->grey;
    for (int k = box->lo[2]; k <= box->hi[2]; k++)
        for (int j = box->lo[1]; j <= box->hi[1]; j++, to += n) {
            const uint16_t *row = v->grey + ((size_t)k * ny + (size_t)j) * nx;
            int first, last;
            row_run(v, j, k, lo, hi, &first, &last);
            if (first > last) {
                memset(to, 0, n * sizeof *to);
                continue;
            }
            const size_t before = (size_t)(first - box->lo[0]), kept = (size_t)(last - first + 1);
            memmove(to + before, row + first, kept * sizeof *to);
            memset(to, 0, before * sizeof *to);
            memset(to + before + kept, 0, (n - before - kept) * sizeof *to);
        }
}

/* The rows of the box have been moved to the front. */
static void become_box(CtsVolume *v, const int low[3], const int high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        v->dims[axis] = high[axis] - low[axis] + 1;
        for (int c = 0; c < 3; c++)
            v->origin_lps[c] += low[axis] * v->step_lps[axis][c];
    }
}

CtsStatus cts_volume_crop(CtsVolume *v, const double lo_lps[3], const double hi_lps[3], int first[3], CtsError *err)
{
    const CtsVoxelBox box = find_box(v, lo_lps, hi_lps);
    if (box.hi[0] < 0) {
        double low[3], high[3];
        cts_volume_box_lps(v, low, high);
        return cts_fail(err, CTS_ERR_USAGE,
                        "the crop box holds no voxel centre (the volume's box in mm, patient coordinates: "
                        "%.1f,%.1f,%.1f,%.1f,%.1f,%.1f)",
                        low[0], high[0], low[1], high[1], low[2], high[2]);
    }
    move_rows(v, &box, lo_lps, hi_lps);
    memset(v->air_before, 0, sizeof v->air_before);
    memset(v->air_behind, 0, sizeof v->air_behind);
    become_box(v, box.lo, box.hi);
    if (first)
        memcpy(first, box.lo, sizeof box.lo);
    return CTS_OK;
}

static bool holds_air(const uint16_t *grey, int n)
{
    uint16_t any = 0;
    for (int i = 0; i < n; i++)
        any |= grey[i];
    return !any;
}

/* The box of the voxels above air. Reads rows only as far as they may enlarge it; few reach beyond those before. */
static CtsVoxelBox find_box_above_air(const CtsVolume *v)
{
    const int nx = v->dims[0];
    CtsVoxelBox box = CTS_NO_VOXELS;
    box.lo[0] = nx;
    const uint16_t *row = v->grey;
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++, row += nx) {
            int first = box.lo[0], last = box.hi[0];
            if ((j < box.lo[1] || j > box.hi[1] || k > box.hi[2]) && holds_air(row, nx))
                continue;
            if (!holds_air(row, first))
                for (first = 0; !row[first];)
                    first++;
            if (!holds_air(row + last + 1, nx - 1 - last))
                for (last = nx - 1; !row[last];)
                    last--;
            cts_voxel_box_grow(&box, first, last, j, k);
        }
    return box;
}

void cts_volume_widen_box(const CtsVolume *v, int low[3], int high[3])
{
    /* Gradients reach two voxels beyond the last one above air, and the field of occlusion a block of 2.5 mm
     * (core/scene/openness.h). A box that begins at a multiple of 8 voxels keeps the places of macro-cells. */
    enum { GRADIENT = 2, PLACES = 8 };
    const double OCCLUSION_MM = 2.5;
    const bool is_empty = low[2] > high[2];
    for (int axis = 0; axis < 3; axis++) {
        const int last = v->dims[axis] - 1;
        const int margin = (int)fmin(GRADIENT + ceil(OCCLUSION_MM / cts_volume_spacing_mm(v, axis)), last);
        low[axis] = !is_empty && low[axis] > margin ? (low[axis] - margin) / PLACES * PLACES : 0;
        high[axis] = !is_empty && high[axis] < last - margin ? high[axis] + margin : last;
    }
}

void cts_volume_become_air_box(CtsVolume *v, const int low[3], const int high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        v->air_before[axis] += low[axis];
        v->air_behind[axis] += v->dims[axis] - 1 - high[axis];
    }
    become_box(v, low, high);
}

void cts_volume_crop_air(CtsVolume *v, int first[3])
{
    CtsVoxelBox box = find_box_above_air(v);
    cts_volume_widen_box(v, box.lo, box.hi);
    const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1], n = (size_t)(box.hi[0] - box.lo[0] + 1);
    uint16_t *to = v->grey;
    for (int k = box.lo[2]; k <= box.hi[2]; k++)
        for (int j = box.lo[1]; j <= box.hi[1]; j++, to += n) {
            const uint16_t *const row = v->grey + ((size_t)k * ny + (size_t)j) * nx + (size_t)box.lo[0];
            if (to != row)
                memmove(to, row, n * sizeof *to);
        }
    if (first)
        memcpy(first, box.lo, sizeof box.lo);
    cts_volume_become_air_box(v, box.lo, box.hi);
}
