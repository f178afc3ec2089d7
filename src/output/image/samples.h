/* A picture's pixels as the integers of files, and display values (sRGB, IEC 61966-2-1) to and from linear light. */
#pragma once

#include "ctsplat/picture.h"
#include <math.h>
#include <stdint.h>

/* True if red, green and blue are equal in every pixel, whatever alpha. */
bool cts_picture_is_grey(const CtsPicture *picture);

/* Row y as 16-bit samples, n_samples per pixel: 1 grey (the first channel), 3 red green blue unchanged, 4 straight (not
 * premultiplied) red green blue and alpha. Where alpha rounds to 0, so do the colours. */
void cts_samples_row16(const CtsPicture *picture, int y, int n_samples, uint16_t *row);

/* The same with 8 bits a sample. */
void cts_samples_row8(const CtsPicture *picture, int y, int n_samples, uint8_t *row);

/* The curves continue above 1; negative values and NaN give 0. */
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
