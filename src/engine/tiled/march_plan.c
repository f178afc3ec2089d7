#include "engine/tiled/march_plan.h"

#include "base/mutation.h"
#include "engine/tiled/tile.h"
#include <math.h>

void cts_tiled_plan(TiledJob *j, const CtsScene *scene)
{
    const double asked = cts_scene_error_asked(scene), aimed = cts_scene_bound_aimed(scene);
    j->plan = scene->plan;
    j->sheets = scene->plan.samples > 0 ? scene->plan.samples : 1;
    j->samples = 16 * j->sheets;
    /* Half an entry of the table, and what 14-bit weights leave of the largest difference between two voxels. */
    j->rounding = 0.5f / j->table.per_grey + (j->grey_most - j->grey_least) / 16384;
    j->hard_tint = 16 * j->table.steepest[1] > j->table.colour_range;
    j->may_mix = (float)aimed;
    j->may_change = scene->plan.samples > 0 || CTS_MUTATED(SUB_SHEETS)
                        ? INFINITY
                        : 4 * j->may_mix; /* sheets that were asked for are all there is */
    j->may_hide = fminf(16 * j->may_mix, 0.1f);
    j->may_shine = 0.25f * j->may_change;
    j->may_turn = 0.125f * j->may_mix;
    j->let_pass = CTS_MUTATED(LOOKS) ? INFINITY : j->may_mix / 8;
    j->tint = j->table.steepest[1] / j->table.per_grey;
    j->most_due = 0.5f * (float)asked;
    j->stiff_depth = 3;
    j->full_depth = 5;
    j->stop_transmittance = CTS_MUTATED(STOP_EARLY) ? 0.25f : (float)fmin(0.5 * asked, 1.0 / 64);
    j->range = j->table.colour_range * (j->shade ? fmaxf(j->shade->ambient + j->shade->diffuse, 1) : 1) +
               (j->shade ? j->shade->specular : 0);
    for (int c = 0; c < 3; c++)
        j->background[c] = scene->preset->background_none ? 0 : (float)scene->preset->background[c];
}

void cts_tiled_plan_report(const TiledJob *j, const CtsScene *scene, const CtsLayout *layout, int reach,
                           const char *simd_path, CtsReport *report)
{
    static const char *const axes[3] = {"columns", "rows", "slices"};
    const CtsRenderSettings *s = scene->settings;
    const double active = 100.0 * (double)j->empty.n_visible / (double)j->empty.n_macrocells;
    cts_report_plan(report, "engine tiled: %d layers across the volume's %s, %s, %.4g mm of ray from layer to layer",
                    j->nk, axes[layout->axis_k], j->rising ? "rising" : "falling", scene->view.layer_mm);
    cts_report_plan(report, "macro-cells of %d^3 cells: %lld of %lld may be visible (%.1f %%)", CTS_MACROCELL,
                    (long long)j->empty.n_visible, (long long)j->empty.n_macrocells, active);
    cts_report_plan(report,
                    "slab integral: cumulative tables of %d entries, %g to a grey level; cut where colours hide one "
                    "another, past depth %g where the light is lost",
                    j->table.n, (double)j->table.per_grey, (double)j->stiff_depth);
    cts_report_plan(report, "sheets: %d a layer%s", j->sheets, scene->plan.samples > 0 ? ", as asked" : "");
    if (j->straight) {
        cts_report_skip(report, "sub-sheets", "the view runs along an axis: between layers the field is linear");
    } else {
        cts_report_plan(report,
                        "sub-sheets: 1 between two, up to 15 where its bend may change a pixel by more than %.3g/255",
                        255 * (double)j->may_change);
        cts_report_plan(report, "what may be hidden between two sheets is looked for above %.3g/255",
                        255 * (double)j->may_hide);
    }
    cts_report_plan(report, "rays end below transmittance %.3g; lighting %s; SIMD path %s; %d threads",
                    (double)j->stop_transmittance, j->shade ? "on" : "off", simd_path, s->n_threads);
    if (j->draft.mean)
        cts_report_plan(report, "draft: slabs looked up whole, in a table of means between %d grey levels",
                        CTS_DRAFT_LEVELS);
    if (layout->grey)
        cts_report_skip(report, "transposed copy", "rows already lie along the %s", axes[layout->axis_u]);
    else
        cts_report_plan(report, "transposed copy: macro-cells up to %d from one that may be visible", reach);
    if (j->empty.n_visible == j->empty.n_macrocells)
        cts_report_skip(report, "void skipping", "every macro-cell may be visible");
    if (s->tolerance_hu > 0)
        cts_report_skip(report, "tolerance", "the engine compares no layers");
}
