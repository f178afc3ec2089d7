/* What a ray may leave out: which cells may show something, and how far it is to the next block that holds one. */
#ifndef CTS_TILED_VOID_MASK_H
#define CTS_TILED_VOID_MASK_H

#include "core/scene/engine.h"
#include "core/volume/macrocells.h"
#include "engine/tiled/looks.h"

/* Cells stand in blocks of 4 x 4 x 4, the fine macro-cells. */
enum { TILED_BLOCK = 4 };
_Static_assert((int)TILED_BLOCK == (int)CTS_FINE_MACROCELL, "blocks have the fine macro-cells' ranges");

typedef struct TiledMask {
    int n[3];             /* blocks along each axis */
    uint32_t (*cells)[2]; /* of each block: bit 16 (k % 4) + 4 (j % 4) + i % 4, the lower 32 first */
    uint8_t *distance;    /* blocks to the next that shows something (Chebyshev); 0: this one does */
    int64_t n_visible;    /* blocks that do */
} TiledMask;

/* looks: NULL: all look alike. */
CtsStatus cts_tiled_mask_init(TiledMask *mask, const CtsScene *scene, const TiledLooks *looks,
                              const CtsMacrocells *macrocells, CtsError *err);
void cts_tiled_mask_free(TiledMask *mask);

#endif
