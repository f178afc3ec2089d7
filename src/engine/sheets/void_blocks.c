#include "engine/sheets/sheets.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

CtsStatus cts_sheets_void_init(SheetsVoid *v, const CtsMacrocells *m, const CtsLut *lut, int p, CtsError *err)
{
    static const int within[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    const int a = within[p][0], b = within[p][1];
    const size_t stride[3] = {1, (size_t)m->n_fine[0], (size_t)m->n_fine[0] * (size_t)m->n_fine[1]};
    CtsStatus st;
    *v = (SheetsVoid){.n = {m->n_fine[a], m->n_fine[b]}, .n_layers = m->n_fine[p]};
    const size_t width = (size_t)v->n[0] + 1, area = width * ((size_t)v->n[1] + 1);
    if ((st = cts_alloc_zeroed(&v->at, area * (size_t)v->n_layers, err)))
        return st;
    for (size_t layer = 0; layer < (size_t)v->n_layers; layer++)
        for (size_t j = 0; j < (size_t)v->n[1]; j++) {
            uint32_t *const above = v->at + layer * area + j * width, *const here = above + width;
            uint32_t in_row = 0;
            for (size_t i = 0; i < (size_t)v->n[0]; i++) {
                const CtsRange r = m->fine[layer * stride[p] + j * stride[b] + i * stride[a]];
                in_row += cts_lut_visible(lut, r.low, r.high);
                here[i + 1] = above[i + 1] + in_row;
            }
        }
    return CTS_OK;
}

void cts_sheets_void_free(SheetsVoid *v)
{
    cts_free(&v->at);
}

static int block_of(double voxel, int n)
{
    const double block = floor(voxel / SHEETS_BLOCK);
    return block < 0 ? 0 : block > n - 1 ? n - 1 : (int)block;
}

bool cts_sheets_visible(const SheetsJob *job, const int x[2], const int y[2], const uint64_t *of, uint64_t *bits)
{
    const SheetsView *const view = &job->view;
    const SheetsVoid *const v = job->blocks;
    const size_t width = (size_t)v->n[0] + 1, area = width * ((size_t)v->n[1] + 1);
    double least[2], most[2]; /* of the pixels, at sheet 0 */
    for (int c = 0; c < 2; c++) {
        const double r[2] = {x[0] * view->right[c], x[1] * view->right[c]};
        const double d[2] = {y[0] * view->down[c], y[1] * view->down[c]};
        least[c] = view->origin[c] + fmin(r[0], r[1]) + fmin(d[0], d[1]);
        most[c] = view->origin[c] + fmax(r[0], r[1]) + fmax(d[0], d[1]);
    }
    uint64_t any = 0;
    memset(bits, 0, (size_t)cts_sheets_words(v->n_layers) * sizeof *bits);
    for (int layer = 0; layer < v->n_layers; layer++) {
        if (of && !(of[layer >> 6] >> (layer & 63) & 1))
            continue;
        int from[2], to[2];
        bool outside = false;
        for (int c = 0; c < 2; c++) {
            const double s0 = layer * SHEETS_BLOCK * view->shear[c], s1 = s0 + SHEETS_BLOCK * view->shear[c];
            /* A sample's position is rounded to 2^-16 voxels. */
            const double low = least[c] + fmin(s0, s1) - 0x1p-10, high = most[c] + fmax(s0, s1) + 0x1p-10;
            outside |= high < 0 || low > view->n[c] - 1;
            from[c] = block_of(low, v->n[c]);
            to[c] = block_of(high, v->n[c]) + 1;
        }
        if (outside)
            continue;
        const uint32_t *const at = v->at + (size_t)layer * area;
        const uint32_t *const top = at + (size_t)from[1] * width, *const bottom = at + (size_t)to[1] * width;
        const uint64_t visible = bottom[to[0]] - bottom[from[0]] - top[to[0]] + top[from[0]] > 0;
        bits[layer >> 6] |= visible << (layer & 63);
        any |= visible;
    }
    return any;
}
