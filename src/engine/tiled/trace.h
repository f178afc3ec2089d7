/* The march of one ray, segment by segment, as JSON Lines in a report. */
#pragma once

#include "engine/tiled/tiled_march.h"

/* Marches the ray of pixel (x, y) of a view by one of the marches in plain C, which report segments, and
 * adds its lines: the ray, each segment, the pixel. precision: the march's name in them. */
CtsStatus cts_tiled_trace(const TiledJob *job, const CtsScene *scene, cts_tiled_march_fn march, const char *precision,
                          int x, int y, CtsReport *report, CtsError *err);
