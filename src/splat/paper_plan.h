/* What the paper's engines derive once per picture. */
#ifndef CTS_SPLAT_PAPER_PLAN_H
#define CTS_SPLAT_PAPER_PLAN_H

#include "splat/composite.h"
#include "splat/layers.h"
#include "splat/paper.h"
#include "splat/sheet.h"
#include "splat/void.h"

/* Threads only read it, but for sheets, gradients, runs and settled rows, whose parts they own in turn. Layers are
 * counted in the order in which rays cross them ("step"), not as in the volume. */
typedef struct CtsPaperPlan {
    const CtsScene *scene;
    CtsPicture *picture;
    CtsKernels kernels;
    CtsFootprint footprint;
    CtsStack stack;
    CtsTiles tiles;
    CtsRaster raster;
    int samples;  /* planes of samples a layer */
    int n_sheets; /* 1, or 2 where planes lie between layers: sheet s % n_sheets is step s's */
    int n_threads;

    CtsEntries entries[2]; /* for a plane's length of ray, and for half of it: the first and the last plane */
    float (*table[2])[4];
    bool lit;
    CtsShade shade;

    bool skip_void, reuse; /* the paper's two savings */
    CtsRangeRule rule;
    CtsVoidMap map;     /* with skip_void */
    CtsHidden hidden;   /* with skip_void */
    CtsQuiet *quiet[2]; /* reuse without skip_void: tiles of each sheet */
    CtsRuns runs;       /* with either: what to composite */

    uint16_t base;        /* the grey level that sheets start from */
    int tolerance;        /* dead band, in grey levels */
    uint16_t *settled[3]; /* rows as they are splatted, where they differ from the volume's; step s in s % 3 */

    CtsSheet sheet[2];
    float (*gradient[2])[4]; /* at the voxels of the sheets' layers */
    size_t gradient_stride;
    bool stopped;
} CtsPaperPlan;

/* Derive everything but memory for pixels; with picture NULL no more than what --explain tells. */
CtsStatus cts_paper_plan_init(CtsPaperPlan *plan, const CtsScene *scene, CtsPaperFeatures features, CtsPicture *picture,
                              CtsReport *report, CtsError *err);
void cts_paper_plan_free(CtsPaperPlan *plan);

/* The volume's layer of a step. */
static inline int cts_paper_layer(const CtsPaperPlan *p, int step)
{
    return p->scene->view.axis_sign > 0 ? step : p->stack.n_layers - 1 - step;
}

/* Rows of a step as they are splatted: a CtsRowOf with a CtsPaperRows as context. */
typedef struct CtsPaperRows {
    const CtsPaperPlan *plan;
    int step;
} CtsPaperRows;

static inline const uint16_t *cts_paper_row(const void *context, int v)
{
    const CtsPaperRows *rows = context;
    const CtsPaperPlan *p = rows->plan;
    if (p->settled[0])
        return p->settled[rows->step % 3] + (size_t)v * (size_t)p->stack.n[0];
    return cts_stack_row(&p->stack, cts_paper_layer(p, rows->step), v);
}

/* Which of a row of tiles the sheet of a step must hold, and which the planes that the step completes look at. */
void cts_paper_needed(const CtsPaperPlan *plan, int step, int tile_v, uint8_t *needed);
void cts_paper_shown(const CtsPaperPlan *plan, int step, int tile_v, uint8_t *shown);

/* False: no sheet of this step is needed at all. */
static inline bool cts_paper_step_needed(const CtsPaperPlan *p, int step)
{
    return !p->skip_void || p->map.box[cts_paper_layer(p, step)][2] > 0;
}

#endif
