/* Mask of the inside of the patient's body, for minip and average, which would otherwise show only the air around
 * it. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stdint.h>

/* Nodes along the volume's axes, some voxels apart, from one before the volume's first voxel or at it to one at its
 * last or behind it. Between them the mask is trilinear, so that it has a smooth edge, and the body is where it exceeds
 * CTS_BODY_THRESHOLD, which no node has. Cells of voxels never lie across a node. */
typedef struct CtsBodyMask {
    int n[3], step[3];  /* nodes, and voxels from node to node */
    int first[3];       /* the volume's origin, in voxels from the first node */
    double per_step[3]; /* 1 / step */
    uint8_t *share;     /* of each node: fraction of its surroundings that is body, in 1/255 */
} CtsBodyMask;

#define CTS_BODY_THRESHOLD 127.5

/* share[] unset. */
CtsStatus cts_body_mask_new(CtsBodyMask **mask, const int n[3], const int step[3], CtsError *err);
/* To be called when the volume's layers become n times as many. */
void cts_body_mask_refine(CtsBodyMask *mask, int n);
void cts_body_mask_free(CtsBodyMask **mask);

typedef enum CtsMaskCover { CTS_COVER_NONE, CTS_COVER_SOME, CTS_COVER_ALL } CtsMaskCover;
/* Tests if voxels low[] to high[] enclose body; CTS_COVER_SOME where a closer test is needed. */
CtsMaskCover cts_body_mask_cover(const CtsBodyMask *mask, const int low[3], const int high[3]);

/* The last node not behind a voxel. Halves keep rounding away from the nodes; multiplication is faster than
 * division. */
static inline int cts_body_mask_node(const CtsBodyMask *mask, int axis, int voxel)
{
    return (int)((voxel + mask->first[axis] + 0.5) * mask->per_step[axis]);
}

/* The mask at the eight nodes around a cell, bit a of a node's number being its position along axis a; and a position
 * within the cell (0..1) as one between the nodes (0..1). */
void cts_body_mask_corners(const CtsBodyMask *mask, const int cell[3], double corner[8]);
static inline double cts_body_mask_place(const CtsBodyMask *mask, int axis, int cell, double within)
{
    return (cell + mask->first[axis] + within) * mask->per_step[axis] - cts_body_mask_node(mask, axis, cell);
}

/* The mask at a place within the volume, in voxels. */
double cts_body_mask_at(const CtsBodyMask *mask, const double at[3]);
