/* Smallest and largest grey level of each macro-cell: 8 x 8 x 8 cells of the volume, or 4 x 4 x 4 in the fine ones for
 * a closer look. A cell lies between 2 x 2 x 2 voxels, so whatever is interpolated inside a macro-cell lies between its
 * smallest and largest level. Every engine that skips empty space needs them; they are made slice by slice, so that a
 * reader can do it while a slice is still in the cache. */
#ifndef CTS_VOLUME_MACROCELLS_H
#define CTS_VOLUME_MACROCELLS_H

#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_MACROCELL = 8, CTS_FINE_MACROCELL = 4 };

typedef struct CtsRange {
    uint16_t low, high;
} CtsRange;

/* Macro-cell (bi, bj, bk) is range[(bk * n[1] + bj) * n[0] + bi] and covers voxels 8 b to 8 b + 8 of each axis; the
 * fine ones likewise with 4. */
typedef struct CtsMacrocells {
    int n[3], n_fine[3];
    CtsRange *range, *fine;
    CtsRange all;
    int dims[3];
    struct CtsBits *dense; /* voxels of at least dense_min, where they were marked on the way; NULL: not */
    uint16_t dense_min;
    uint32_t *dense_runs; /* how many runs of them each slice has */
    CtsRange *shared;     /* while slices are added: ranges of the slices on which two fine macro-cells meet */
    bool *begun;          /* then, too: whether a layer of fine macro-cells has had a slice */
} CtsMacrocells;

/* Empty macro-cells for a volume of these dimensions. */
CtsStatus cts_macrocells_begin(CtsMacrocells **macrocells, const int dims[3], CtsError *err);
/* The voxels of at least this level are to be marked as slices are added: right after cts_macrocells_begin(). */
CtsStatus cts_macrocells_mark(CtsMacrocells *macrocells, uint16_t dense_min, CtsError *err);
/* Hands the marks over, with how many runs they are; false where there are none for this level. */
bool cts_macrocells_take_marks(CtsMacrocells *macrocells, uint16_t dense_min, struct CtsBits *dense, uint64_t *n_runs);
/* Rows first <= j < end of slice k, dims[0] * dims[1] voxels: the rows of a slice in order, in as many parts as one
 * likes; slices each once, in any order, but slices of the same k / CTS_FINE_MACROCELL from one thread at a time. */
void cts_macrocells_add(CtsMacrocells *macrocells, int k, const uint16_t *slice, int first, int end);
/* After the last slice. */
void cts_macrocells_end(CtsMacrocells *macrocells, int n_threads);
/* The ranges of the coarse macro-cells and of all, once the fine ones have changed. */
void cts_macrocells_sum(CtsMacrocells *macrocells, int n_threads);
void cts_macrocells_free(CtsMacrocells **macrocells);

/* Those of the volume in which grey level g has become level[g]; levels never fall as g rises. */
CtsStatus cts_macrocells_map(CtsMacrocells **mapped, const CtsMacrocells *macrocells, const uint16_t *level,
                             CtsError *err);

/* All of it for a volume in memory, by n_threads. */
CtsStatus cts_macrocells_new(CtsMacrocells **macrocells, const CtsVolume *volume, int n_threads, CtsError *err);

#endif
