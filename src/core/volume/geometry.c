#include "ctsplat/volume.h"

#include "base/compare.h"
#include "base/vec3.h"
#include <math.h>

double cts_volume_spacing_mm(const CtsVolume *volume, int axis)
{
    return cts_norm3(volume->step_lps[axis]);
}

void cts_volume_centre_lps(const CtsVolume *volume, double centre_lps[3])
{
    for (int c = 0; c < 3; c++) {
        centre_lps[c] = volume->origin_lps[c];
        for (int axis = 0; axis < 3; axis++)
            centre_lps[c] +=
                (0.5 * (cts_volume_extent(volume, axis) - 1) - volume->air_before[axis]) * volume->step_lps[axis][c];
    }
}

double cts_volume_diagonal_mm(const CtsVolume *volume)
{
    /* A sheared box has four different diagonals; the longest makes any view fit. */
    double longest = 0;
    for (int signs = 0; signs < 4; signs++) {
        double d[3] = {0, 0, 0};
        for (int axis = 0; axis < 3; axis++) {
            const double sign = axis < 2 && (signs >> axis & 1) ? -1 : 1;
            for (int c = 0; c < 3; c++)
                d[c] += sign * (cts_volume_extent(volume, axis) - 1) * volume->step_lps[axis][c];
        }
        cts_raise_to(&longest, cts_norm3(d));
    }
    return longest;
}

int cts_volume_inverse(const CtsVolume *volume, double inverse[3][3])
{
    const double(*s)[3] = volume->step_lps;
    double cross[3];
    cts_cross3(s[1], s[2], cross);
    const double det = cts_dot3(s[0], cross);
    const double scale = cts_norm3(s[0]) * cts_norm3(s[1]) * cts_norm3(s[2]);
    if (!(fabs(det) > 1e-6 * scale)) /* flatter than the rounding of directions with six decimals */
        return 0;
    for (int axis = 0; axis < 3; axis++) {
        cts_cross3(s[(axis + 1) % 3], s[(axis + 2) % 3], inverse[axis]);
        for (int c = 0; c < 3; c++)
            inverse[axis][c] /= det;
    }
    return 1;
}

void cts_volume_box_lps(const CtsVolume *volume, double low_lps[3], double high_lps[3])
{
    for (int c = 0; c < 3; c++) {
        low_lps[c] = high_lps[c] = volume->origin_lps[c];
        for (int axis = 0; axis < 3; axis++) {
            const double step = volume->step_lps[axis][c];
            const double from = -volume->air_before[axis] * step,
                         to = (volume->dims[axis] - 1 + volume->air_behind[axis]) * step;
            low_lps[c] += fmin(from, to);
            high_lps[c] += fmax(from, to);
        }
    }
}
