/* Names and radii of reconstruction kernels, common to all engines. The weights are implemented twice on purpose, in
 * engine/splat/footprint.c and engine/raycast/kernel_field.c, so that one validates the other. */
#pragma once

#include "ctsplat/render.h"

/* Radius of the kernel's support in voxels; radius 0 selects the kernel's default. */
double cts_kernel_radius(CtsKernelId kernel, double radius);
