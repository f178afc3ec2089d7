/* Closed planar contours of one structure, converted to the voxels whose centres lie inside. */
#pragma once

#include "core/labels/label_set.h"

typedef struct CtsContour {
    double at_mm; /* along the slices' normal */
    size_t first, n;
    bool is_xor;            /* of type CLOSEDPLANAR_XOR */
    double low[2], high[2]; /* its box, in pixels of the slice that is being filled */
    size_t group;           /* the first contour, in the order of places, that it is united with, or itself */
    bool inside;            /* while a row is walked: the place lies inside this contour, */
    int n_inside;           /* and inside so many of the group that it leads */
} CtsContour;

/* An edge's crossing with a row. */
typedef struct CtsCrossing {
    double x; /* pixels; first, as crossings are sorted by it */
    size_t contour;
} CtsCrossing;

typedef struct CtsOutline {
    const CtsLabelGrid *grid;
    double inverse[2][3]; /* pixel = inverse * (point - position) */
    CtsContour *contours;
    size_t n_contours;
    double (*points)[3]; /* LPS */
    double (*pixels)[2]; /* the same as pixels of the slice that is being filled */
    size_t n_points;
    double slant_mm;          /* the largest extent across the slices of contours that are not parallel to them; or 0 */
    size_t n_off, n_unfilled; /* planes far from any slice; slices without a plane between two with one */
    CtsCrossing *crossings;
    size_t n_crossings;
} CtsOutline;

void cts_outline_free(CtsOutline *outline);

/* Adds a contour, unless it is not parallel to the slices. */
CtsStatus cts_outline_add(CtsOutline *outline, const double (*lps)[3], size_t n, bool is_xor, CtsError *err);

/* The area that the contours enclose, each by itself, in mm^2. */
double cts_outline_area(const CtsOutline *outline);

/* Adds the voxels to the label, sorted. Each slice gets the nearest of its planes. In a plane, contours that overlap in
 * part are united, and one that is there twice counts once; of nested ones even-odd holds, and of CLOSEDPLANAR_XOR. The
 * outline is empty then. */
CtsStatus cts_outline_fill(CtsOutline *outline, CtsLabel *label, CtsError *err);
