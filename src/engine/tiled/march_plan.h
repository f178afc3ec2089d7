/* What the tiled engine does for the error asked for, and how it tells. */
#ifndef CTS_TILED_MARCH_PLAN_H
#define CTS_TILED_MARCH_PLAN_H

#include "engine/tiled/march.h"

/* Sheets and limits, from the scene's plan and how steep the preset is. The job has its
 * geometry and its table. */
void cts_tiled_plan(TiledJob *job, const CtsScene *scene);

/* reach: how far, in macro-cells, from a visible one voxels are copied. simd_path: its name. */
void cts_tiled_plan_report(const TiledJob *job, const CtsScene *scene, const CtsLayout *layout, int reach,
                           const char *simd_path, CtsReport *report);

#endif
