/* Isolated voxels outside a scanner's range, as a damaged byte, a cast or a division by 0 leaves them. */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stddef.h>

/* Limits of any scanner's scale: 16 bits signed below, unsigned above. */
static inline bool cts_is_outlier(double hu)
{
    return hu < -32768 || hu > 65535;
}

/* Free with cts_outliers_free(). */
typedef struct CtsOutliers {
    size_t *voxels; /* indices of the n, in rising order: (k * dims[1] + j) * dims[0] + i */
    size_t n, most; /* more than most are counted, and not listed */
    size_t n_low, n_high;
    double low, high;           /* of all values */
    double rest_low, rest_high; /* of all other voxels; rest_low > rest_high: there are none */
    bool rest_whole;            /* and each of them is a whole number */
} CtsOutliers;

void cts_outliers_begin(CtsOutliers *outliers, const int dims[3]);
/* Adds one finite value of voxel number `voxel`. */
CtsStatus cts_outliers_take(CtsOutliers *outliers, size_t voxel, double hu, CtsError *err);
/* CTS_OK, with a warning in the report, where they are isolated: at most 1 of 10,000 voxels, in 26-connected parts of
 * at most 8; else CTS_ERR_PIXELS. */
CtsStatus cts_outliers_check(const CtsOutliers *outliers, const int dims[3], CtsReport *report, CtsError *err);
/* Sets them, where they are not air, to the largest value of all other voxels. grey: of voxel 0; v: its scale. */
void cts_outliers_mend(const CtsOutliers *outliers, const CtsVolume *v, uint16_t *grey);
void cts_outliers_free(CtsOutliers *outliers);
