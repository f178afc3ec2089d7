/* The modes mip, minip and average: extremes and means of the trilinear field along each ray, exactly, with macro-cells
 * that cannot change them passed over. */
#ifndef CTS_TILED_PROJECT_H
#define CTS_TILED_PROJECT_H

#include "core/scene/engine.h"
#include "core/volume/macrocells.h"

/* Which cells of a volume are seen, where not all are. */
typedef struct CtsSeen CtsSeen;
void cts_seen_free(CtsSeen **seen);

/* *seen: NULL, or what an earlier picture of the volume left there; the caller frees it. picture NULL: only make the
 * plan. */
CtsStatus cts_project(const CtsScene *scene, const CtsMacrocells *macrocells, CtsSeen **seen, CtsPicture *picture,
                      CtsReport *report, CtsError *err);

#endif
