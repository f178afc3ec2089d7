#include "engine/sheets/void_blocks.h"

#include "base/mem.h"
#include <math.h>

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

double cts_sheets_visible_share(const SheetsVoid *v)
{
    const size_t area = ((size_t)v->n[0] + 1) * ((size_t)v->n[1] + 1);
    double visible = 0;
    for (size_t layer = 1; layer <= (size_t)v->n_layers; layer++)
        visible += v->at[layer * area - 1];
    return visible / ((double)v->n[0] * v->n[1] * v->n_layers);
}

void cts_sheets_void_free(SheetsVoid *v)
{
    cts_free(&v->at);
}

/* A sample's position is rounded to 2^-16 voxels; wider by 2^-10, a shaft holds it for certain. */
#define SHAFT_MARGIN (INT64_C(1) << (SHEETS_FRACTION - 10))

SheetsShaft cts_sheets_shaft(const SheetsView *view, const int x[2], const int y[2])
{
    SheetsShaft s;
    for (int c = 0; c < 2; c++) {
        const double r[2] = {x[0] * view->right[c], x[1] * view->right[c]};
        const double d[2] = {y[0] * view->down[c], y[1] * view->down[c]};
        s.shift[c] = llrint(SHEETS_BLOCK * view->shear[c] * 0x1p32);
        s.low[c] = llrint((view->origin[c] + fmin(r[0], r[1]) + fmin(d[0], d[1])) * 0x1p32) - SHAFT_MARGIN;
        s.high[c] = llrint((view->origin[c] + fmax(r[0], r[1]) + fmax(d[0], d[1])) * 0x1p32) + SHAFT_MARGIN;
        *(s.shift[c] < 0 ? &s.low[c] : &s.high[c]) += s.shift[c];
    }
    return s;
}

bool cts_sheets_visible(const SheetsJob *job, const int x[2], const int y[2], const uint64_t *of, uint64_t *bits)
{
    const SheetsVoid *const v = job->blocks;
    const SheetsShaft shaft = cts_sheets_shaft(&job->view, x, y);
    const int n_words = cts_sheets_words(v->n_layers);
    uint64_t any = 0;
    for (int word = 0; word < n_words; word++) {
        const int n = v->n_layers - 64 * word;
        uint64_t left = of ? of[word] : n < 64 ? (UINT64_C(1) << n) - 1 : UINT64_MAX;
        bits[word] = 0;
        for (; left; left &= left - 1) {
            const int layer = 64 * word + __builtin_ctzll(left);
            if (cts_sheets_shaft_is_visible(&shaft, &job->view, v, layer))
                bits[word] |= left & -left;
        }
        any |= bits[word];
    }
    return any;
}
