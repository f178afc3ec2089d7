/* Empty-space skipping: how far the nearest visible macro-cell is. Rays pass over what the transfer function makes
 * invisible. */
#ifndef CTS_TILED_EMPTY_SPACE_H
#define CTS_TILED_EMPTY_SPACE_H

#include "ctsplat/status.h"
#include "engine/tiled/layout.h"
#include "core/transfer/lut.h"
#include "core/volume/macrocells.h"
#include <stdint.h>

/* distance[(bk * nv + bv) * nu + bu], macro-cells in the layout's axes: 0 for a visible macro-cell, else the Chebyshev
 * distance to the nearest visible one, in macro-cells, at most 255. All macro-cells nearer than that are invisible, on
 * the whole range of what is interpolated inside them. */
typedef struct CtsEmptySpace {
    int nu, nv, nk;
    uint8_t *distance;
    uint8_t
        *fine; /* which of a macro-cell's 2 x 2 x 2 fine macro-cells may be visible: bit 4 k + 2 v + u of the halves */
    int64_t n_visible, n_macrocells;
} CtsEmptySpace;

CtsStatus cts_empty_space_init(CtsEmptySpace *empty, const CtsMacrocells *macrocells, const CtsLayout *layout,
                               const CtsLut *lut, int n_threads, CtsError *err);
void cts_empty_space_free(CtsEmptySpace *empty);

#endif
