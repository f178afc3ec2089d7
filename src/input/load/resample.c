#include "input/load/load.h"

#include "base/parallel.h"
#include "core/volume/linear_layers.h"
#include "core/volume/slice_interpolation.h"
#include <string.h>

/* Voxels of one layer that a thread follows up the stack: 8 KiB of each of five layers stay in the cache. Changes no
 * result. */
enum { CHUNK = 4096 };

int cts_resample_offset(const double *layer, int n_slices, int n_layers)
{
    int offset = 0;
    for (int j = 0; j < n_layers; j++) {
        const int below = cts_slice_below(layer, n_slices, j);
        offset = j - below > offset ? j - below : offset;
    }
    /* A cubic also needs the slice before the two that enclose the layer. */
    return offset + 1;
}

/* n voxels of the layer `past` layers above slice k; to must not overlap slices still needed, but may be the place of
 * slice k - 1. */
static void blend_cubic(const CtsResampling *s, uint16_t *to, const uint16_t *slice, int k, double past, size_t n)
{
    uint16_t made[CHUNK];
    const double *at = s->layer + k;
    const bool first = k == 0, last = k + 2 == s->n_slices;
    const double here = at[1] - at[0];
    const double distance[3] = {first ? here : at[0] - at[-1], here, last ? here : at[2] - at[1]};
    const uint16_t *const next = slice + s->layer_voxels;
    const uint16_t *const slices[4] = {first ? slice : slice - s->layer_voxels, slice, next,
                                       last ? next : next + s->layer_voxels};
    const CtsInterpolationWeights weights = cts_slice_interpolation_weights(past / here, distance);
    cts_slice_interpolation_row(made, slices, (int)n, &weights);
    memcpy(to, made, n * sizeof *to);
}

typedef struct Stack {
    const CtsResampling *resampling;
    uint16_t *grey;
} Stack;

static void resample_some(const Stack *stack, size_t first, size_t n)
{
    const CtsResampling *const s = stack->resampling;
    for (int j = 0; j < s->n_layers; j++) {
        const int below = cts_slice_below(s->layer, s->n_slices, j);
        uint16_t *to = stack->grey + (size_t)j * s->layer_voxels + first;
        const uint16_t *low = stack->grey + (size_t)(s->offset + below) * s->layer_voxels + first;
        const double past = j - s->layer[below];
        if (below + 1 == s->n_slices || !(past > 0))
            memmove(to, low, n * sizeof *to);
        else if (s->linear)
            cts_slice_blend_row(to, low, low + s->layer_voxels, n,
                                (float)(past / (s->layer[below + 1] - s->layer[below])));
        else
            blend_cubic(s, to, low, below, past, n);
    }
}

static void resample_columns(void *context, int worker, size_t first, size_t end)
{
    (void)worker;
    for (; first < end; first += CHUNK)
        resample_some(context, first, end - first < CHUNK ? end - first : CHUNK);
}

void cts_resample_stack(uint16_t *grey, const CtsResampling *resampling, int n_threads)
{
    Stack stack = {resampling, grey};
    cts_parallel(n_threads, resampling->layer_voxels, CHUNK, resample_columns, &stack);
}
