#include "ctsplat/volume.h"

#include "base/vec3.h"
#include <stdbool.h>
#include <string.h>

static bool inside(const CtsVolume *v, int i, int j, int k, const double lo[3], const double hi[3])
{
    for (int c = 0; c < 3; c++) {
        const double x = v->origin_lps[c] + i * v->step_lps[0][c] + j * v->step_lps[1][c] + k * v->step_lps[2][c];
        if (!(x >= lo[c] - 1e-6 && x <= hi[c] + 1e-6))
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

CtsStatus cts_volume_crop(CtsVolume *v, const double lo_lps[3], const double hi_lps[3], CtsError *err)
{
    int lo[3] = {v->dims[0], v->dims[1], v->dims[2]}, hi[3] = {-1, -1, -1};
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++) {
            uint16_t *row = v->grey + ((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0];
            int first, last;
            row_run(v, j, k, lo_lps, hi_lps, &first, &last);
            if (first > last) {
                memset(row, 0, (size_t)v->dims[0] * sizeof *row);
                continue;
            }
            memset(row, 0, (size_t)first * sizeof *row);
            memset(row + last + 1, 0, (size_t)(v->dims[0] - 1 - last) * sizeof *row);
            const int at[3][2] = {{first, last}, {j, j}, {k, k}};
            for (int axis = 0; axis < 3; axis++) {
                lo[axis] = at[axis][0] < lo[axis] ? at[axis][0] : lo[axis];
                hi[axis] = at[axis][1] > hi[axis] ? at[axis][1] : hi[axis];
            }
        }
    if (hi[0] < lo[0])
        return cts_fail(err, CTS_ERR_USAGE,
                        "the crop box holds no voxel centre (the box is millimetres in patient coordinates, LPS)");
    const int n[3] = {hi[0] - lo[0] + 1, hi[1] - lo[1] + 1, hi[2] - lo[2] + 1};
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            memmove(v->grey + ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0],
                    v->grey + ((size_t)(k + lo[2]) * (size_t)v->dims[1] + (size_t)(j + lo[1])) * (size_t)v->dims[0] +
                        lo[0],
                    (size_t)n[0] * sizeof *v->grey);
    for (int c = 0; c < 3; c++)
        for (int axis = 0; axis < 3; axis++)
            v->origin_lps[c] += lo[axis] * v->step_lps[axis][c];
    memcpy(v->dims, n, sizeof n);
    cts_volume_changed(v);
    return CTS_OK;
}
