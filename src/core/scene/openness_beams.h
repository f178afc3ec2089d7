/* The kernel of openness: transmittances along directions, in whole numbers, which no order of sums changes. */
#ifndef CTS_SCENE_OPENNESS_BEAMS_H
#define CTS_SCENE_OPENNESS_BEAMS_H

#include <stddef.h>
#include <stdint.h>

enum {
    OPENNESS_CHUNK = 64, /* blocks along x that are looked from together */
    OPENNESS_DIRECTIONS = 26,
    OPENNESS_MAX_STEPS = 31, /* so that a direction's sum stays below 2^16 */
    OPENNESS_BITS = 11,      /* of a transmittance in sums */
    OPENNESS_OPEN = (1 << OPENNESS_BITS) - 1
};

/* Steps in a direction. */
typedef struct OpennessBeams {
    const uint16_t *from; /* transmittance of blocks, in 2^-16, where the steps begin: at block 0 of the row */
    ptrdiff_t step;       /* entries from one to the next */
    int n_inside;         /* steps before the volume ends along y or z */
    uint16_t n_beyond;    /* those that follow, where nothing absorbs */
    uint16_t mean;        /* 2^16 / (number of all steps + 1), at most 2^16 - 1 */
} OpennessBeams;

/* Openness of OPENNESS_CHUNK blocks of a row from block i on, in 1/255. */
typedef void (*cts_openness_beams_fn)(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness);
void cts_openness_beams_c(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness);
void cts_openness_beams_avx2(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness);
void cts_openness_beams_avx512(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness);

#endif
