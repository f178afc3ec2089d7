/* What is drawn along the scanner's axis: the same thin cross-section for a good way. */
#ifndef CTS_TABLE_EXTRUDED_H
#define CTS_TABLE_EXTRUDED_H

#include "core/table/morphology.h"
#include "core/table/sections.h"

/* Bits of the sections, in their dimensions: thin things that stand at the same place over 60 mm of the scanner's axis;
 * and those, thicker ones among them, that may be such. None where there are fewer slices than that. */
typedef struct CtsExtruded {
    CtsBits plates, doubtful;
} CtsExtruded;

/* workers[]: one for each thread. A zero-initialised CtsExtruded may be freed. */
CtsStatus cts_extruded_find(const CtsSectionPlan *plan, const CtsBits *sections, CtsMorphology *workers, int n_threads,
                            CtsExtruded *extruded, CtsError *err);
void cts_extruded_free(CtsExtruded *extruded);

#endif
