/* The preset's transfer function cut at its knots, so that between two cuts opacity and colour are straight lines in HU
 * and the extinction is either one smooth formula or the cap. Made from cts_preset_opacity() and cts_preset_colour().
 */
#ifndef CTS_RAYCAST_TRANSFER_H
#define CTS_RAYCAST_TRANSFER_H

#include "ctsplat/preset.h"
#include "engine/raycast/field.h"

/* From low_hu up to, not including, high_hu; the first starts at -inf, the last ends at +inf. */
typedef struct CtsSpan {
    double low_hu, high_hu;
    double at_hu;                  /* where the lines below have their first value */
    double opacity, opacity_slope; /* per unit distance; slope per HU */
    double rgb[3], rgb_slope[3];
    bool visible;         /* opacity above 0 somewhere */
    bool flat_extinction; /* extinction_per_mm holds everywhere */
    bool flat_colour;
    double extinction_per_mm;
} CtsSpan;

typedef struct CtsTransfer {
    int n;
    CtsSpan spans[4 * CTS_MAX_POINTS];
    CtsHuRanges visible;
    double unit_distance_mm, scale; /* scale as CtsScene.extinction_scale */
} CtsTransfer;

void cts_transfer_init(CtsTransfer *transfer, const CtsPreset *preset, double extinction_scale);

/* Index of the span that holds hu; below: of the one that holds HU just below it. */
int cts_transfer_find(const CtsTransfer *transfer, double hu);
int cts_transfer_find_below(const CtsTransfer *transfer, double hu);

/* Extinction per mm for an opacity per unit distance, capped, scaled. */
double cts_transfer_extinction(const CtsTransfer *transfer, double opacity);

#endif
