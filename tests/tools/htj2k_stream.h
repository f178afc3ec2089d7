/* An HTJ2K stream of one grey picture, by OpenJPH; for tests. */
#pragma once

#include "jpeg2000_stream.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As jpeg2000_stream(); lossy ones with a quantisation step of a two-hundredth of the range. */
Jpeg2000Bytes htj2k_stream(const Jpeg2000 *p, bool lossy, const int32_t *samples);

#ifdef __cplusplus
}
#endif
