#include "core/volume/box.h"

#include "base/vec3.h"
#include <math.h>
#include <string.h>

static void flip(CtsBox *b, int axis)
{
    const int last = b->dims[axis] - 1;
    b->first += last * b->stride[axis];
    b->stride[axis] = -b->stride[axis];
    for (int c = 0; c < 3; c++) {
        b->origin_lps[c] += last * b->step_lps[axis][c];
        b->step_lps[axis][c] = -b->step_lps[axis][c];
    }
}

/* The cosine between a step and one of the patient's axes, 0 to 1. */
static double along(const CtsBox *b, int axis, int c)
{
    return fabs(b->step_lps[axis][c]) / cts_norm3(b->step_lps[axis]);
}

/* Slices lie across the axis with the longest step, as that is how they are scanned; of equal ones (a thousandth is
 * rounding) across the one nearest to the body's axis. */
static int longest_axis(const CtsBox *b)
{
    int best = 0;
    for (int a = 1; a < 3; a++) {
        const double one = cts_norm3(b->step_lps[a]), other = cts_norm3(b->step_lps[best]);
        if (fabs(one - other) > 1e-3 * other ? one > other : along(b, a, 2) > along(b, best, 2))
            best = a;
    }
    return best;
}

/* Rows run across the body's axis, rather to the left than to the back; columns run to the back, or to the feet; the
 * three axes are right-handed, as in axial, coronal and sagittal slices of PS3.3 C.7.6.2. lead: 0 in an axial slice, 1
 * or -1 in the others, so that 0.5 lies halfway. */
CtsBox cts_box_as_scanned(const CtsBox *box, int slice_axis)
{
    const int k = slice_axis == CTS_BOX_ANY ? longest_axis(box) : slice_axis;
    int order[3] = {(k + 1) % 3, (k + 2) % 3, k};
    const double lead = along(box, order[0], 2) - along(box, order[1], 2);
    if (lead > 0.5 || (lead > -0.5 && along(box, order[1], 0) > along(box, order[0], 0))) {
        const int swap = order[0];
        order[0] = order[1];
        order[1] = swap;
    }
    CtsBox b = *box;
    for (int a = 0; a < 3; a++) {
        b.dims[a] = box->dims[order[a]];
        b.stride[a] = box->stride[order[a]];
        memcpy(b.step_lps[a], box->step_lps[order[a]], sizeof b.step_lps[a]);
    }
    const int row = along(&b, 0, 0) >= along(&b, 0, 1) ? 0 : 1;
    const int column = along(&b, 1, 1) >= along(&b, 1, 2) ? 1 : 2;
    if (b.step_lps[0][row] < 0)
        flip(&b, 0);
    if (column == 1 ? b.step_lps[1][1] < 0 : b.step_lps[1][2] > 0)
        flip(&b, 1);
    double normal[3];
    cts_cross3(b.step_lps[0], b.step_lps[1], normal);
    if (cts_dot3(normal, b.step_lps[2]) < 0)
        flip(&b, 2);
    return b;
}

void cts_volume_section_axes(const CtsVolume *v, int axis[3])
{
    double most = -1;
    for (int a = 0; a < 3; a++) {
        const double along_z = fabs(v->step_lps[a][2]) / cts_volume_spacing_mm(v, a);
        if (along_z > most) {
            most = along_z;
            axis[2] = a;
        }
    }
    axis[0] = axis[2] == 0 ? 1 : 0;
    axis[1] = axis[2] == 2 ? 1 : 2;
}
