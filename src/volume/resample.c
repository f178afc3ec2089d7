#include "volume/resample.h"

#include "base/parallel.h"
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
    return offset;
}

static void blend(uint16_t *to, const uint16_t *low, const uint16_t *high, size_t n, float weight)
{
    for (size_t i = 0; i < n; i++) {
        const float a = low[i], b = high[i];
        to[i] = (uint16_t)(int32_t)(a + (b - a) * weight + 0.5f);
    }
}

static void keep(uint16_t *to, const uint16_t *from, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] = from[i];
}

typedef struct Stack {
    uint16_t *grey;
    size_t layer_voxels;
    const double *layer;
    int n_slices, n_layers, offset;
} Stack;

static void resample_columns(void *context, int worker, size_t first, size_t end)
{
    const Stack *const s = context;
    int below = 0;
    (void)worker;
    for (int j = 0; j < s->n_layers; j++) {
        below = slice_below(s->layer, s->n_slices, j, below);
        uint16_t *to = s->grey + (size_t)j * s->layer_voxels + first;
        const uint16_t *low = s->grey + (size_t)(s->offset + below) * s->layer_voxels + first;
        const double past = j - s->layer[below];
        if (below + 1 < s->n_slices && past > 0)
            blend(to, low, low + s->layer_voxels, end - first, (float)(past / (s->layer[below + 1] - s->layer[below])));
        else
            keep(to, low, end - first);
    }
}

void cts_resample_stack(uint16_t *grey, size_t layer_voxels, const double *layer, int n_slices, int n_layers,
                        int offset, int n_threads)
{
    Stack stack = {grey, layer_voxels, layer, n_slices, n_layers, offset};
    cts_parallel(n_threads, layer_voxels, CHUNK, resample_columns, &stack);
}
