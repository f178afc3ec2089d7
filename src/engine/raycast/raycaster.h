/* Compositing along rays; field.h has the fields. */
#pragma once

#include "core/model/voxel_labels.h"
#include "core/scene/engine.h"
#include "ctsplat/preset.h"
#include "engine/raycast/field.h"

/* The preset's transfer function, split at its control points, so that between two of them opacity and colour are
 * linear in HU and the extinction is either one smooth formula or the cap. Derived from cts_preset_opacity() and
 * cts_preset_colour(). */

/* From low_hu up to, not including, high_hu; the first starts at -inf, the last ends at +inf. */
typedef struct CtsSpan {
    double low_hu, high_hu;
    double at_hu;                  /* HU of the first values below */
    double opacity, opacity_slope; /* per unit distance; slope per HU */
    double rgb[3], rgb_slope[3];
    bool visible;         /* opacity above 0 somewhere */
    bool flat_extinction; /* extinction_per_mm holds everywhere */
    bool flat_colour;
    double extinction_per_mm;
} CtsSpan;

typedef struct CtsTransfer {
    int n;
    CtsSpan spans[4 * CTS_MAX_POINTS];
    CtsHuRanges visible;
    double unit_distance_mm, scale; /* scale as CtsScene.extinction_scale */
} CtsTransfer;

void cts_transfer_init(CtsTransfer *transfer, const CtsPreset *preset, double extinction_scale);

/* Index of the span that holds hu; below: of the one that holds HU just below it. */
int cts_transfer_find(const CtsTransfer *transfer, double hu);
int cts_transfer_find_below(const CtsTransfer *transfer, double hu);

/* Extinction per mm for an opacity per unit distance, capped, scaled. */
double cts_transfer_extinction(const CtsTransfer *transfer, double opacity);

/* Intervals of a ray within a cell, by appearance. */

typedef struct CtsRayInterval {
    double from, to; /* of the segment, 0 to 1 */
    int appearance;
} CtsRayInterval;

/* The intervals of the last segment returned by a trilinear field; returns their number. */
enum { CTS_MAX_RAY_INTERVALS = 3 * CTS_MAX_CELL_LABELS * CTS_MAX_CELL_LABELS / 2 + 1 };
int cts_raycast_label_intervals(const CtsVoxelLabels *voxel_labels, const CtsRayWalk *walk, CtsRayInterval *interval);

/* Gauss-Legendre rules on 0..1 that also integrate up to each node, for the attenuation inside a segment. */

enum { CTS_GAUSS_COARSE = 4, CTS_GAUSS_FINE = 7 };

typedef struct CtsGauss {
    int n;
    double node[CTS_GAUSS_FINE], weight[CTS_GAUSS_FINE];
    /* upto[k][j]: weight of node j in the integral from 0 to node k, exact for polynomials of degree below n. */
    double upto[CTS_GAUSS_FINE][CTS_GAUSS_FINE];
} CtsGauss;

/* n is 1 to CTS_GAUSS_FINE. */
void cts_gauss_init(CtsGauss *rule, int n);

/* State of the reference ray caster: derived once per picture, then read-only for all rays. */

typedef struct CtsRaycaster {
    const CtsPreset *preset;
    CtsView view;
    const CtsField *field;
    CtsField *own_field;                /* NULL where the caller gave one */
    CtsTransfer transfer;               /* composite only */
    const CtsVoxelLabels *voxel_labels; /* NULL: one appearance for all */
    CtsTransfer *appearances;           /* of each appearance except hidden; composite only */
    CtsHuRanges wanted;                 /* the union of their visible HU */
    CtsGauss coarse, fine;
    const struct CtsBodyMask *body;     /* the voxels that minip and average use; NULL: all */
    const struct CtsOpenness *openness; /* NULL: 1 everywhere */
    double frame[3][3];     /* a gradient in HU/voxel to HU/mm to the right, up and along the viewing direction */
    double camera_mm;       /* from the camera plane to t = 0 of every ray */
    double least_gradient2; /* below this square (HU/voxel) a gradient is only rounding */
} CtsRaycaster;

/* Accumulated state of a ray. Depth is optical depth; transmittance is exp(-depth). */
typedef struct CtsRaySum {
    double rgb[3], depth, transmittance;
    double surface_mm; /* t where half of the light is absorbed, or else of the first visible point; +inf before */
} CtsRaySum;

/* Front to back along one segment of a ray; gradient is NULL when unlit. False when the transmittance is too low to
 * continue. */
bool cts_raycast_segment(const CtsRaycaster *caster, const CtsTransfer *transfer, const CtsRay *ray,
                         const CtsRaySegment *segment, const double (*gradient)[4], CtsRaySum *light);

/* HU of mip, minip or average for a ray inside the box; false where no part of it is visible. */
bool cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *hu);

/* Colour of a sample, shaded by its gradient in HU/voxel and dimmed by its openness, 0 to 1. */
void cts_raycast_shade(const CtsRaycaster *caster, const double gradient[3], double openness, double rgb[3]);

/* True when the normal varies so little on a..b of a segment that a quadrature rule cannot miss the highlight. framed:
 * the gradient's cubics in the caster's frame. */
bool cts_raycast_normal_is_steady(const CtsRaycaster *caster, const double (*framed)[4], double a, double b);

/* Premultiplied red, green, blue and alpha of the ray of position (x, y) in pixels; 0 where it misses the box. depth_mm
 * (may be NULL) is as in CtsPicture. */
void cts_raycast_ray(const CtsRaycaster *caster, double x, double y, double rgba[4], double *depth_mm);

/* field is borrowed; NULL makes the one of the scene's volume and kernel, which cts_raycaster_free() frees. */
CtsStatus cts_raycaster_new(CtsRaycaster **caster, const CtsScene *scene, const CtsField *field, CtsError *err);
void cts_raycaster_free(CtsRaycaster **caster);
