/* Steps of loading a series. */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "dicom/header/slice.h"
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Voxels of a NIfTI file -> 16-bit pixels in memory, which are read like those of any slice. */

/* Reads all voxels of the file of these n slices, by the rules' form and quantity, and sets each slice's pixel offset
 * and scale. HU: exact where the values are whole and span at most 65534, else in steps of 1/65534 of their span;
 * others: as volumes have them (core/volume/grey.h). Non-finite values become padding. Values that are no HU are
 * refused unless the rules name the quantity. stop: as in CtsWordWatch. *words is the caller's, also after a failure;
 * free with cts_free(). */
CtsStatus cts_nifti_words(CtsSlice *slices, int n, const CtsSeriesRules *rules, const volatile sig_atomic_t *stop,
                          uint16_t **words, CtsReport *report, CtsError *err);

/* Plausibility checks of a series' values, slice order and lengths, by samples of all slices. */

/* samples: CTS_SAMPLES of each of n slices in order of position. is_hu: else only their order is checked. Adds the
 * findings slice_off_neighbours, hu_implausible, order_conflict and spacing_implausible; a correct series gets none. */
CtsStatus cts_slice_consistency_report(const CtsSlice *slices, int n, const uint16_t *samples, bool is_hu,
                                       CtsReport *report, CtsError *err);

/* Warns of HU above the largest grey level. */
void cts_report_clamped(const CtsVolume *volume, CtsReport *report);

/* Voxels of a layer. */
static inline size_t cts_scanned_layer_voxels(const CtsScanned *s)
{
    return (size_t)s->even->dims[0] * (size_t)s->even->dims[1];
}

/* Isolated voxels outside a scanner's range, as a damaged byte, a cast or a division by 0 leaves them. */

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
/* Sets them, where they are not air, to the largest value of all other voxels. */
void cts_outliers_mend(const CtsOutliers *outliers, CtsVolume *volume);
void cts_outliers_free(CtsOutliers *outliers);
