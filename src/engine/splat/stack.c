#include "engine/splat/stack.h"

#include "base/mem.h"
#include "base/simd_fixed.h"

enum { AHEAD = 3 };

CtsStack cts_stack(const CtsVolume *volume, int axis)
{
    const int *dims = volume->dims;
    const size_t step[3] = {1, (size_t)dims[0], (size_t)dims[0] * (size_t)dims[1]};
    CtsStack s = {.grey = volume->grey,
                  .n_layers = dims[axis],
                  .axis = axis,
                  .u_axis = axis == 0 ? 1 : 0,
                  .v_axis = axis == 2 ? 1 : 2,
                  .loaded = {-1, -1}};
    s.n[0] = dims[s.u_axis];
    s.n[1] = dims[s.v_axis];
    s.v_step = step[s.v_axis];
    s.layer_step = step[axis];
    return s;
}

CtsStatus cts_stack_init(CtsStack *s, int n_rows, CtsError *err)
{
    CtsStatus st;
    s->n_rows = n_rows < s->n[1] ? n_rows : s->n[1];
    for (int c = 0; s->axis == 0 && c < 2; c++)
        if ((st = cts_alloc_zeroed(&s->chunk[c], (size_t)s->n[0] * (size_t)s->n_rows * CTS_STACK_CHUNK, err)))
            return st;
    return CTS_OK;
}

void cts_stack_begin(CtsStack *s, int first_row)
{
    s->first_row = first_row;
    s->loaded[0] = s->loaded[1] = -1;
}

void cts_stack_free(CtsStack *s)
{
    cts_free(&s->chunk[0]);
    cts_free(&s->chunk[1]);
}

/* Eight rows of the volume from u0 on, n_u of which exist, become eight columns of n_k layers. */
static void load_eight(const uint16_t *from, size_t row, int n_u, int n_k, uint16_t *to, size_t layer)
{
    int k = 0;
    for (; n_u == 8 && k + 8 <= n_k; k += 8)
        transpose_8x8(from + k, row, to + (size_t)k * layer, layer);
    for (; k < n_k; k++)
        for (int u = 0; u < n_u; u++)
            to[(size_t)k * layer + (size_t)u] = from[(size_t)u * row + (size_t)k];
}

void cts_stack_load(CtsStack *s, int chunk, int v, const uint64_t *wanted)
{
    const int k0 = chunk * CTS_STACK_CHUNK, n_eights = (s->n[0] + 7) / 8;
    const int n_k = s->n_layers - k0 < CTS_STACK_CHUNK ? s->n_layers - k0 : CTS_STACK_CHUNK;
    const size_t row = (size_t)s->n_layers, layer = (size_t)s->n[0] * (size_t)s->n_rows;
    const uint16_t *from = s->grey + (size_t)v * s->v_step + k0;
    uint16_t *to = s->chunk[chunk & 1] + (size_t)(v - s->first_row) * (size_t)s->n[0];
    for (int e = 0; e < n_eights; e++) {
        const int u0 = 8 * e, n_u = s->n[0] - u0 < 8 ? s->n[0] - u0 : 8;
        /* Rows are too far apart for the hardware prefetcher. */
        const int soon = e + AHEAD;
        if (soon < n_eights && (!wanted || wanted[soon / 64] >> (soon & 63) & 1))
            for (int u = 8 * soon; u < 8 * soon + 8 && u < s->n[0]; u++) {
                __builtin_prefetch(from + (size_t)u * row);
                __builtin_prefetch(from + (size_t)u * row + n_k - 1);
            }
        if (!wanted || wanted[e / 64] >> (e & 63) & 1)
            load_eight(from + (size_t)u0 * row, row, n_u, n_k, to + u0, layer);
    }
}

void cts_stack_set_loaded(CtsStack *s, int chunk)
{
    s->loaded[chunk & 1] = chunk;
}
