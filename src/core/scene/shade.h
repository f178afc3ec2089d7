/* Gradient lighting: colour * (ambient + diffuse * |n.v|) + specular * |n.v|^power, n the normalised gradient of HU in
 * mm, v the viewing direction.
 *
 * Gradients are differences of grey levels along the three voxel axes, in one scale: grey[i + step] - grey[i - step],
 * with one-sided differences doubled. The step is a voxel, along the slice axis the distance of two scanned slices,
 * since layers between them contain no measured detail. The volume's steps may be sheared and of different length: the
 * components of the gradient in mm along the picture's right, its up and the viewing direction are dot products with
 * the voxels per mm of each of these directions. */
#pragma once

#include "core/scene/view.h"
#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"

typedef struct CtsShade {
    float frame[3][3]; /* to the right, up and along the viewing direction; axes as the caller orders them */
    int step[3];       /* voxels along each axis between the ends of a difference and its centre */
    float ambient, diffuse, specular, exponent;
    float occlusion; /* by how much what lies hidden from light is dimmed, 0 to 1 */
    int n_power;     /* power has n_power + 1 entries over |n.v| = 0..1, joined by lines */
    float *power;
    int whole_power;   /* the power where it is a whole number that few multiplications make, else 0 */
    float least_power; /* lower limit of |n.v| for its power: avoids denormal numbers */
    bool air_beyond;   /* cts_shade_air_beyond() */
} CtsShade;

/* True for differences to air, grey level 0, at the volume's border; false for one-sided ones, for presets that show
 * air, whose border faces would be shaded like a body's surface. */
bool cts_shade_air_beyond(const CtsPreset *preset, const CtsVolume *volume);
/* Voxels along a volume axis from the centre of a difference to its ends. */
int cts_shade_step(const CtsVolume *volume, int axis);

/* axes[i] is the volume axis that the caller's i-th difference runs along. Free with cts_shade_free(). */
CtsStatus cts_shade_init(CtsShade *shade, const CtsPreset *preset, const CtsVolume *volume, const CtsView *view,
                         const int axes[3], CtsError *err);
void cts_shade_free(CtsShade *shade);
