/* The volume as a stack of layers across the principal axis, each a picture of rows that are contiguous in memory.
 *
 * Across z and y the volume's own rows are used. Across x voxels of a layer are a row apart, so layers are transposed a
 * chunk at a time; two chunks are kept, and the caller must load those that it reads. */
#pragma once

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CTS_STACK_CHUNK = 32 };

typedef struct CtsStack {
    const uint16_t *grey;
    int n_layers;
    int axis, u_axis, v_axis;  /* of the volume: across the layers, along a row, from row to row */
    int n[2];                  /* voxels of a layer: along a row, rows */
    size_t v_step, layer_step; /* distances in grey; rows are contiguous unless axis is 0 */
    uint16_t *chunk[2];
    int n_rows, first_row; /* rows that a chunk has room for, and the first of those it holds now */
    int loaded[2];         /* index of the chunk of layers, or -1 */
} CtsStack;

/* Without chunks: rows cannot be read yet where they need them. */
CtsStack cts_stack(const CtsVolume *volume, int axis);
/* Allocates room for so many rows at a time, if chunks are needed; then sets their starts. */
CtsStatus cts_stack_init(CtsStack *stack, int n_rows, CtsError *err);
void cts_stack_begin(CtsStack *stack, int first_row);
void cts_stack_free(CtsStack *stack);

/* The chunk that must be loaded before layer k can be read, or -1. */
static inline int cts_stack_missing(const CtsStack *stack, int k)
{
    const int chunk = k / CTS_STACK_CHUNK;
    return stack->axis == 0 && stack->loaded[chunk & 1] != chunk ? chunk : -1;
}

/* Loads row v of a chunk: eight voxels at a time, those whose bit is set in wanted (NULL: all); threads may share the
 * rows. Afterwards one thread marks the chunk as loaded. */
void cts_stack_load(CtsStack *stack, int chunk, int v, const uint64_t *wanted);
void cts_stack_set_loaded(CtsStack *stack, int chunk);

/* Row v of layer k: n[0] grey levels. */
static inline const uint16_t *cts_stack_row(const CtsStack *stack, int k, int v)
{
    if (stack->axis != 0)
        return stack->grey + (size_t)k * stack->layer_step + (size_t)v * stack->v_step;
    return stack->chunk[(k / CTS_STACK_CHUNK) & 1] +
           ((size_t)(k % CTS_STACK_CHUNK) * (size_t)stack->n_rows + (size_t)(v - stack->first_row)) *
               (size_t)stack->n[0];
}
