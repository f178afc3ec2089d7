/* One swath of patches at one step: its part of the sheet brought up to date, gradients, and what is to be composited.
 */
#ifndef CTS_SPLAT_SWATH_H
#define CTS_SPLAT_SWATH_H

#include "engine/splat/paper_plan.h"

/* One thread's scratch and counts. */
typedef struct CtsSwathWork {
    CtsPaperStore *store;           /* borrowed */
    uint64_t *marks, *taken, *row;  /* a bit for each voxel of a row: may be splatted, are; and for what else */
    uint64_t *cells;                /* needed ones of the row before a swath and of its own */
    int first, past;                /* words of a row within which all of that lies */
    uint64_t *visible;              /* voxels of the rows that reach into it, where it is found anew */
    /* Voxels that stand in what is needed, with their footprint added or left as they were; each of one swath alone. */
    uint64_t splatted, reused;
} CtsSwathWork;

CtsStatus cts_swath_work_init(CtsSwathWork *work, const CtsPaperPlan *plan, CtsError *err);
void cts_swath_work_free(CtsSwathWork *work);

/* Returns false when nothing of the swath is needed. Lattice points that no needed patch has hold anything. */
bool cts_swath_splat(CtsPaperPlan *plan, CtsSwathWork *work, int step, int swath);
/* Gradients at the voxels of needed patches. */
void cts_swath_gradients(const CtsPaperPlan *plan, CtsSwathWork *work, int step, int swath);

#endif
