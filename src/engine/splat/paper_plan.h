/* State of the paper's engines, derived once per picture. */
#pragma once

#include "engine/splat/composite.h"
#include "engine/splat/void.h"

enum { CTS_SWATH_VOXELS = CTS_SWATH_CELLS + 1 + 2 * CTS_PATCH }; /* rows of voxels that reach into a swath, at most */

/* A sheet: one layer reconstructed on its lattice in 32-bit integers, CTS_WEIGHT_ONE times the grey level. */
typedef struct CtsSheet {
    uint32_t *memory;
    uint32_t *origin; /* lattice point (0, 0) */
    size_t stride;
    int last[2];
    int *step; /* by swath, in the order of rays: of the layer whose values it holds, or -1 */
} CtsSheet;

/* The sheets of the layers that can be sampled at the moment: one store for all threads, or one for each. */
typedef struct CtsPaperStore {
    CtsSheet sheet[2];
    float (*gradient[2])[4]; /* at the voxels of the sheets' layers */
    uint16_t *settled[3];    /* rows as they are splatted, where they differ from the volume's; step s in s % 3 */
} CtsPaperStore;

/* Threads only read it, except for the store, runs, and bits by swath, whose parts they own exclusively. Layers are
 * counted in the order in which rays cross them ("step"), not as in the volume.
 *
 * If all layers of a swath of patches project to the same rows of the picture, one thread processes the swath through
 * all layers, with a store of its own; else all threads work on one layer at a time. */
typedef struct CtsPaperPlan {
    const CtsScene *scene;
    CtsPicture *picture;
    const CtsSimd *simd;
    CtsFootprint footprint;
    CtsStack stack;
    CtsPatches patches;
    CtsRaster raster;
    int samples;  /* planes of samples a layer */
    int n_sheets; /* 1, or 2 where planes lie between layers: sheet s % n_sheets is step s's */
    int n_threads;

    CtsEntries entries[2]; /* for a plane's length of ray, and for half of it: the first and the last plane */
    bool lit;
    CtsShade shade;

    bool skip_void, reuse; /* the paper's two savings */
    CtsRangeRule rule;
    CtsVoidMap map;     /* with skip_void */
    CtsCulling culling; /* with skip_void */
    uint64_t *open;     /* with skip_void: by swath, patches that open pixels sample within some steps */
    uint16_t least;     /* mixtures of smaller levels are invisible */
    /* reuse without skip_void: of each sheet, by swath and row of voxels that reach in, the voxels of that grey level
     * and above; not evaluated again for unchanged voxels */
    uint64_t *visible[2];
    uint64_t *shown; /* with either: by row of cells, the cells to composite */

    int tolerance; /* dead band, in grey levels */

    bool by_swaths;
    int *swath_row;      /* by_swaths: the first picture row of each swath, from the top down, and the end */
    CtsPaperStore store; /* unless by_swaths */
    uint16_t *air;       /* a row of air, if lighting uses it beyond the border; else NULL */
} CtsPaperPlan;

/* Derives all but memory for pixels; with picture NULL only the data for --explain. */
CtsStatus cts_paper_plan_init(CtsPaperPlan *plan, const CtsScene *scene, bool reuse, bool skip_void,
                              CtsPicture *picture, CtsReport *report, CtsError *err);
void cts_paper_plan_free(CtsPaperPlan *plan);

/* The volume's layer of a step. */
static inline int cts_paper_layer(const CtsPaperPlan *p, int step)
{
    return p->scene->view.axis_sign > 0 ? step : p->stack.n_layers - 1 - step;
}

/* Allocate a store; one that is all zeros may be freed. */
CtsStatus cts_paper_store_init(CtsPaperStore *store, const CtsPaperPlan *plan, CtsError *err);
void cts_paper_store_free(CtsPaperStore *store);

/* The picture rows that a swath of patches covers, as far as known: y0..y1-1. */
static inline void cts_paper_picture_rows(const CtsPaperPlan *p, int swath, int *y0, int *y1)
{
    const int i = p->raster.by_y[1] > 0 ? swath : p->patches.n_swaths - 1 - swath;
    *y0 = p->by_swaths ? p->swath_row[i] : 0;
    *y1 = p->by_swaths ? p->swath_row[i + 1] : p->raster.height;
}

/* Row v of a step as it is splatted. */
static inline const uint16_t *cts_paper_row(const CtsPaperPlan *p, const CtsPaperStore *store, int step, int v)
{
    if (store->settled[0])
        return store->settled[step % 3] + (size_t)v * (size_t)p->stack.n[0];
    return cts_stack_row(&p->stack, cts_paper_layer(p, step), v);
}

/* With skip_void: adds the patches of a row that open pixels sample on a step's plane by macro-cells, and where there
 * are planes between, on those up to another's. */
void cts_paper_add_open(const CtsPaperPlan *plan, int step, int other_step, int patch_v, uint64_t *row);

/* With skip_void: open pixels' patches are determined every so many steps, one swath at a time. */
enum { CTS_PAPER_OPEN_STEPS = 8 };

/* False: no sheet of this step is needed at all. */
static inline bool cts_paper_step_needed(const CtsPaperPlan *p, int step)
{
    return !p->skip_void || p->map.active[cts_paper_layer(p, step)];
}
