/* One ray of the modes mip, minip and average, and which stretches of it are seen within one cell. */
#ifndef CTS_TILED_PROJECT_RAY_H
#define CTS_TILED_PROJECT_RAY_H

#include "core/scene/engine.h"
#include "core/volume/body_mask.h"
#include "core/volume/macrocells.h"
#include "core/volume/owners.h"

typedef struct CtsProjector {
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    const CtsView *view;
    CtsMode mode;
    const CtsBodyMask *body; /* what alone is seen; NULL: all */
    const CtsOwners *owners; /* some of whom are hidden; NULL: nobody is */
    ptrdiff_t stride[3];     /* of voxels; 0 along an axis of one */
} CtsProjector;

/* A ray in voxel coordinates: start + t * step, t in mm, inside the box from t0 to t1. */
typedef struct CtsProjectedRay {
    double start[3], step[3], t0, t1;
} CtsProjectedRay;

/* Pixel (x, y)'s ray; false where it misses the box. */
bool cts_project_clip(const CtsView *view, double x, double y, CtsProjectedRay *ray);
/* The grey level at t0 of a ray that has no length, as at a corner of the box; infinite where nothing is seen. */
double cts_project_point(const CtsProjector *projector, const CtsProjectedRay *ray);

/* What is seen of a cell that the ray is in from t = `from` to `to`: stretches first[] to last[] of it, in order, and
 * how many. */
int cts_project_stretches(const CtsProjector *projector, const CtsProjectedRay *ray, const int cell[3], double from,
                          double to, double first[CTS_CELL_STRETCHES], double last[CTS_CELL_STRETCHES]);

#endif
