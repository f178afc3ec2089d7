/* The transfer function by grey level: colour and extinction per mm for all 65536 levels, and what is visible. */
#ifndef CTS_TRANSFER_LUT_H
#define CTS_TRANSFER_LUT_H

#include "ctsplat/mixture.h"
#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_N_GREY = 65536 };

typedef struct CtsLut {
    float (*rgb)[3];          /* display values by grey level */
    float *extinction_per_mm; /* by grey level; times unit_scale where opacity is per voxel */
    uint32_t *visible_below;  /* CTS_N_GREY + 1 prefix sums: number of levels below g with extinction > 0 */
    double max_extinction_per_mm;
    bool any_visible;
} CtsLut;

/* extinction_scale multiplies every extinction: 1, or for --opacity-unit voxel the factor that makes the preset's
 * unit one voxel along the ray. Free with cts_lut_free(). */
CtsStatus cts_lut_new(CtsLut **lut, const CtsPreset *preset, const CtsVolume *volume, double extinction_scale,
                      int n_threads, CtsError *err);
/* Takes the levels that the key drops for invisible. */
void cts_lut_hide(CtsLut *lut, const CtsVoidKey *key, const CtsVolume *volume);
void cts_lut_free(CtsLut **lut);

/* False when no grey level of low..high has any extinction: exact, however the levels in between are mixed. */
static inline bool cts_lut_visible(const CtsLut *lut, uint16_t low, uint16_t high)
{
    return lut->visible_below[(uint32_t)high + 1] > lut->visible_below[low];
}

#endif
