/* A picture's pixels as the integers that PNG and DICOM files hold. */
#ifndef CTS_IMAGE_SAMPLES_H
#define CTS_IMAGE_SAMPLES_H

#include "ctsplat/picture.h"
#include <stdint.h>

/* Red, green and blue are equal in every pixel. Alpha is not looked at. */
bool cts_picture_is_grey(const CtsPicture *picture);

/* Row y as 16-bit samples, n_samples a pixel: 1 grey (the first channel), 3 red green blue as they stand, 4 straight
 * (not premultiplied) red green blue and alpha. Where alpha rounds to 0, so do the colours. */
void cts_samples_row16(const CtsPicture *picture, int y, int n_samples, uint16_t *row);

/* The same with 8 bits a sample. */
void cts_samples_row8(const CtsPicture *picture, int y, int n_samples, uint8_t *row);

#endif
