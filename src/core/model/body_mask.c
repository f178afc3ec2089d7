#include "core/model/body_mask.h"

#include "base/mem.h"
#include <string.h>

static size_t n_nodes(const int n[3])
{
    return (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
}

CtsStatus cts_body_mask_new(CtsBodyMask **mask, const int n[3], const int step[3], CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(mask, 1, err);
    if (st)
        return st;
    memcpy((*mask)->n, n, sizeof(*mask)->n);
    memcpy((*mask)->step, step, sizeof(*mask)->step);
    for (int a = 0; a < 3; a++)
        (*mask)->per_step[a] = 1.0 / step[a];
    if ((st = cts_alloc_array(&(*mask)->share, n_nodes(n), err)))
        cts_body_mask_free(mask);
    return st;
}

void cts_body_mask_refine(CtsBodyMask *mask, int n)
{
    mask->step[2] *= n;
    mask->first[2] *= n;
    mask->per_step[2] = 1.0 / mask->step[2];
}

void cts_body_mask_free(CtsBodyMask **mask)
{
    if (!*mask)
        return;
    cts_free(&(*mask)->share);
    cts_free(mask);
}

static const uint8_t *node_at(const CtsBodyMask *m, int i, int j, int k)
{
    return m->share + ((size_t)k * (size_t)m->n[1] + (size_t)j) * (size_t)m->n[0] + (size_t)i;
}

CtsMaskCover cts_body_mask_cover(const CtsBodyMask *m, const int low[3], const int high[3])
{
    int from[3], to[3], least = 255, most = 0;
    for (int a = 0; a < 3; a++) {
        from[a] = cts_body_mask_node(m, a, low[a]);
        to[a] = cts_body_mask_node(m, a, high[a] - 1) + 1;
        to[a] = to[a] < m->n[a] ? to[a] : m->n[a] - 1;
    }
    for (int k = from[2]; k <= to[2]; k++)
        for (int j = from[1]; j <= to[1]; j++) {
            const uint8_t *const row = node_at(m, 0, j, k);
            for (int i = from[0]; i <= to[0]; i++) {
                least = row[i] < least ? row[i] : least;
                most = row[i] > most ? row[i] : most;
            }
        }
    return least > CTS_BODY_THRESHOLD ? CTS_COVER_ALL : most > CTS_BODY_THRESHOLD ? CTS_COVER_SOME : CTS_COVER_NONE;
}

void cts_body_mask_corners(const CtsBodyMask *m, const int cell[3], double corner[8])
{
    int low[3], high[3];
    for (int a = 0; a < 3; a++) {
        low[a] = cts_body_mask_node(m, a, cell[a]);
        high[a] = low[a] + 1 < m->n[a] ? low[a] + 1 : low[a];
    }
    for (int c = 0; c < 8; c++)
        corner[c] = *node_at(m, c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]);
}

double cts_body_mask_at(const CtsBodyMask *m, const double at[3])
{
    const int cell[3] = {(int)at[0], (int)at[1], (int)at[2]};
    double v[8];
    cts_body_mask_corners(m, cell, v);
    for (int a = 0, n = 4; a < 3; a++, n /= 2) {
        const double f = cts_body_mask_place(m, a, cell[a], at[a] - cell[a]);
        for (int i = 0; i < n; i++)
            v[i] = v[2 * i] + f * (v[2 * i + 1] - v[2 * i]);
    }
    return v[0];
}
