#include "splat/layout.h"

#include "base/mem.h"
#include "splat/transpose.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Voxels along volume axis `axis` that the in-layer position moves for one pixel to the right. */
static double per_pixel(const CtsView *view, int axis)
{
    const double t = -view->right_vox[view->axis] / view->forward_vox[view->axis];
    return fabs(view->right_vox[axis] + t * view->forward_vox[axis]);
}

/* Layers from..to of the copy, a tile of u x k at a time so that reads and writes both stay in cache lines; where the
 * layers' axis is the one along which memory runs, in squares of 8 x 8. */
static void copy_layers(const CtsLayout *l, const CtsVolume *volume, int from, int to)
{
    const size_t stride[3] = {1, (size_t)volume->dims[0], (size_t)volume->dims[0] * (size_t)volume->dims[1]};
    const size_t su = stride[l->axis_u], sv = stride[l->axis_v], sk = stride[l->axis_k];
    enum { SQUARE = 8 };
    for (int v = 0; v < l->nv; v++)
        for (int u0 = 0; u0 < l->nu; u0 += SQUARE)
            for (int k0 = from; k0 < to; k0 += SQUARE) {
                const int k1 = k0 + SQUARE < to ? k0 + SQUARE : to, u1 = u0 + SQUARE < l->nu ? u0 + SQUARE : l->nu;
                const uint16_t *in = volume->grey + (size_t)u0 * su + (size_t)v * sv + (size_t)k0 * sk;
                uint16_t *out = l->copy + (ptrdiff_t)k0 * l->layer_stride + (ptrdiff_t)v * l->row_stride + u0;
                if (sk == 1 && k1 - k0 == SQUARE && u1 - u0 == SQUARE) {
                    cts_transpose_8(in, su, out, (size_t)l->layer_stride);
                    continue;
                }
                for (int u = 0; u < u1 - u0; u++)
                    for (int k = 0; k < k1 - k0; k++)
                        out[(ptrdiff_t)k * l->layer_stride + u] = in[(size_t)u * su + (size_t)k * sk];
            }
}

CtsLayout cts_layout_plan(const CtsVolume *volume, const CtsView *view)
{
    static const int others[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    const int a = others[view->axis][0], b = others[view->axis][1];
    const bool swapped = per_pixel(view, b) > per_pixel(view, a);
    CtsLayout l = {.axis_u = swapped ? b : a, .axis_v = swapped ? a : b, .axis_k = view->axis};
    l.nu = volume->dims[l.axis_u];
    l.nv = volume->dims[l.axis_v];
    l.nk = volume->dims[l.axis_k];
    l.alloc_u = l.nu < CTS_LAYOUT_MIN_U ? CTS_LAYOUT_MIN_U : l.nu;
    l.alloc_v = l.nv < CTS_LAYOUT_MIN_V ? CTS_LAYOUT_MIN_V : l.nv;
    const ptrdiff_t stride[3] = {1, volume->dims[0], (ptrdiff_t)volume->dims[0] * volume->dims[1]};
    if (l.axis_u == 0 && l.alloc_u == l.nu && l.alloc_v == l.nv) {
        l.grey = volume->grey;
        l.row_stride = stride[l.axis_v];
        l.layer_stride = stride[l.axis_k];
    } else {
        l.row_stride = l.alloc_u;
        l.layer_stride = (ptrdiff_t)l.alloc_u * l.alloc_v;
    }
    return l;
}

CtsStatus cts_layout_make(CtsLayout *l, const CtsVolume *volume, int n_threads, CtsError *err)
{
    if (l->grey)
        return CTS_OK;
    const bool padded = l->alloc_u > l->nu || l->alloc_v > l->nv;
    const size_t n = (size_t)l->layer_stride * (size_t)l->nk;
    const CtsStatus st = padded ? cts_alloc_zeroed(&l->copy, n, err) : cts_alloc_array(&l->copy, n, err);
    if (st)
        return st;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (int k = 0; k < l->nk; k += 32)
        copy_layers(l, volume, k, k + 32 < l->nk ? k + 32 : l->nk);
    l->grey = l->copy;
    return CTS_OK;
}

void cts_layout_free(CtsLayout *layout)
{
    cts_free(&layout->copy);
}
