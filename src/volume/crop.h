/* What a crop keeps, for steps before it that need not do more. */
#ifndef CTS_VOLUME_CROP_H
#define CTS_VOLUME_CROP_H

#include "ctsplat/volume.h"

/* Slices first <= k < end hold all that cts_volume_crop() will keep: all of them where the slices do not lie along the
 * patient's axes, or nothing would be kept. */
void cts_crop_slices(const CtsVolume *volume, const double lo_lps[3], const double hi_lps[3], int *first, int *end);

#endif
