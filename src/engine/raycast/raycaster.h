/* The parts of the reference ray caster: derived once per picture, then read-only for all rays. */
#ifndef CTS_RAYCAST_RAYCASTER_H
#define CTS_RAYCAST_RAYCASTER_H

#include "core/scene/engine.h"
#include "engine/raycast/field.h"
#include "engine/raycast/owned.h"
#include "engine/raycast/quadrature.h"
#include "engine/raycast/transfer.h"

typedef struct CtsRaycaster {
    const CtsPreset *preset;
    CtsView view;
    const CtsField *field;
    CtsField *own_field;     /* NULL where the caller gave one */
    CtsTransfer transfer;    /* composite only */
    const CtsOwners *owners; /* NULL: all looks alike */
    CtsTransfer *looks;      /* of each look but what is hidden; composite only */
    CtsHuRanges wanted;      /* what any of them shows */
    CtsGauss coarse, fine;
    const struct CtsBodyMask *body; /* what minip and average look at; NULL: all */
    double frame[3][3];     /* a gradient in HU/voxel to HU/mm to the right, up and along the viewing direction */
    double camera_mm;       /* from the camera plane to t = 0 of every ray */
    double least_gradient2; /* below this square (HU/voxel) there is no gradient but rounding */
} CtsRaycaster;

/* What a ray has met so far. Depth is optical depth; transmittance is exp(-depth). */
typedef struct CtsRayLight {
    double rgb[3], depth, transmittance;
    double surface_mm; /* t where half of the light is taken, or else where anything is seen first; +inf before */
} CtsRayLight;

/* Front to back along one piece; gradient is NULL unlit. False when too little light is left to go on. */
bool cts_raycast_piece(const CtsRaycaster *caster, const CtsTransfer *transfer, const CtsRayPiece *piece,
                       const double (*gradient)[4], CtsRayLight *light);

/* HU that mip, minip or average shows for a ray inside the box; false where it meets nothing that counts. */
bool cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *hu);

/* Colour of a sample, lit by its gradient in HU/voxel. */
void cts_raycast_shade(const CtsRaycaster *caster, const double gradient[3], double rgb[3]);

/* True when the normal turns so little on a..b of a piece that a quadrature rule cannot pass over the highlight.
 * framed: the gradient's cubics in the caster's frame. */
bool cts_raycast_turns_little(const CtsRaycaster *caster, const double (*framed)[4], double a, double b);

/* Premultiplied red, green, blue and alpha of the ray of position (x, y) in pixels; 0 where it misses the box. depth_mm
 * (may be NULL) is as in CtsPicture. */
void cts_raycast_ray(const CtsRaycaster *caster, double x, double y, double rgba[4], double *depth_mm);

/* field is borrowed; NULL makes the one of the scene's volume and kernel, which cts_raycaster_free() frees. */
CtsStatus cts_raycaster_new(CtsRaycaster **caster, const CtsScene *scene, const CtsField *field, CtsError *err);
void cts_raycaster_free(CtsRaycaster **caster);

#endif
