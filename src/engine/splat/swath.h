/* One swath of patches at one step: update of its part of the sheet, gradients, and cells to composite. */
#pragma once

#include "engine/splat/paper_plan.h"

/* One thread's scratch and counts. */
typedef struct CtsSwathWork {
    CtsPaperStore *store;             /* borrowed */
    uint64_t *marks, *selected, *row; /* a bit for each voxel of a row: candidates, splatted ones; and scratch. marks:
                                         the memory of all bits */
    uint64_t *cells;                  /* needed ones of the row before a swath and of its own */
    int first, past;                  /* range of words of a row that contain all of that */
    uint64_t *visible;                /* voxels of the rows that reach into it, when recomputed */
    /* Voxels in needed cells, with their footprint added or unchanged; each counted in one swath. */
    uint64_t splatted, reused;
} CtsSwathWork;

CtsStatus cts_swath_work_init(CtsSwathWork *work, const CtsPaperPlan *plan, CtsError *err);

/* Returns false when nothing of the swath is needed. Lattice points that no needed patch has hold anything. */
bool cts_swath_splat(CtsPaperPlan *plan, CtsSwathWork *work, int step, int swath);
/* Gradients at the voxels of needed patches. */
void cts_swath_gradients(const CtsPaperPlan *plan, CtsSwathWork *work, int step, int swath);
