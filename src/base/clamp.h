/* Numbers held within limits, and 0..1 as pictures hold them. */
#pragma once

#include <math.h>

static inline double cts_clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* v clamped to 0..1; NaN gives 0. */
static inline double cts_clamp01(double v)
{
    return v > 0 ? v < 1 ? v : 1 : 0;
}

/* v clamped to 0..1 (NaN gives 0) as a float that rounds to the same of 65536 levels as v does: a float's own rounding
 * can cross the middle between two levels. */
static inline float cts_clamp_to_level(double v)
{
    const double clamped = cts_clamp01(v), level = floor(clamped * 65535 + 0.5);
    const float nearest = (float)clamped;
    const double found = floor((double)nearest * 65535 + 0.5);
    return found == level ? nearest : nextafterf(nearest, found < level ? 2.0f : -1.0f);
}
