/* Tiles: what a thread takes of the picture at a time. */
#ifndef CTS_TILED_TILE_H
#define CTS_TILED_TILE_H

#include "tiled/march.h"

enum { TILED_BEAMS_DOWN = 8, TILED_BEAMS_ACROSS = 8, TILED_MOST_LEVELS = 3 };

/* The SIMD path of a picture: the fastest, which takes `at_once` ray packets, and the one for what is left over. */
typedef struct TiledPath {
    const char *name;
    cts_tiled_packets_fn packets, single;
    int at_once;
} TiledPath;

/* What a thread works with: a tile's beams, and what it counts. */
typedef struct TiledWorkspace {
    TiledBeam beams[TILED_BEAMS_DOWN][TILED_BEAMS_ACROSS];
    bool met[TILED_BEAMS_DOWN][TILED_BEAMS_ACROSS]; /* whether the beam may meet something */
    TiledRun *runs;                                 /* cts_tiled_n_runs of them; the caller's */
    TiledCounts counts;
} TiledWorkspace;

int cts_tiled_n_tiles(const TiledJob *job);
size_t cts_tiled_n_runs(const TiledJob *job);
void cts_tiled_run_tile(const TiledJob *job, const TiledPath *path, TiledWorkspace *workspace, int index);

#endif
