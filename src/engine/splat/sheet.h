/* A sheet: one layer reconstructed on its lattice in 32-bit integers, CTS_WEIGHT_ONE times the grey level. */
#pragma once

#include "engine/splat/patches.h"

typedef struct CtsSheet {
    uint32_t *memory;
    uint32_t *origin; /* lattice point (0, 0) */
    size_t stride;
    int last[2];
    int *step; /* by swath, in the order of rays: of the layer whose values it holds, or -1 */
} CtsSheet;

CtsStatus cts_sheet_init(CtsSheet *sheet, const CtsPatches *patches, CtsError *err);
void cts_sheet_free(CtsSheet *sheet);
