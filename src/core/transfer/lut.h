/* The transfer function by grey level: colour and extinction per mm, and visibility. */
#pragma once

#include "ctsplat/mixture.h"
#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_N_GREY = 65536 };

typedef struct CtsLut {
    int n;           /* number of distinct levels: from level n - 1 on, beyond the preset's last point, all are equal */
    float (*rgb)[3]; /* display values by grey level */
    float *extinction_per_mm; /* by grey level; times unit_scale where opacity is per voxel */
    /* Prefix sums over levels and intervals: entry 2 g + 1 less entry 2 g is 1 where level g has an extinction, entry 2
     * g + 2 less entry 2 g + 1 where some HU between levels g and g + 1 may have one. */
    uint32_t *visible_below;
    double max_extinction_per_mm;
} CtsLut;

/* extinction_scale multiplies every extinction: 1, or for --opacity-unit voxel the factor that makes the preset's unit
 * one voxel along the ray. Levels that are void by the key (NULL: none) are invisible. Free with cts_lut_free(). */
CtsStatus cts_lut_new(CtsLut **lut, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key,
                      double extinction_scale, CtsError *err);
void cts_lut_free(CtsLut **lut);

/* False when nothing from level low to level high has any extinction, between levels either: exact, however the voxels
 * are mixed. */
static inline bool cts_lut_visible(const CtsLut *lut, uint16_t low, uint16_t high)
{
    const int last = lut->n - 1;
    return lut->visible_below[2 * (high < last ? high : last) + 1] > lut->visible_below[2 * (low < last ? low : last)];
}

/* The levels that enclose all visible ones, if any: nothing is visible at low or below, unless low is 0, nor at high or
 * above, unless high is the last level. */
void cts_lut_visible_levels(const CtsLut *lut, int *low, int *high);
