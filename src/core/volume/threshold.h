/* Thresholding of voxels to bits. */
#pragma once

#include "base/bits.h"
#include "ctsplat/volume.h"
#include <math.h>
#include <stdbool.h>

/* Lower limit of dense voxels: below fat and skin, above foam, paper and most cloth. */
static const double CTS_DENSE_HU = -350;

/* True for voxels and dense extent of a micro-CT specimen, which is no patient and has no table. A specimen is smaller
 * than a head is long, 200 mm, and has voxels of 0.005 to 0.2 mm. Cone beams for teeth and ears of patients have such
 * voxels too, and show less than a head. */
static inline bool cts_is_specimen(const double spacing_mm[3], const double size_mm[3])
{
    static const double finest_mm = 0.005, coarsest_mm = 0.2, largest_mm = 200;
    for (int a = 0; a < 3; a++)
        if (!(spacing_mm[a] >= finest_mm && spacing_mm[a] <= coarsest_mm && size_mm[a] < largest_mm))
            return false;
    return true;
}

/* The first grey level of dense voxels: of a quantity other than HU, of those above air. */
static inline uint16_t cts_dense_grey(const CtsVolume *v)
{
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    const double grey = is_hu ? ceil((CTS_DENSE_HU - v->hu_offset) / v->hu_step)
                              : floor((v->air_limit - v->hu_offset) / v->hu_step + 0.5) + 1;
    return (uint16_t)fmin(fmax(grey, 1), UINT16_MAX);
}

/* The voxels whose level is at least grey_min; grey has the dimensions of bits. Returns how many runs their rows have.
 */
uint64_t cts_bits_threshold(CtsBits *bits, const uint16_t *grey, uint16_t grey_min, int n_threads);
/* The same of layers between slices, of which bits has the dimensions. */
CtsStatus cts_bits_threshold_layers(CtsBits *bits, const CtsLinearLayers *layers, uint16_t grey_min, int n_threads,
                                    uint64_t *n_runs, CtsError *err);
