/* Slab integration: the transfer function summed up over grey levels once, so that a slab in which the field runs
 * straight from one level to another has its exact optical depth and colour from two table entries
 * (pre-integration: Engel, Kraus, Ertl 2001; its tables as sums: Lum, Wilson, Ma 2004). */
#ifndef CTS_TILED_SLAB_H
#define CTS_TILED_SLAB_H

#include "ctsplat/status.h"
#include "core/scene/engine.h"
#include "core/volume/macrocells.h"
#include <stdint.h>

/* Entry i stands for grey level grey_low + i / per_grey. Entry n - 1 is the last; one more stands behind it. */
typedef struct CtsSlabTable {
    /* Integrals from the table's first level on of extinction per mm * (red, green, blue, 1), over entries. Doubles, so
     * that a difference keeps the haze beside metal. */
    double (*sum)[4];
    /* The integrand at the entry, for where the field stands still. */
    float (*here)[4];
    /* By how much extinction per mm, and colour where there is any (the channel that changes most), go up and down from
     * the table's first level to here: their total variations. */
    float (*change)[2];
    int n;
    float grey_low, per_grey;
    float steepest[2];  /* the most of `change` in one step, for a whole grey level */
    float colour_range; /* the most by which two visible colours differ in a channel, black among them */
    float first_rgb[3]; /* the colour that shows first */
    /* Below quiet_low and from quiet_high on nothing is visible (quiet_high may be +inf). */
    float quiet_low, quiet_high;
} CtsSlabTable;

/* range: the grey levels that occur. */
CtsStatus cts_slab_table_init(CtsSlabTable *table, const CtsScene *scene, CtsRange range, CtsError *err);
void cts_slab_table_free(CtsSlabTable *table);

#endif
