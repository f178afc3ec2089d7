#include "tiled/leap.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "tiled/block_distance.h"

/* The fine blocks in the layout's order of axes. */
typedef struct Fine {
    const CtsRange *range;
    int n[3];
    ptrdiff_t stride[3];
} Fine;

static Fine fine_of(const CtsBlocks *blocks, const CtsLayout *layout)
{
    const int axis[3] = {layout->axis_u, layout->axis_v, layout->axis_k};
    const ptrdiff_t stride[3] = {1, blocks->n_fine[0], (ptrdiff_t)blocks->n_fine[0] * blocks->n_fine[1]};
    Fine f = {.range = blocks->fine};
    for (int c = 0; c < 3; c++) {
        f.n[c] = blocks->n_fine[axis[c]];
        f.stride[c] = stride[axis[c]];
    }
    return f;
}

/* Bits of the fine blocks in block (u, v, k) that may be visible; at the far ends some do not exist. */
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

CtsStatus cts_leap_init(CtsLeap *leap, const CtsBlocks *blocks, const CtsLayout *layout, const CtsLut *lut,
                        int n_threads, CtsError *err)
{
    CtsStatus st;
    *leap =
        (CtsLeap){.nu = blocks->n[layout->axis_u], .nv = blocks->n[layout->axis_v], .nk = blocks->n[layout->axis_k]};
    leap->n_blocks = (int64_t)leap->nu * leap->nv * leap->nk;
    if ((st = cts_alloc_array(&leap->distance, (size_t)leap->n_blocks, err)) ||
        (st = cts_alloc_array(&leap->fine, (size_t)leap->n_blocks, err)))
        goto end;
    const ptrdiff_t from[3] = {1, blocks->n[0], (ptrdiff_t)blocks->n[0] * blocks->n[1]};
    const Fine all_fine = fine_of(blocks, layout);
    int64_t n_visible = 0;
#pragma omp parallel for schedule(dynamic, 64) num_threads(n_threads) reduction(+ : n_visible)
    for (int row = 0; row < leap->nk * leap->nv; row++) {
        const int v = row % leap->nv, k = row / leap->nv;
        uint8_t *d = leap->distance + (size_t)row * (size_t)leap->nu, *fine = leap->fine + (d - leap->distance);
        for (int u = 0; u < leap->nu; u++) {
            const CtsRange r =
                blocks->range[u * from[layout->axis_u] + v * from[layout->axis_v] + k * from[layout->axis_k]];
            const bool visible = cts_lut_visible(lut, r.low, r.high);
            d[u] = visible ? 0 : CTS_BLOCK_FAR;
            fine[u] = visible ? fine_bits(&all_fine, lut, u, v, k) : 0;
            n_visible += visible;
        }
    }
    leap->n_visible = n_visible;
    st = cts_block_distance(leap->distance, leap->nu, leap->nv, leap->nk, err);
end:
    if (st)
        cts_leap_free(leap);
    return st;
}

void cts_leap_free(CtsLeap *leap)
{
    cts_free(&leap->distance);
    cts_free(&leap->fine);
}
