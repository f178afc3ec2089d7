/* The connected parts of a bit mask: voxels that share a face belong together. */
#ifndef CTS_TABLE_PARTS_H
#define CTS_TABLE_PARTS_H

#include "base/bits.h"

/* Voxels first <= i < end of one row, all set, as long as possible. */
typedef struct CtsRun {
    uint32_t first, end;
    uint32_t part; /* index into CtsParts.parts */
} CtsRun;

typedef struct CtsPart {
    uint64_t n_voxels;
    int lo[3], hi[3]; /* the box of its voxels, hi included */
} CtsPart;

/* Runs in order of rows, k * dims[1] + j; the runs of row r are row_start[r] <= n < row_start[r + 1]. Parts are in
 * order of their first run. */
typedef struct CtsParts {
    int dims[3];
    CtsRun *runs;
    uint32_t *row_start;
    uint64_t n_runs; /* of which UINT32_MAX - 1 can be told apart */
    CtsPart *parts;
    uint32_t n_parts;
} CtsParts;

/* A zero-initialised CtsParts may be freed; finding frees what it held before. across_slices false: voxels of different
 * slices never belong together. */
CtsStatus cts_parts_find(CtsParts *parts, const CtsBits *bits, bool across_slices, CtsError *err);
void cts_parts_free(CtsParts *parts);

/* For each part, how many of its voxels are set in bits; free with cts_free(). */
CtsStatus cts_parts_count_in(const CtsParts *parts, const CtsBits *bits, uint64_t **count, CtsError *err);

/* Set the bits of the parts whose flag is set; all other bits become those of `under` (NULL: 0). */
void cts_parts_paint(const CtsParts *parts, const uint8_t *flags, const CtsBits *under, CtsBits *bits);

#endif
