#include "tiled/march_plan.h"

#include "base/mutation.h"
#include "tiled/tile.h"
#include <math.h>

/* The most by which a preset's colour, and what 1 mm of it shows, change from one HU to the next; at the scale of
 * a few HU, since noise blurs what is finer. */
typedef struct Steepness {
    double colour, shown;
} Steepness;

static void shown_at(const CtsScene *scene, double hu, double rgb[3], double *opacity)
{
    cts_preset_colour(scene->preset, hu, rgb);
    *opacity = -expm1(-cts_preset_extinction_per_mm(scene->preset, hu) * scene->extinction_scale);
}

static Steepness find_steepness(const CtsScene *scene, const CtsSlabTable *table)
{
    enum { STEP_HU = 5 };
    const CtsVolume *v = scene->volume;
    const double first = v->hu_offset + v->hu_step * (double)table->grey_low - STEP_HU;
    const double last = first + v->hu_step * table->n / (double)table->per_grey + STEP_HU;
    Steepness most = {0, 0};
    for (double hu = first; hu < last; hu += 0.5 * STEP_HU) {
        double a[3], b[3], a_opacity, b_opacity;
        shown_at(scene, hu, a, &a_opacity);
        shown_at(scene, hu + STEP_HU, b, &b_opacity);
        most.shown = fmax(most.shown, fabs(b_opacity - a_opacity) / STEP_HU);
        for (int c = 0; c < 3; c++) {
            most.shown = fmax(most.shown, fabs(b_opacity * b[c] - a_opacity * a[c]) / STEP_HU);
            if (a_opacity > 0 && b_opacity > 0)
                most.colour = fmax(most.colour, fabs(b[c] - a[c]) / STEP_HU);
        }
    }
    return most;
}

/* Rows of rays a voxel apart see all that the field holds; finer ones say it twice. What filling adds to the error is
 * about a twentieth of the step that it trusts. */
static void choose_fill(TiledJob *j, const CtsScene *scene)
{
    double finest_mm = INFINITY, apart_mm = 2 * scene->view.mm_per_pixel;
    for (int axis = 0; axis < 3; axis++)
        finest_mm = fmin(finest_mm, cts_volume_spacing_mm(scene->volume, axis));
    j->fill_step = (float)(8 * 4 * (scene->plan.max_error > 0 ? scene->plan.max_error : 0.5) / 255);
    j->fill_levels = 0;
    for (; scene->plan.samples == 0 && apart_mm <= 1.1 * finest_mm && j->fill_levels < TILED_MOST_LEVELS; apart_mm *= 2)
        j->fill_levels++;
}

/* Measured on CT heads, all built-in presets, unlit: the default stays below 0.5/255 rms. Errors fall with the square
 * of the sheets, and with the limits as long as those find what bends. */
void cts_tiled_plan(TiledJob *j, const CtsScene *scene)
{
    const double asked = scene->plan.max_error > 0 ? scene->plan.max_error : 0.5, part = fmin(asked / 0.5, 8);
    const double grey_per_hu = 1 / scene->volume->hu_step;
    const Steepness steep = find_steepness(scene, &j->table);
    /* So much of the display's range may a bend show more or less of in 1 mm, and colours differ by within a slab. */
    const double oblique = fmax(hypot(j->u_at[3], j->v_at[3]) / 0.75, 1);
    const double bend_hu = part * fmin(0.24 / steep.shown, 140) / pow(oblique, 1.5);
    const double hiding_hu = part * fmin(0.04 / steep.colour, 300);
    const bool looks = scene->plan.samples == 0 && !j->straight;
    /* A steep preset seen far from an axis shows what a look half way does not tell. */
    j->sheets = scene->plan.samples > 0 ? scene->plan.samples : looks && oblique > 1.2 && bend_hu < 35 * part ? 2 : 1;
    j->most_due = (float)(0.004 * fmin(part, 2));
    /* More sheets leave less that bends within a look's reach, and make more cuts. */
    const double each = j->straight ? 0.03 : 0.12;
    while (scene->plan.samples == 0 && j->sheets < 16 && asked * j->sheets < each)
        j->sheets *= 2;
    j->samples = 4 * j->sheets;
    j->refine_grey = looks ? (float)(bend_hu * grey_per_hu) : INFINITY;
    j->bend_grey = 0.7f * j->refine_grey;
    j->halve_grey = 2 * j->refine_grey;
    const float near = looks ? (float)(fmin(30 / part, 400) * grey_per_hu) : 0;
    j->quiet_low = j->table.quiet_low - near;
    j->quiet_high = j->table.quiet_high + near;
    /* More sheets share what is allowed; where they are asked for, all errors are to fall with their square. */
    const double crowd = scene->plan.samples > 0 ? pow(j->sheets, 3) : j->sheets;
    j->hiding = (float)(crowd / (hiding_hu * grey_per_hu * (double)j->table.per_grey));
    j->faint_depth = 0.25f;
    j->stiff_depth = 3;
    j->full_depth = 5;
    j->stop_transmittance = CTS_MUTATED(STOP_EARLY) ? 0.25f : (float)fmin(part / 128, 1.0 / 64);
    choose_fill(j, scene);
}

void cts_tiled_plan_report(const TiledJob *j, const CtsScene *scene, const CtsLayout *layout, int reach,
                           const char *simd_path, CtsReport *report)
{
    static const char *const axes[3] = {"columns", "rows", "slices"};
    const CtsRenderSettings *s = scene->settings;
    const double active = 100.0 * (double)j->empty.n_visible / (double)j->empty.n_macrocells,
                 step = scene->volume->hu_step;
    cts_report_plan(report, "engine tiled: %d layers across the volume's %s, %s, %.4g mm of ray from layer to layer",
                    j->nk, axes[layout->axis_k], j->rising ? "rising" : "falling", scene->view.layer_mm);
    cts_report_plan(report, "macro-cells of %d^3 cells: %lld of %lld may be visible (%.1f %%)", CTS_MACROCELL,
                    (long long)j->empty.n_visible, (long long)j->empty.n_macrocells, active);
    cts_report_plan(report,
                    "slab integral: cumulative tables of %d entries, %g to a grey level; split into 2 to 16 parts "
                    "where depth^2 times change exceeds %.3g HU, past depth %g where the light is lost",
                    j->table.n, (double)j->table.per_grey, step / (double)(j->hiding * j->table.per_grey),
                    (double)j->stiff_depth);
    cts_report_plan(report, "sheets: %d a layer, %s", j->sheets,
                    scene->plan.samples > 0     ? "as asked"
                    : scene->plan.max_error > 0 ? "for the error asked for"
                    : j->shade                  ? "for an error below 0.5/255 but for lighting"
                                                : "for an error below 0.5/255");
    if (j->refine_grey < INFINITY)
        cts_report_plan(
            report,
            "sub-sheets: 1 between two where the field or its rise changes by more than %.3g HU or it comes "
            "within %.3g HU of what shows, 3 where it bends by more than %.3g HU",
            step * (double)j->refine_grey, step * (double)(j->table.quiet_low - j->quiet_low),
            step * (double)j->halve_grey);
    else
        cts_report_skip(report, "sub-sheets",
                        j->straight ? "the view runs along an axis: between layers the field is linear"
                                    : "as many sheets were asked for");
    if (j->fill_levels > 0)
        cts_report_plan(
            report,
            "rows: 1 of %d marched; those between filled where colours change and bend by less than %.3g/255 "
            "from row to row",
            1 << j->fill_levels, 255 * (double)j->fill_step);
    else
        cts_report_skip(report, "filling rows", "%s",
                        scene->plan.samples > 0 ? "sheets were asked for" : "pixels are no finer than half a voxel");
    cts_report_plan(report, "rays end below transmittance %.3g; lighting %s; SIMD path %s; %d threads",
                    (double)j->stop_transmittance, j->shade ? "on" : "off", simd_path, s->n_threads);
    cts_report_skip(report, "point samples", "two table entries integrate a whole slab");
    cts_report_skip(report, "warp", "sheets are sampled where the final pixels' rays cross them");
    cts_report_skip(report, "layer reuse", "a 2 x 2 stencil costs less than comparing layers");
    if (layout->grey)
        cts_report_skip(report, "transposed copy", "rows already lie along the %s", axes[layout->axis_u]);
    else
        cts_report_plan(report, "transposed copy: macro-cells up to %d from one that may be visible", reach);
    if (j->empty.n_visible == j->empty.n_macrocells)
        cts_report_skip(report, "void skipping", "every macro-cell may be visible");
    if (s->tolerance_hu > 0)
        cts_report_skip(report, "tolerance", "the engine compares no layers");
}
