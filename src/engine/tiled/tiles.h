/* A picture of the tiled engine, tile by tile. */
#pragma once

#include "core/scene/engine.h"
#include "engine/tiled/tiled_march.h"

/* Fills the zeroed picture, with depth where it has room for it, and errors unless it is NULL; adds to *total. */
CtsStatus cts_tiled_run(const TiledJob *job, cts_tiled_march_fn march, const CtsScene *scene, CtsPicture *picture,
                        CtsErrorMap *errors, TiledCounts *total, CtsError *err);
