#include "engine/tiled/void_mask.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/tiled/cell_distance.h"
#include <stdatomic.h>

typedef struct Looking {
    TiledMask *mask;
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    const CtsLut *lut;
    int low, high; /* what shows lies between these levels */
    int n_cells[3];
    ptrdiff_t stride[3]; /* to the next voxel; 0 along an axis of one */
    _Atomic int64_t n_visible;
} Looking;

/* Levels of the cells' corners, column by column: the smallest and largest of 2 x 2 rows. */
typedef struct Columns {
    uint16_t low[TILED_BLOCK + 1], high[TILED_BLOCK + 1];
} Columns;

static uint16_t smaller(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

static uint16_t larger(uint16_t a, uint16_t b)
{
    return a > b ? a : b;
}

static unsigned row_bits(const Looking *l, const uint16_t *v, int n)
{
    Columns c;
    const uint16_t *const below = v + l->stride[1], *const behind = v + l->stride[2],
                          *const both = below + l->stride[2];
    for (int i = 0; i <= n; i++) {
        const ptrdiff_t at = i * l->stride[0];
        c.low[i] = smaller(smaller(v[at], below[at]), smaller(behind[at], both[at]));
        c.high[i] = larger(larger(v[at], below[at]), larger(behind[at], both[at]));
    }
    unsigned bits = 0;
    for (int i = 0; i < n; i++) {
        const int most = CTS_MUTATED(MASK_NEIGHBOUR) ? c.high[i] : larger(c.high[i], c.high[i + 1]);
        bits |= (unsigned)(most > l->low && smaller(c.low[i], c.low[i + 1]) < l->high) << i;
    }
    return bits;
}

static void block_bits(const Looking *l, const int block[3], uint32_t cells[2])
{
    int n[3];
    const uint16_t *v = l->volume->grey;
    for (int a = 0; a < 3; a++) {
        const int rest = l->n_cells[a] - block[a] * TILED_BLOCK;
        n[a] = rest < TILED_BLOCK ? rest : TILED_BLOCK;
        v += block[a] * TILED_BLOCK * l->stride[a];
    }
    cells[0] = cells[1] = 0;
    for (int k = 0; k < n[2]; k++)
        for (int j = 0; j < n[1]; j++)
            cells[k / 2] |= row_bits(l, v + k * l->stride[2] + j * l->stride[1], n[0]) << (16 * (k % 2) + 4 * j);
}

static void look_at_rows(void *context, int worker, size_t first, size_t end)
{
    Looking *const l = context;
    TiledMask *const m = l->mask;
    int64_t n_visible = 0;
    (void)worker;
    for (size_t row = first; row < end; row++)
        for (int i = 0; i < m->n[0]; i++) {
            const size_t at = row * (size_t)m->n[0] + (size_t)i;
            const CtsRange r = l->macrocells->fine[at];
            const bool visible = cts_lut_visible(l->lut, r.low, CTS_MUTATED(LEAP_RANGE) ? r.low : r.high);
            m->cells[at][0] = m->cells[at][1] = visible ? UINT32_MAX : 0;
            if (visible && (r.low <= l->low || r.high >= l->high))
                block_bits(l, (const int[]){i, (int)(row % (size_t)m->n[1]), (int)(row / (size_t)m->n[1])},
                           m->cells[at]);
            m->distance[at] = visible ? 0 : CTS_CELL_FAR;
            n_visible += visible;
        }
    atomic_fetch_add(&l->n_visible, n_visible);
}

CtsStatus cts_tiled_mask_init(TiledMask *mask, const CtsScene *scene, const CtsMacrocells *macrocells, CtsError *err)
{
    CtsStatus st;
    Looking l = {.mask = mask, .volume = scene->volume, .macrocells = macrocells, .lut = scene->lut};
    *mask = (TiledMask){.n_visible = 0};
    size_t n = 1;
    ptrdiff_t stride = 1;
    for (int a = 0; a < 3; a++) {
        const int dim = scene->volume->dims[a];
        mask->n[a] = macrocells->n_fine[a];
        n *= (size_t)mask->n[a];
        l.n_cells[a] = dim > 1 ? dim - 1 : 1;
        l.stride[a] = dim > 1 ? stride : 0;
        stride *= dim;
    }
    cts_lut_visible_levels(scene->lut, &l.low, &l.high);
    l.low = l.low > 0 ? l.low : -1;
    l.high = l.high < CTS_N_GREY - 1 ? l.high - 2 * CTS_MUTATED(QUIET_HIGH) : CTS_N_GREY;
    /* Three bytes more, as distances are loaded by fours. */
    if ((st = cts_alloc_array(&mask->cells, n, err)) || (st = cts_alloc_zeroed(&mask->distance, n + 3, err)))
        goto end;
    cts_parallel(scene->settings->n_threads, (size_t)mask->n[1] * (size_t)mask->n[2], 16, look_at_rows, &l);
    mask->n_visible = atomic_load(&l.n_visible);
    st = cts_cell_distance(mask->distance, mask->n[0], mask->n[1], mask->n[2], err);
end:
    if (st)
        cts_tiled_mask_free(mask);
    return st;
}

void cts_tiled_mask_free(TiledMask *mask)
{
    cts_free(&mask->cells);
    cts_free(&mask->distance);
}
