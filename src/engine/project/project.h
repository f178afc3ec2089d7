/* The modes mip, minip and average: extremes and means of the trilinear field along each ray, exactly, with macro-cells
 * that cannot change them passed over. */
#pragma once

#include "core/scene/engine.h"

/* Visible cells of a volume, where not all are. */
typedef struct CtsVisibleBlocks CtsVisibleBlocks;
void cts_visible_blocks_free(CtsVisibleBlocks **blocks);

/* *blocks: NULL, or the cache of an earlier picture of the volume; the caller frees it. picture NULL: only the plan. */
CtsStatus cts_project(const CtsScene *scene, CtsVisibleBlocks **blocks, CtsPicture *picture, CtsReport *report,
                      CtsError *err);
