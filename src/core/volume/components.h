/* Connected parts of a bit mask. */
#pragma once

#include "base/bits.h"

/* Voxels first <= i < end of one row, all set, as long as possible. */
typedef struct CtsRun {
    uint32_t first, end;
    uint32_t part; /* index into CtsComponents.parts */
} CtsRun;

typedef struct CtsComponent {
    uint64_t n_voxels;
    CtsVoxelBox box;
} CtsComponent;

/* Runs in order of rows, k * dims[1] + j; the runs of row r are row_start[r] <= n < row_start[r + 1]. Parts are in
 * order of their first run. */
typedef struct CtsComponents {
    int dims[3];
    CtsRun *runs;
    uint32_t *row_start;
    uint32_t n_runs;
    CtsComponent *parts;
    uint32_t n_parts;
} CtsComponents;

/* Connected voxels: those of one slice that share a face; those that share a face; those that share a face, an edge or
 * a corner. */
typedef enum CtsConnection { CTS_CONNECTED_IN_SLICE, CTS_CONNECTED_BY_FACES, CTS_CONNECTED_BY_CORNERS } CtsConnection;

/* A zero-initialised CtsComponents may be freed; finding frees the previous contents. */
CtsStatus cts_components_find(CtsComponents *parts, const CtsBits *bits, CtsConnection connection, CtsError *err);
/* The parts of runs that the caller has listed, each with its own number as its part. */
CtsStatus cts_components_join(CtsComponents *parts, CtsConnection connection, CtsError *err);
void cts_components_free(CtsComponents *parts);

/* True if a part reaches the border along one of the first n_axes axes. */
static inline bool cts_component_at_border(const CtsComponents *parts, uint32_t part, int n_axes)
{
    const CtsVoxelBox *const box = &parts->parts[part].box;
    bool at_border = false;
    for (int a = 0; a < n_axes; a++)
        at_border |= box->lo[a] == 0 || box->hi[a] == parts->dims[a] - 1;
    return at_border;
}

/* For each part, the number of its voxels that are set in bits; free with cts_free(). */
CtsStatus cts_components_count_in(const CtsComponents *parts, const CtsBits *bits, uint64_t **count, CtsError *err);

/* Sets the bits of the parts whose flag is set; all other bits become 0. */
void cts_components_paint(const CtsComponents *parts, const uint8_t *flags, CtsBits *bits);
/* The same for slice k alone, where other bits become those of `under` (NULL: 0). */
void cts_components_paint_slice(const CtsComponents *parts, const uint8_t *flags, int k, const CtsBits *under,
                                CtsBits *slice);
