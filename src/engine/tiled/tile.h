/* Tiles: what a thread takes of the picture at a time. */
#ifndef CTS_TILED_TILE_H
#define CTS_TILED_TILE_H

#include "engine/tiled/march.h"

/* The SIMD path of a picture: the fastest, which takes `at_once` ray packets, and the one for what is left over. */
typedef struct TiledPath {
    const char *name;
    cts_tiled_packets_fn packets, single;
    int at_once;
} TiledPath;

/* What a thread works with: room for its beams' runs, and what it counts. */
typedef struct TiledWorkspace {
    TiledRun *runs; /* cts_tiled_n_runs of them; the caller's */
    TiledCounts counts;
} TiledWorkspace;

int cts_tiled_n_tiles(const TiledJob *job);
size_t cts_tiled_n_runs(const TiledJob *job);
void cts_tiled_run_tile(const TiledJob *job, const TiledPath *path, TiledWorkspace *workspace, int index);

#endif
