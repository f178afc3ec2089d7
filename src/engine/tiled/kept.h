/* What the tiled engine derives from volume and preset alone, or from the view's axes: made for the first frame that
 * needs it and kept for those that follow. */
#ifndef CTS_TILED_KEPT_H
#define CTS_TILED_KEPT_H

#include "core/scene/engine.h"
#include "engine/tiled/draft_table.h"
#include "engine/tiled/empty_space.h"
#include "engine/tiled/layout.h"
#include "engine/tiled/slab.h"
#include "core/volume/macrocells.h"

/* Each with the frame that it was made for: only to a later one it is something that was there already. */
typedef struct TiledKept {
    CtsMacrocells *own_macrocells; /* where the volume has none */
    int macrocells_frame;
    CtsLayout copied; /* the last layout that needed a copy; one at a time, so memory stays bounded */
    int copied_reach; /* it holds the macro-cells up to this far from a visible one */
    int copied_frame;
    CtsSlabTable table;
    double table_scale; /* extinction_scale of table, 0 before it is made */
    int table_frame;
    CtsDraftTable draft; /* of table, once a draft has been asked for */
    float *lattice;      /* of drafts; 4 n_lattice floats */
    size_t n_lattice;
    CtsEmptySpace empty;
    int empty_axes[3];
    int empty_frame;
} TiledKept;

/* The scene's own, or one for this picture alone. Pair with cts_tiled_kept_close(). */
CtsStatus cts_tiled_kept_open(const CtsScene *scene, TiledKept **kept, CtsError *err);
void cts_tiled_kept_close(const CtsScene *scene, TiledKept *kept);
void cts_tiled_kept_free(void *kept);

/* Macro-cell ranges, which stay the keeper's. The report says what was there already, here and below. */
CtsStatus cts_tiled_kept_macrocells(TiledKept *kept, const CtsScene *scene, const CtsMacrocells **macrocells,
                                    CtsReport *report, CtsError *err);
/* kept->table and kept->empty for this view. */
CtsStatus cts_tiled_kept_tables(TiledKept *kept, const CtsScene *scene, const CtsMacrocells *macrocells,
                                const CtsLayout *layout, CtsReport *report, CtsError *err);
/* An empty lattice of n places, which stays the keeper's. */
CtsStatus cts_tiled_kept_lattice(TiledKept *kept, size_t n, float **rgba, CtsError *err);
/* Give the view's layout its voxels, those at least that lie up to `reach` macro-cells from a visible one; they stay
 * the keeper's. After cts_tiled_kept_tables(). */
CtsStatus cts_tiled_kept_layout(TiledKept *kept, const CtsScene *scene, int reach, CtsLayout *layout, CtsReport *report,
                                CtsError *err);

#endif
