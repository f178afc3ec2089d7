/* What every engine agrees on about a reconstruction kernel: its name and where it ends. Its weights are written down
 * twice on purpose, in engine/splat/footprint.c and engine/raycast/kernel_field.c, so that one can judge the other. */
#ifndef CTS_SCENE_KERNEL_H
#define CTS_SCENE_KERNEL_H

#include "ctsplat/render.h"

/* Where the kernel ends, in voxels from its centre; radius 0 asks for the kernel's own. */
double cts_kernel_radius(CtsKernelId kernel, double radius);

#endif
