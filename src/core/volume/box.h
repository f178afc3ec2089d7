/* Voxels in memory, in any order of their axes. */
#pragma once

#include "ctsplat/volume.h"
#include <stddef.h>

/* Voxel (a, b, c) is the number at byte first + a * stride[0] + b * stride[1] + c * stride[2], and its centre lies at
 * origin_lps + a * step_lps[0] + b * step_lps[1] + c * step_lps[2] (mm). */
typedef struct CtsBox {
    int dims[3];
    ptrdiff_t first, stride[3];
    double origin_lps[3], step_lps[3][3];
} CtsBox;

enum { CTS_BOX_ANY = -1 }; /* no axis: see cts_box_as_scanned() */

/* The same voxels in the order in which a scanner would have stored them: columns, rows and slices along axes 0, 1, 2,
 * rows to the left or the back, columns to the back or the feet. slice_axis is the box's axis from slice to slice;
 * CTS_BOX_ANY: the one with the longest step. No voxel moves. */
CtsBox cts_box_as_scanned(const CtsBox *box, int slice_axis);
/* The volume's axes along the columns and rows of a section across the body, and last the one nearest to the axis from
 * feet to head. */
void cts_volume_section_axes(const CtsVolume *volume, int axis[3]);
