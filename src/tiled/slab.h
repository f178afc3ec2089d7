/* Slab integration: the transfer function summed up over grey levels once, so that a slab in which the field runs
 * straight from one level to another has its exact optical depth and colour from two table entries
 * (pre-integration: Engel, Kraus, Ertl 2001; its tables as sums: Lum, Wilson, Ma 2004). */
#ifndef CTS_TILED_SLAB_H
#define CTS_TILED_SLAB_H

#include "ctsplat/status.h"
#include "scene/engine.h"
#include "volume/macrocells.h"
#include <stdint.h>

/* Entry i holds the integrals from the table's first level up to grey = grey_low + i / per_grey of
 * extinction * (red, green, blue, 1), in units of 1 / scale. Integers, so that differences are exact: neither small
 * depths behind large ones nor long plateaus lose digits. Entry n - 1 is the last; one more stands behind it. */
typedef struct CtsSlabTable {
    int32_t (*sum)[4];
    /* Floats, bit by bit: the integrals over one step alone, in the same units. Entry i is the step before entry i of
     * sum; entry 0 is nothing. A sum has lost what is far smaller than all that the table holds, and where the field
     * stands still nothing else evens that out. */
    int32_t (*step)[4];
    int n;
    float grey_low, per_grey;
    float halving_scale;    /* the same in halvings of the light: optical depth / ln 2 */
    float depth_scale;      /* difference of entries * depth_scale = sum of extinctions per mm, one for each entry */
    float colour_per_depth; /* what a colour's unit is worth in units of depth */
    /* Below quiet_low and from quiet_high on nothing is visible (quiet_high may be +inf). */
    float quiet_low, quiet_high;
} CtsSlabTable;

/* range: the grey levels that occur. */
CtsStatus cts_slab_table_init(CtsSlabTable *table, const CtsScene *scene, CtsRange range, CtsError *err);
void cts_slab_table_free(CtsSlabTable *table);

#endif
