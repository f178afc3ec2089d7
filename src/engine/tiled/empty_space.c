#include "engine/tiled/empty_space.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/tiled/cell_distance.h"
#include <stdatomic.h>

/* The fine macro-cells in the layout's order of axes. */
typedef struct Fine {
    const CtsRange *range;
    int n[3];
    ptrdiff_t stride[3];
} Fine;

static Fine fine_of(const CtsMacrocells *macrocells, const CtsLayout *layout)
{
    const int axis[3] = {layout->axis_u, layout->axis_v, layout->axis_k};
    const ptrdiff_t stride[3] = {1, macrocells->n_fine[0], (ptrdiff_t)macrocells->n_fine[0] * macrocells->n_fine[1]};
    Fine f = {.range = macrocells->fine};
    for (int c = 0; c < 3; c++) {
        f.n[c] = macrocells->n_fine[axis[c]];
        f.stride[c] = stride[axis[c]];
    }
    return f;
}

/* Bits of the fine macro-cells in macro-cell (u, v, k) that may be visible; at the far ends some do not exist. */
static uint8_t fine_bits(const Fine *f, const CtsLut *lut, int u, int v, int k)
{
    const CtsRange *first = f->range + 2 * (u * f->stride[0] + v * f->stride[1] + k * f->stride[2]);
    const int nu = 2 * u + 1 < f->n[0] ? 2 : 1, nv = 2 * v + 1 < f->n[1] ? 2 : 1, nk = 2 * k + 1 < f->n[2] ? 2 : 1;
    unsigned bits = 0;
    for (int c = 0; c < nk; c++)
        for (int b = 0; b < nv; b++)
            for (int a = 0; a < nu; a++) {
                const CtsRange *r = first + a * f->stride[0] + b * f->stride[1] + c * f->stride[2];
                const bool visible = cts_lut_visible(lut, r->low, CTS_MUTATED(LEAP_RANGE) ? r->low : r->high);
                bits |= (unsigned)visible << (4 * c + 2 * b + a);
            }
    return (uint8_t)bits;
}

typedef struct Look {
    CtsEmptySpace *empty;
    const CtsRange *range;
    ptrdiff_t stride[3];
    const Fine *fine;
    const CtsLut *lut;
    _Atomic int64_t n_visible;
} Look;

static void look_at_rows(void *context, int worker, size_t first, size_t end)
{
    Look *const l = context;
    const int nu = l->empty->nu, nv = l->empty->nv;
    int64_t n_visible = 0;
    (void)worker;
    for (size_t row = first; row < end; row++) {
        const int v = (int)row % nv, k = (int)row / nv;
        uint8_t *d = l->empty->distance + row * (size_t)nu, *fine = l->empty->fine + row * (size_t)nu;
        for (int u = 0; u < nu; u++) {
            const CtsRange r = l->range[u * l->stride[0] + v * l->stride[1] + k * l->stride[2]];
            const bool visible = cts_lut_visible(l->lut, r.low, r.high);
            d[u] = visible ? 0 : CTS_CELL_FAR;
            fine[u] = visible ? fine_bits(l->fine, l->lut, u, v, k) : 0;
            n_visible += visible;
        }
    }
    atomic_fetch_add(&l->n_visible, n_visible);
}

CtsStatus cts_empty_space_init(CtsEmptySpace *empty, const CtsMacrocells *macrocells, const CtsLayout *layout,
                               const CtsLut *lut, int n_threads, CtsError *err)
{
    CtsStatus st;
    *empty = (CtsEmptySpace){
        .nu = macrocells->n[layout->axis_u], .nv = macrocells->n[layout->axis_v], .nk = macrocells->n[layout->axis_k]};
    empty->n_macrocells = (int64_t)empty->nu * empty->nv * empty->nk;
    if ((st = cts_alloc_array(&empty->distance, (size_t)empty->n_macrocells, err)) ||
        (st = cts_alloc_array(&empty->fine, (size_t)empty->n_macrocells, err)))
        goto end;
    const ptrdiff_t from[3] = {1, macrocells->n[0], (ptrdiff_t)macrocells->n[0] * macrocells->n[1]};
    const Fine all_fine = fine_of(macrocells, layout);
    Look look = {.empty = empty,
                 .range = macrocells->range,
                 .stride = {from[layout->axis_u], from[layout->axis_v], from[layout->axis_k]},
                 .fine = &all_fine,
                 .lut = lut};
    cts_parallel(n_threads, (size_t)empty->nk * (size_t)empty->nv, 64, look_at_rows, &look);
    empty->n_visible = atomic_load(&look.n_visible);
    st = cts_cell_distance(empty->distance, empty->nu, empty->nv, empty->nk, err);
end:
    if (st)
        cts_empty_space_free(empty);
    return st;
}

void cts_empty_space_free(CtsEmptySpace *empty)
{
    cts_free(&empty->distance);
    cts_free(&empty->fine);
}
