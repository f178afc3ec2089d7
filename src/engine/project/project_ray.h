/* One ray of the modes mip, minip and average, cell by cell: the plain way, and the truth for the packets. */
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

/* What is seen of a cell that the ray is in from t = `from` to `to`. */
CtsSees cts_project_sees_way(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from,
                             double to);
/* *best becomes the largest (sign 1, or the smallest times -1) of what it was and what is seen there, at least in part;
 * false, and nothing has changed, where nothing is. */
bool cts_project_extreme_in(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from,
                            double to, CtsSees sees, double sign, double *best);
/* Grey level times length, and length. */
void cts_project_mean_in(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from, double to,
                         CtsSees sees, double *sum, double *length);

#endif
