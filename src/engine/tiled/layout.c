#include "engine/tiled/layout.h"

#include "base/mem.h"
#include "base/parallel.h"
#include "core/scene/transpose.h"
#include "core/volume/macrocells.h"
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

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
    size_t stride[3]; /* of the volume, along the layout's axes */
    _Atomic int64_t n;
} Copy;

/* Macro-cells each way that are turned round together: a line of memory's worth of voxels. What stands in it is written
 * at once; lines of neighbouring layers would drive one another out of the cache. */
enum { TOGETHER = 4, LINE = TOGETHER * CTS_MACROCELL };

/* Voxels u0..u1 - 1 of row v of layers k0..k1 - 1. */
typedef struct Block {
    int u0, u1, v, k0, k1;
} Block;

static Block block_of(const Copy *c, int bu, int v, int bk)
{
    const CtsLayoutCells *m = c->macrocells;
    return (Block){bu * CTS_MACROCELL, macrocell_end(bu, m->nu, c->layout->nu), v, bk * CTS_MACROCELL,
                   macrocell_end(bk, m->nk, c->layout->nk)};
}

static const uint16_t *voxel_of(const Copy *c, const Block *b)
{
    return c->volume->grey + (size_t)b->u0 * c->stride[0] + (size_t)b->v * c->stride[1] + (size_t)b->k0 * c->stride[2];
}

static uint16_t *place_of(const Copy *c, const Block *b)
{
    return c->layout->copy + (ptrdiff_t)b->k0 * c->layout->layer_stride + (ptrdiff_t)b->v * c->layout->row_stride +
           b->u0;
}

/* Where the layers' axis is the one along which memory runs. */
static bool is_square(const Copy *c, const Block *b)
{
    return c->stride[2] == 1 && b->u1 - b->u0 == CTS_MACROCELL && b->k1 - b->k0 == CTS_MACROCELL;
}

static void copy_block(const Copy *c, const Block *b)
{
    const uint16_t *in = voxel_of(c, b);
    uint16_t *out = place_of(c, b);
    for (int u = 0; u < b->u1 - b->u0; u++)
        for (int k = 0; k < b->k1 - b->k0; k++)
            out[(ptrdiff_t)k * c->layout->layer_stride + u] = in[(size_t)u * c->stride[0] + (size_t)k * c->stride[2]];
}

static bool is_wanted(const CtsLayoutCells *c, int bu, int bv, int bk)
{
    if (bu >= c->nu || bk >= c->nk)
        return false;
    const uint8_t distance = c->distance[((size_t)bk * (size_t)c->nv + (size_t)bv) * (size_t)c->nu + (size_t)bu];
    return distance > c->above && distance <= c->reach;
}

/* A whole line goes past the cache, which need not read what is written over. SSE2 is part of every x86-64. */
static void write_line(uint16_t *out, const uint16_t line[LINE])
{
#if defined(__SSE2__)
    if ((uintptr_t)out % 16 == 0) {
        for (int i = 0; i < LINE; i += 8)
            _mm_stream_si128((void *)(out + i), _mm_loadu_si128((const void *)(line + i)));
        return;
    }
#endif
    memcpy(out, line, LINE * sizeof *line);
}

/* Other threads see what has gone past the cache. */
static void end_lines(void)
{
#if defined(__SSE2__)
    _mm_sfence();
#endif
}

/* Row v of TOGETHER x TOGETHER macro-cells; returns how many of them were copied. */
static int copy_together(const Copy *c, int first_bu, int v, int bv, int first_bk)
{
    uint16_t turned[CTS_MACROCELL][LINE];
    int n = 0;
    for (int bk = first_bk; bk < first_bk + TOGETHER; bk++) {
        unsigned squares = 0;
        Block b = {0};
        for (int i = 0; i < TOGETHER; i++) {
            if (!is_wanted(c->macrocells, first_bu + i, bv, bk))
                continue;
            b = block_of(c, first_bu + i, v, bk);
            n++;
            if (!is_square(c, &b)) {
                copy_block(c, &b);
                continue;
            }
            squares |= 1u << i;
            cts_transpose_8(voxel_of(c, &b), c->stride[0], &turned[0][i * CTS_MACROCELL], LINE);
        }
        if (!squares)
            continue;
        b = block_of(c, first_bu, v, bk);
        uint16_t *out = place_of(c, &b);
        for (int k = 0; k < CTS_MACROCELL; k++, out += c->layout->layer_stride)
            if (squares == (1 << TOGETHER) - 1)
                write_line(out, turned[k]);
            else
                for (int i = 0; i < TOGETHER; i++)
                    if (squares >> i & 1)
                        memcpy(out + i * CTS_MACROCELL, &turned[k][i * CTS_MACROCELL], CTS_MACROCELL * sizeof *out);
    }
    return n;
}

static void copy_some(void *context, int worker, size_t first, size_t end)
{
    Copy *const c = context;
    const CtsLayoutCells *m = c->macrocells;
    (void)worker;
    for (size_t item = first; item < end; item++) {
        const int bv = (int)item % m->nv, bk = (int)item / m->nv * TOGETHER;
        int n = 0;
        for (int v = bv * CTS_MACROCELL; v < macrocell_end(bv, m->nv, c->layout->nv); v++) {
            n = 0;
            for (int bu = 0; bu < m->nu; bu += TOGETHER)
                n += copy_together(c, bu, v, bv, bk);
        }
        atomic_fetch_add(&c->n, n);
    }
    end_lines();
}

int64_t cts_layout_copy(const CtsLayout *l, const CtsVolume *volume, const CtsLayoutCells *macrocells, int n_threads)
{
    const size_t stride[3] = {1, (size_t)volume->dims[0], (size_t)volume->dims[0] * (size_t)volume->dims[1]};
    Copy copy = {.layout = l,
                 .volume = volume,
                 .macrocells = macrocells,
                 .stride = {stride[l->axis_u], stride[l->axis_v], stride[l->axis_k]}};
    const size_t n_groups = ((size_t)macrocells->nk + TOGETHER - 1) / TOGETHER;
    cts_parallel(n_threads, n_groups * (size_t)macrocells->nv, 1, copy_some, &copy);
    return atomic_load(&copy.n);
}

void cts_layout_free(CtsLayout *layout)
{
    cts_free(&layout->copy);
}
