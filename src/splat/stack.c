#include "splat/stack.h"

#include "base/mem.h"

CtsStatus cts_stack_init(CtsStack *s, const CtsVolume *volume, int axis, CtsError *err)
{
    const int *dims = volume->dims;
    const size_t step[3] = {1, (size_t)dims[0], (size_t)dims[0] * (size_t)dims[1]};
    CtsStatus st;
    *s = (CtsStack){.grey = volume->grey,
                    .n_layers = dims[axis],
                    .axis = axis,
                    .u_axis = axis == 0 ? 1 : 0,
                    .v_axis = axis == 2 ? 1 : 2,
                    .loaded = {-1, -1}};
    s->n[0] = dims[s->u_axis];
    s->n[1] = dims[s->v_axis];
    s->v_step = step[s->v_axis];
    s->layer_step = step[axis];
    for (int c = 0; axis == 0 && c < 2; c++)
        if ((st = cts_alloc_array(&s->chunk[c], (size_t)s->n[0] * (size_t)s->n[1] * CTS_STACK_CHUNK, err)))
            return st;
    return CTS_OK;
}

void cts_stack_free(CtsStack *s)
{
    cts_free(&s->chunk[0]);
    cts_free(&s->chunk[1]);
}

void cts_stack_load(CtsStack *s, int chunk, int v0, int v1)
{
    const int k0 = chunk * CTS_STACK_CHUNK;
    const int n_k = s->n_layers - k0 < CTS_STACK_CHUNK ? s->n_layers - k0 : CTS_STACK_CHUNK;
    const size_t row = (size_t)s->n_layers, layer = (size_t)s->n[0] * (size_t)s->n[1];
    for (int v = v0; v < v1; v++) {
        const uint16_t *from = s->grey + (size_t)v * s->v_step + k0;
        uint16_t *to = s->chunk[chunk & 1] + (size_t)v * (size_t)s->n[0];
        /* Eight rows at a time: one read of each cache line, and writes that fill theirs. */
        for (int u0 = 0; u0 < s->n[0]; u0 += 8) {
            const int n_u = s->n[0] - u0 < 8 ? s->n[0] - u0 : 8;
            for (int k = 0; k < n_k; k++)
                for (int u = 0; u < n_u; u++)
                    to[(size_t)k * layer + (size_t)(u0 + u)] = from[(size_t)(u0 + u) * row + (size_t)k];
        }
    }
}

void cts_stack_set_loaded(CtsStack *s, int chunk)
{
    s->loaded[chunk & 1] = chunk;
}
