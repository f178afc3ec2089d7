/* One ray of the modes mip, minip and average, cell by cell: the plain way, and the truth for the packets. */
#ifndef CTS_TILED_PROJECT_RAY_H
#define CTS_TILED_PROJECT_RAY_H

#include "core/scene/engine.h"
#include "core/volume/body_mask.h"
#include "core/volume/macrocells.h"

typedef struct CtsProjector {
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    const CtsView *view;
    CtsMode mode;
    const CtsBodyMask *body; /* what alone is seen; NULL: all */
    ptrdiff_t stride[3];     /* of voxels */
} CtsProjector;

/* A ray in voxel coordinates: start + t * step, t in mm, inside the box from t0 to t1. */
typedef struct CtsProjectedRay {
    double start[3], step[3], per_step[3], t0, t1; /* per_step is 0 where step is */
} CtsProjectedRay;

/* Pixel (x, y)'s ray; false where it misses the box. */
bool cts_project_clip(const CtsView *view, double x, double y, CtsProjectedRay *ray);
/* Its largest, smallest or mean grey level, as the mode asks; infinite where nothing is seen. */
double cts_project_along(const CtsProjector *projector, const CtsProjectedRay *ray);

static inline bool cts_project_sees(const CtsProjector *p, const int cell[3])
{
    return !p->body || cts_body_mask_has(p->body, cell);
}

#endif
