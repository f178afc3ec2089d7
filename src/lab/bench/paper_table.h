/* `ctsplat bench --paper`: the paper's engines, configured as in the paper (cones from a table, 8 bits, unlit, one
 * picture of each in turn), and their times in per cent of plain splatting beside the published ones. */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/volume.h"

enum { CTS_PAPER_ROWS = 7, CTS_PAPER_ROUNDS = 15, CTS_PAPER_BITS = 8 };

typedef struct CtsPaperRow {
    const char *name;
    CtsEngineId engine;
    bool no_occlusion_culling, always_reuse_layers; /* as in CtsRenderSettings */
    double paper_percent;                           /* the paper's mean; 0: it has no such engine */
    const char *paper_sets;                         /* those of its data sets, one by one; NULL likewise */
    double ms[CTS_PAPER_ROUNDS]; /* of each round; wall, or with one thread CPU time, which others disturb less */
    double median_ms, percent;   /* medians; percent of classic's of the same round, with its quartiles */
    double percent_low, percent_high;
    bool same; /* the picture has classic's bytes */
    CtsVoxelCounts voxels;
} CtsPaperRow;

typedef struct CtsPaperTable {
    CtsPaperRow rows[CTS_PAPER_ROWS];
    int n_threads;
} CtsPaperTable;

typedef struct CtsPaperSettings {
    const CtsVolume *volume;
    const CtsPreset *preset;
    CtsRenderSettings render;                                 /* size, view, threads, stop */
    void (*progress)(double done, int all, const char *what); /* before each picture; NULL: silent */
} CtsPaperSettings;

CtsStatus cts_paper_table(const CtsPaperSettings *settings, CtsPaperTable *table, CtsError *err);
