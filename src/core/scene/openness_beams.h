/* The kernels of openness: transmittances along directions, in whole numbers. */
#pragma once

#include <stddef.h>
#include <stdint.h>

enum {
    OPENNESS_LANES = 32, /* blocks along x are processed in multiples of this */
    OPENNESS_DIRECTIONS = 26,
    OPENNESS_MAX_STEPS = 31,      /* so that a direction's sum stays below 2^16 */
    OPENNESS_OPEN = (1 << 11) - 1 /* transmittance 1 in sums; 26 of them stay below 2^16 */
};

/* Steps in a direction from a row of blocks. */
typedef struct OpennessBeams {
    const uint16_t *from; /* transmittance of the first block of the row, in 2^-16 */
    ptrdiff_t step;       /* entries from one step to the next */
    int n_steps;          /* within the volume */
    uint16_t rest;        /* sum of transmittances beyond them, in OPENNESS_OPEN */
    uint16_t mean;        /* 2^16 / (number of all steps + 1), at most 2^16 - 1 */
} OpennessBeams;

/* The loops that base/cpu.h chooses; all give the same bytes. */
typedef struct OpennessKernels {
    /* Adds the openness of a direction, in OPENNESS_OPEN, for n blocks of a row, a multiple of OPENNESS_LANES. */
    void (*add_beams)(const OpennessBeams *beams, int n, uint16_t *sums);
    /* Openness in 1/255 of n blocks from their sums over all directions, and a part that they share. Reads sums up to
     * the next multiple of OPENNESS_LANES. */
    void (*scale)(const uint16_t *sums, uint16_t shared, int n, uint8_t *openness);
} OpennessKernels;

extern const OpennessKernels cts_openness_kernels_plain, cts_openness_kernels_avx2, cts_openness_kernels_avx512;
