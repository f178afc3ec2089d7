/* The transfer functions of a picture with labels: one for each appearance. */
#ifndef CTS_TILED_LOOKS_H
#define CTS_TILED_LOOKS_H

#include "core/scene/engine.h"
#include "core/volume/owners.h"
#include "engine/tiled/pieces.h"

typedef struct TiledLooks {
    const CtsOwners *owners;
    int n;
    TiledPieces *pieces; /* of each appearance; hidden ones are invisible everywhere */
    CtsLut **own;        /* of appearances whose opacity differs from the picture's; else NULL */
} TiledLooks;

/* For a volume with labels; free with cts_tiled_looks_free(). */
CtsStatus cts_tiled_looks_init(TiledLooks *looks, const CtsScene *scene, CtsError *err);
void cts_tiled_looks_free(TiledLooks *looks);
/* The visibility table of an appearance, NULL if it is invisible. */
static inline const CtsLut *cts_tiled_look_lut(const TiledLooks *looks, const CtsLut *picture, int look)
{
    return look == CTS_LOOK_HIDDEN ? NULL : looks->own[look] ? looks->own[look] : picture;
}

#endif
