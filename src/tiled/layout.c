#include "tiled/layout.h"

#include "base/mem.h"
#include "base/parallel.h"
#include "scene/transpose.h"
#include "volume/macrocells.h"
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Voxels along volume axis `axis` that the in-layer position moves for one pixel to the right. */
static double per_pixel(const CtsView *view, int axis)
{
    const double t = -view->right_vox[view->axis] / view->forward_vox[view->axis];
    return fabs(view->right_vox[axis] + t * view->forward_vox[axis]);
}

/* Voxels of macro-cell b of n along an axis: macro-cells are of cells, so the last one holds a voxel more than its
 * cells. */
static inline int macrocell_end(int b, int n, int n_voxels)
{
    return b == n - 1 ? n_voxels : (b + 1) * CTS_MACROCELL;
}

/* Voxels u0..u1 - 1 of row v of layers k0..k1 - 1; in squares of 8 x 8 where the layers' axis is the one along which
 * memory runs. */
static void copy_row(const CtsLayout *l, const CtsVolume *volume, int u0, int u1, int v, int k0, int k1)
{
    const size_t stride[3] = {1, (size_t)volume->dims[0], (size_t)volume->dims[0] * (size_t)volume->dims[1]};
    const size_t su = stride[l->axis_u], sv = stride[l->axis_v], sk = stride[l->axis_k];
    const uint16_t *in = volume->grey + (size_t)u0 * su + (size_t)v * sv + (size_t)k0 * sk;
    uint16_t *out = l->copy + (ptrdiff_t)k0 * l->layer_stride + (ptrdiff_t)v * l->row_stride + u0;
    const bool square = sk == 1 && u1 - u0 >= CTS_MACROCELL && k1 - k0 >= CTS_MACROCELL;
    if (square)
        cts_transpose_8(in, su, out, (size_t)l->layer_stride);
    for (int u = 0; u < u1 - u0; u++)
        for (int k = square && u < CTS_MACROCELL ? CTS_MACROCELL : 0; k < k1 - k0; k++)
            out[(ptrdiff_t)k * l->layer_stride + u] = in[(size_t)u * su + (size_t)k * sk];
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

CtsStatus cts_layout_make(CtsLayout *l, CtsError *err)
{
    if (l->grey)
        return CTS_OK;
    const bool padded = l->alloc_u > l->nu || l->alloc_v > l->nv;
    const size_t n = (size_t)l->layer_stride * (size_t)l->nk;
    const CtsStatus st = padded ? cts_alloc_zeroed(&l->copy, n, err) : cts_alloc_array(&l->copy, n, err);
    l->grey = l->copy;
    return st;
}

typedef struct Copy {
    const CtsLayout *layout;
    const CtsVolume *volume;
    const CtsLayoutCells *macrocells;
    _Atomic int64_t n;
} Copy;

/* A row of macro-cells; returns how many were copied. */
static int copy_macrocells(const Copy *c, int bv, int bk)
{
    const CtsLayout *l = c->layout;
    const CtsLayoutCells *macrocells = c->macrocells;
    const uint8_t *distance =
        macrocells->distance + ((size_t)bk * (size_t)macrocells->nv + (size_t)bv) * (size_t)macrocells->nu;
    int n = 0;
    for (int bu = 0; bu < macrocells->nu; bu++) {
        if (distance[bu] <= macrocells->above || distance[bu] > macrocells->reach)
            continue;
        for (int v = bv * CTS_MACROCELL; v < macrocell_end(bv, macrocells->nv, l->nv); v++)
            copy_row(l, c->volume, bu * CTS_MACROCELL, macrocell_end(bu, macrocells->nu, l->nu), v, bk * CTS_MACROCELL,
                     macrocell_end(bk, macrocells->nk, l->nk));
        n++;
    }
    return n;
}

static void copy_rows(void *context, int worker, size_t first, size_t end)
{
    Copy *const c = context;
    (void)worker;
    for (size_t row = first; row < end; row++)
        atomic_fetch_add(&c->n, copy_macrocells(c, (int)row % c->macrocells->nv, (int)row / c->macrocells->nv));
}

int64_t cts_layout_copy(const CtsLayout *l, const CtsVolume *volume, const CtsLayoutCells *macrocells, int n_threads)
{
    Copy copy = {.layout = l, .volume = volume, .macrocells = macrocells};
    cts_parallel(n_threads, (size_t)macrocells->nk * (size_t)macrocells->nv, 1, copy_rows, &copy);
    return atomic_load(&copy.n);
}

void cts_layout_free(CtsLayout *layout)
{
    cts_free(&layout->copy);
}
