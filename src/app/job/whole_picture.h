/* A picture assembled from its bands of rows. */
#pragma once

#include "ctsplat/picture.h"

/* Copies a band into *whole, which the first one makes (NULL before). Bounds of pixels are left out. */
CtsStatus cts_picture_add_band(CtsPicture **whole, const CtsPicture *band, CtsError *err);
