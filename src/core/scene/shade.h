/* Gradient lighting: colour * (ambient + diffuse * |n.v|) + specular * |n.v|^power, n the normalised gradient of HU in
 * mm, v the viewing direction. Shared by the splatting engines; float32, the same bits on every SIMD path.
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
#include <math.h>

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

/* |n.v| in 0..1; 0 without a gradient. */
static inline float cts_shade_facing(const CtsShade *s, float g0, float g1, float g2)
{
    float in_view[3];
    for (int i = 0; i < 3; i++)
        in_view[i] = s->frame[i][0] * g0 + s->frame[i][1] * g1 + s->frame[i][2] * g2;
    const float square = in_view[0] * in_view[0] + in_view[1] * in_view[1] + in_view[2] * in_view[2];
    if (!(square > 0))
        return 0;
    const float facing = fabsf(in_view[2]) / sqrtf(square);
    return facing < 1 ? facing : 1;
}

/* The factor of the colour, and the white that is added to it. */
static inline void cts_shade_factors(const CtsShade *s, float facing, float *colour, float *white)
{
    const float at = facing * (float)s->n_power;
    const int i = at < (float)s->n_power ? (int)at : s->n_power - 1;
    const float low = s->power[i];
    *colour = s->ambient + s->diffuse * facing;
    *white = facing > 0 ? s->specular * (low + (s->power[i + 1] - low) * (at - (float)i)) : 0;
}

/* The same where so much light arrives (core/scene/openness.h). */
static inline void cts_shade_dim(const CtsShade *s, float facing, float openness, float *colour, float *white)
{
    const float dark = s->occlusion * (1 - openness);
    *colour -= dark * (s->ambient + s->occlusion * s->diffuse * facing);
    *white -= dark * *white;
}
