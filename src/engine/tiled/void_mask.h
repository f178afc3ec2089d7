/* Empty-space skipping: potentially visible cells, and the distance to the nearest block that has one. */
#pragma once

#include "core/model/macrocells.h"
#include "core/scene/engine.h"
#include "engine/tiled/appearance_tables.h"

/* Cells are grouped in blocks of 4 x 4 x 4, the fine macro-cells. */
enum { TILED_BLOCK = 4 };
_Static_assert((int)TILED_BLOCK == (int)CTS_FINE_MACROCELL, "blocks have the fine macro-cells' ranges");

/* Two words per block, for its lower and its upper two layers of cells: if larger than TILED_FAR, bit 16 (k % 2) + 4 (j
 * % 4) + i % 4 says whether cell (i, j, k) is potentially visible; otherwise the word is the distance in blocks
 * (Chebyshev) to the nearest block with such a cell; 0: this one. A mask that would not be larger has its last bit set,
 * too: an invisible cell may be evaluated. */
enum { TILED_FAR = 255 };
typedef struct TiledMask {
    int n[3]; /* blocks along each axis */
    uint32_t *words;
    int64_t n_visible; /* potentially visible blocks */
    bool refined;      /* cells were tested; before, masks of visible blocks of one appearance have all bits set */
} TiledMask;

static inline size_t cts_tiled_word(const TiledMask *m, int i, int j, int k)
{
    const size_t row = (size_t)(k / TILED_BLOCK) * (size_t)m->n[1] + (size_t)(j / TILED_BLOCK);
    return 2 * (row * (size_t)m->n[0] + (size_t)(i / TILED_BLOCK)) + (size_t)(k / 2 % 2);
}

/* A mask by the blocks' ranges of grey levels. appearances: NULL: one appearance for all. */
CtsStatus cts_tiled_mask_init(TiledMask *mask, const CtsScene *scene, const TiledAppearances *appearances,
                              CtsError *err);
/* Tests the cells of visible blocks by their voxels. */
CtsStatus cts_tiled_mask_refine(TiledMask *mask, const CtsScene *scene, const TiledAppearances *appearances,
                                CtsError *err);
void cts_tiled_mask_free(TiledMask *mask);
