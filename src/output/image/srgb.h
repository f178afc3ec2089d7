/* Display values (sRGB, IEC 61966-2-1) to and from linear light, and rounding to the integers that files hold. */
#ifndef CTS_IMAGE_SRGB_H
#define CTS_IMAGE_SRGB_H

#include <math.h>
#include <stdint.h>

/* The curves go on above 1; negative values and NaN give 0. */
double cts_srgb_to_linear(double display);
double cts_linear_to_srgb(double linear);

/* floor(v * largest + 0.5) after clamping to 0..1; NaN gives 0. */
static inline uint16_t cts_round16(double v)
{
    return v > 0 ? v < 1 ? (uint16_t)(v * 65535 + 0.5) : 65535 : 0;
}

static inline uint8_t cts_round8(double v)
{
    return v > 0 ? v < 1 ? (uint8_t)(v * 255 + 0.5) : 255 : 0;
}

#endif
