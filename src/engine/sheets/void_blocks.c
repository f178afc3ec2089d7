/* Void blocks: the blocks of 4^3 cells that may be visible. */
#include "engine/sheets/sheets.h"

#include "base/mem.h"

CtsStatus cts_sheets_void_init(SheetsVoid *v, const CtsMacrocells *m, const CtsLut *lut, int p, CtsError *err)
{
    static const int within[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    const int a = within[p][0], b = within[p][1];
    const size_t stride[3] = {1, (size_t)m->n_fine[0], (size_t)m->n_fine[0] * (size_t)m->n_fine[1]};
    CtsStatus st;
    *v = (SheetsVoid){.n = {m->n_fine[a], m->n_fine[b]},
                      .n_layers = m->n_fine[p],
                      .row_words = (m->n_fine[a] + SHEETS_WORD_STEP - 1) / SHEETS_WORD_STEP};
    const size_t rows = (size_t)v->n[1] * (size_t)v->n_layers;
    if ((st = cts_alloc_zeroed(&v->bits, rows * (size_t)v->row_words, err)))
        return st;
    for (size_t layer = 0; layer < (size_t)v->n_layers; layer++)
        for (size_t j = 0; j < (size_t)v->n[1]; j++) {
            uint32_t *const row = v->bits + (layer * (size_t)v->n[1] + j) * (size_t)v->row_words;
            for (size_t i = 0; i < (size_t)v->n[0]; i++) {
                const CtsRange r = m->fine[layer * stride[p] + j * stride[b] + i * stride[a]];
                const size_t word = i / SHEETS_WORD_STEP, bit = i % SHEETS_WORD_STEP;
                if (!cts_lut_visible(lut, r.low, r.high))
                    continue;
                v->n_visible++;
                row[word] |= UINT32_C(1) << bit;
                if (word > 0)
                    row[word - 1] |= UINT32_C(1) << (bit + SHEETS_WORD_STEP);
            }
        }
    return CTS_OK;
}

double cts_sheets_visible_share(const SheetsVoid *v)
{
    return (double)v->n_visible / ((double)v->n[0] * v->n[1] * v->n_layers);
}

void cts_sheets_void_free(SheetsVoid *v)
{
    cts_free(&v->bits);
}
