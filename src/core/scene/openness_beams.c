/* The kernels of openness, on each SIMD path. */
#include "base/simd_path.h"
#include "core/scene/openness_tmpl.h"

const OpennessKernels CTS_ON_PATH(cts_openness_kernels) = {add_beams, scale};
