/* The same for processors that have it; plain C where the compiler lacks the flags. */
#define cts_openness_kernels_c cts_openness_kernels_avx2
#include "core/scene/openness_c.c"
