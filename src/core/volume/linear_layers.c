#include "core/volume/linear_layers.h"

int cts_slice_below(const double *layer, int n_slices, int k)
{
    int below = 0;
    for (int end = n_slices; end - below > 1;) {
        const int middle = below + (end - below) / 2;
        if (layer[middle] <= k)
            below = middle;
        else
            end = middle;
    }
    return below;
}

void cts_slice_blend_row(uint16_t *restrict to, const uint16_t *low, const uint16_t *high, size_t n, float share)
{
    for (size_t i = 0; i < n; i++) {
        const float a = low[i], b = high[i];
        to[i] = (uint16_t)(int32_t)(a + (b - a) * share + 0.5f);
    }
}

CtsLinearLayer cts_linear_layer(const CtsLinearLayers *l, size_t layer_voxels, int k)
{
    const int below = cts_slice_below(l->layer, l->n_slices, k);
    const double past = k - l->layer[below];
    const uint16_t *const low = l->slices + (size_t)below * layer_voxels;
    if (below + 1 == l->n_slices || !(past > 0))
        return (CtsLinearLayer){low, NULL, 0};
    return (CtsLinearLayer){low, low + layer_voxels, (float)(past / (l->layer[below + 1] - l->layer[below]))};
}

const uint16_t *cts_linear_layer_row(const CtsLinearLayer *layer, size_t first, size_t n, uint16_t *to)
{
    if (!layer->high)
        return layer->low + first;
    cts_slice_blend_row(to, layer->low + first, layer->high + first, n, layer->share);
    return to;
}
