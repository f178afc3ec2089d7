/* A picture assembled from parts: bands of rows, or tiles. */
#pragma once

#include "ctsplat/picture.h"

/* Copies a part to this place in a picture, with its depth where both have one: grey into colours too. Bounds of pixels
 * are left out. */
void cts_picture_place(CtsPicture *whole, const CtsPicture *part, int left, int top);

/* Copies a band into *whole, which the first one makes (NULL before). */
CtsStatus cts_picture_add_band(CtsPicture **whole, const CtsPicture *band, CtsError *err);
