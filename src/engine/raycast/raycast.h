/* The float64 reference: single pixels of a scene, to validate pictures. */
#pragma once

#include "core/scene/engine.h"

/* rgba[i] becomes the exact value of the scene's picture at pixel xy[i]: premultiplied, before blending over a
 * background, not clamped. Each value is converged to 1e-7. Kernel, mode and lighting as in the scene. Any number of
 * threads gives the same bits. CTS_ERR_INTERRUPTED when a stop is requested. */
CtsStatus cts_raycast_pixels(const CtsScene *scene, const int (*xy)[2], size_t n, double (*rgba)[4], CtsError *err);
