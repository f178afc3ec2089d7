/* Masks on a grid of their own -> runs of the scanned voxels, each of which takes the mask's voxel nearest to it, and
 * shares of those that the mask's own field fills in part. */
#ifndef CTS_LABELS_MASK_H
#define CTS_LABELS_MASK_H

#include "input/labels/label_reading.h"

enum { CTS_MASK_VALUES = 65536 };

/* A plane's pixels, valid until the next is read. */
typedef struct CtsMaskPlane {
    const uint16_t *values; /* 0 for no label */
    const uint16_t *shares; /* of CTS_WHOLE_SHARE: how much of each the label of value `sharer` fills; NULL: all */
    uint16_t sharer;
} CtsMaskPlane;

/* Planes that lie parallel, in any order. Pixel (i, j) of plane p has its centre at
 * position_lps[p] + i * step_lps[0] + j * step_lps[1]. */
typedef struct CtsMask {
    int columns, rows, n_planes;
    double step_lps[2][3];
    double (*position_lps)[3];
    double gap_mm; /* from plane to plane where none is left out; 0: not known */
    CtsStatus (*plane)(void *context, int number, CtsMaskPlane *plane, CtsError *err);
    void *context;
    const int32_t *label_of; /* CTS_MASK_VALUES: which of the labels, -1: none */
} CtsMask;

/* Directions dual to the pixel steps, within their plane: pixel = inverse * (point - position). False where the steps
 * span no plane. */
bool cts_mask_axes(const double step_lps[2][3], double inverse[2][3]);

/* *on_grid: whether its pixels are scanned voxels. Where they are not, no two planes may lie in one place. */
CtsStatus cts_mask_is_on_grid(const CtsMask *mask, const CtsLabelGrid *grid, bool *on_grid, CtsError *err);

/* Runs and shares are added to the labels, and sorted. What lies outside the volume is told; held_mm3 is added to: what
 * the mask's labels hold. */
CtsStatus cts_mask_place(const CtsMask *mask, const CtsLabelReading *reading, double *held_mm3, CtsError *err);

/* Refuses a file that holds something, in any unit, and has no voxel in the scan. */
CtsStatus cts_label_check_meets(const CtsLabelReading *reading, double held, CtsError *err);

/* Warns of a label of which so much, in any unit, lies outside. */
void cts_label_tell_share(const CtsLabelReading *reading, const CtsLabel *label, double inside, double whole);

#endif
