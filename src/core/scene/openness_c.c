/* The kernels of openness in plain C. */
#include "core/scene/openness_tmpl.h"

const OpennessKernels cts_openness_kernels_c = {add_beams, scale};
