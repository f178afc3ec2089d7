/* The transfer functions of a picture with labels: one for each appearance. */
#pragma once

#include "core/model/voxel_labels.h"
#include "core/scene/engine.h"
#include "engine/tiled/transfer_segments.h"

typedef struct TiledAppearances {
    const CtsVoxelLabels *voxel_labels;
    int n;
    TiledTransfer *transfer; /* of each appearance; hidden ones are invisible everywhere */
    CtsLut **own;            /* of appearances whose opacity differs from the picture's; else NULL */
} TiledAppearances;

/* For a volume with labels; free with cts_tiled_appearances_free(). */
CtsStatus cts_tiled_appearances_init(TiledAppearances *appearances, const CtsScene *scene, CtsError *err);
void cts_tiled_appearances_free(TiledAppearances *appearances);
/* The visibility table of an appearance, NULL if it is invisible. */
static inline const CtsLut *cts_tiled_appearance_lut(const TiledAppearances *appearances, const CtsLut *picture,
                                                     int appearance)
{
    return appearance == CTS_APPEARANCE_HIDDEN ? NULL
           : appearances->own[appearance]      ? appearances->own[appearance]
                                               : picture;
}
