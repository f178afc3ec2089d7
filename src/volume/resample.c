#include "volume/resample.h"

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

void cts_resample_stack(uint16_t *grey, size_t layer_voxels, const double *layer, int n_slices, int n_layers,
                        int offset, int n_threads)
{
    const size_t n_chunks = (layer_voxels + CHUNK - 1) / CHUNK;
#pragma omp parallel for num_threads(n_threads) schedule(static)
    for (size_t chunk = 0; chunk < n_chunks; chunk++) {
        const size_t first = chunk * CHUNK, n = layer_voxels - first < CHUNK ? layer_voxels - first : CHUNK;
        int below = 0;
        for (int j = 0; j < n_layers; j++) {
            below = slice_below(layer, n_slices, j, below);
            uint16_t *to = grey + (size_t)j * layer_voxels + first;
            const uint16_t *low = grey + (size_t)(offset + below) * layer_voxels + first;
            const double past = j - layer[below];
            if (below + 1 < n_slices && past > 0)
                blend(to, low, low + layer_voxels, n, (float)(past / (layer[below + 1] - layer[below])));
            else
                keep(to, low, n);
        }
    }
}
