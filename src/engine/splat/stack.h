/* The volume as a stack of layers across the principal axis, each a picture of rows that are contiguous in memory: the
 * volume's own, or across x those of its transposed copy. */
#pragma once

#include "ctsplat/volume.h"
#include <stddef.h>
#include <stdint.h>

typedef struct CtsStack {
    const uint16_t *grey; /* across x to be set by the caller (core/model/transposed.h) */
    int n_layers;
    int axis, u_axis, v_axis;  /* of the volume: across the layers, along a row, from row to row */
    int n[2];                  /* voxels of a layer: along a row, rows */
    size_t v_step, layer_step; /* from row to row and from layer to layer */
} CtsStack;

static inline CtsStack cts_stack(const CtsVolume *volume, int axis)
{
    const int *const dims = volume->dims, u_axis = axis == 0 ? 1 : 0, v_axis = axis == 2 ? 1 : 2;
    const size_t row = (size_t)dims[u_axis], slice = (size_t)dims[0] * (size_t)dims[1];
    return (CtsStack){.grey = axis == 0 ? NULL : volume->grey,
                      .n_layers = dims[axis],
                      .axis = axis,
                      .u_axis = u_axis,
                      .v_axis = v_axis,
                      .n = {dims[u_axis], dims[v_axis]},
                      .v_step = axis == 2 ? row : slice,
                      .layer_step = axis == 2 ? slice : row};
}

/* Row v of layer k: n[0] grey levels. */
static inline const uint16_t *cts_stack_row(const CtsStack *stack, int k, int v)
{
    return stack->grey + (size_t)k * stack->layer_step + (size_t)v * stack->v_step;
}
