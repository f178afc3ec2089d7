#include "splat/leap.h"

#include "base/mem.h"
#include "base/mutation.h"

enum { FAR = 255 };

static inline uint8_t min8(uint8_t a, uint8_t b)
{
    return a < b ? a : b;
}

/* d[u] = min(d[u], 1 + the smallest of near[u - 1 .. u + 1]), then the scan along the row itself. near has a FAR on
 * either side. */
static void relax_row(uint8_t *d, const uint8_t *near, int n, int step)
{
    for (int u = 0; u < n; u++) {
        const uint8_t m = min8(near[u], min8(near[u + 1], near[u + 2]));
        d[u] = min8(d[u], (uint8_t)(m + (m < FAR)));
    }
    uint8_t last = FAR;
    for (int i = 0, u = step > 0 ? 0 : n - 1; i < n; i++, u += step) {
        last = min8(d[u], (uint8_t)(last + (last < FAR)));
        d[u] = last;
    }
}

/* Half of the two-pass chamfer transform with all 26 neighbours at distance 1, which is exact in the maximum norm:
 * step +1 looks back at the rows before, -1 at those after. */
static void relax(CtsLeap *l, int step, uint8_t *near)
{
    const ptrdiff_t row = l->nu, layer = row * l->nv;
    for (int kk = 0, k = step > 0 ? 0 : l->nk - 1; kk < l->nk; kk++, k += step)
        for (int vv = 0, v = step > 0 ? 0 : l->nv - 1; vv < l->nv; vv++, v += step) {
            uint8_t *d = l->distance + k * layer + v * row;
            for (int u = 0; u < l->nu; u++)
                near[u + 1] = FAR;
            const int rows[4][2] = {{v - step, k}, {v - 1, k - step}, {v, k - step}, {v + 1, k - step}};
            for (int r = 0; r < 4; r++) {
                if (rows[r][0] < 0 || rows[r][0] >= l->nv || rows[r][1] < 0 || rows[r][1] >= l->nk)
                    continue;
                const uint8_t *other = l->distance + rows[r][1] * layer + rows[r][0] * row;
                for (int u = 0; u < l->nu; u++)
                    near[u + 1] = min8(near[u + 1], other[u]);
            }
            relax_row(d, near, l->nu, step);
        }
}

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
    uint8_t *near = NULL;
    *leap =
        (CtsLeap){.nu = blocks->n[layout->axis_u], .nv = blocks->n[layout->axis_v], .nk = blocks->n[layout->axis_k]};
    leap->n_blocks = (int64_t)leap->nu * leap->nv * leap->nk;
    if ((st = cts_alloc_array(&leap->distance, (size_t)leap->n_blocks, err)) ||
        (st = cts_alloc_array(&leap->fine, (size_t)leap->n_blocks, err)) ||
        (st = cts_alloc_array(&near, (size_t)leap->nu + 2, err)))
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
            d[u] = visible ? 0 : FAR;
            fine[u] = visible ? fine_bits(&all_fine, lut, u, v, k) : 0;
            n_visible += visible;
        }
    }
    leap->n_visible = n_visible;
    near[0] = near[leap->nu + 1] = FAR;
    relax(leap, 1, near);
    relax(leap, -1, near);
end:
    cts_free(&near);
    if (st)
        cts_leap_free(leap);
    return st;
}

void cts_leap_free(CtsLeap *leap)
{
    cts_free(&leap->distance);
    cts_free(&leap->fine);
}
