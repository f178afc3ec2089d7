#include "input/load/load.h"

#include "base/cpu.h"
#include "base/parallel.h"
#include "core/volume/slice_interpolation.h"
#include <string.h>

enum { CHUNK = 4096 }; /* voxels of one layer that a thread follows up the stack */

/* The slice at or below layer j. Called with rising j, from where the last search ended. */
static int slice_below(const double *layer, int n_slices, int j, int from)
{
    while (from + 1 < n_slices && layer[from + 1] <= j)
        from++;
    return from;
}

int cts_resample_offset(const double *layer, int n_slices, int n_layers)
{
    int offset = 0, below = 0;
    for (int j = 0; j < n_layers; j++) {
        below = slice_below(layer, n_slices, j, below);
        offset = j - below > offset ? j - below : offset;
    }
    /* A cubic also needs the slice before the two that enclose the layer. */
    return offset + 1;
}

static inline __attribute__((always_inline)) void blend_any(uint16_t *to, const uint16_t *low, const uint16_t *high,
                                                            size_t n, float weight)
{
    for (size_t i = 0; i < n; i++) {
        const float a = low[i], b = high[i];
        to[i] = (uint16_t)(int32_t)(a + (b - a) * weight + 0.5f);
    }
}

CTS_CPU_VARIANTS(void, blend_layers, (uint16_t * to, const uint16_t *low, const uint16_t *high, size_t n, float weight),
                 blend_any(to, low, high, n, weight))

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
    void (*const blend)(uint16_t *, const uint16_t *, const uint16_t *, size_t, float) =
        CTS_CPU_CHOICE(cts_cpu_flags(), blend_layers);
    int below = 0;
    for (int j = 0; j < s->n_layers; j++) {
        below = slice_below(s->layer, s->n_slices, j, below);
        uint16_t *to = stack->grey + (size_t)j * s->layer_voxels + first;
        const uint16_t *low = stack->grey + (size_t)(s->offset + below) * s->layer_voxels + first;
        const double past = j - s->layer[below];
        if (below + 1 == s->n_slices || !(past > 0))
            memmove(to, low, n * sizeof *to);
        else if (s->linear)
            blend(to, low, low + s->layer_voxels, n, (float)(past / (s->layer[below + 1] - s->layer[below])));
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
