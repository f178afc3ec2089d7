#include "engine/splat/paper_plan.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "core/model/transposed.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SWATHS_A_THREAD = 3 }; /* with fewer, threads would be idle */

/* Lattice points a voxel along one axis: about one a pixel, and a power of two. */
static int choose_density(double voxels_per_pixel)
{
    int density = 1;
    while (density < CTS_MAX_DENSITY && density * voxels_per_pixel * M_SQRT2 < 1)
        density *= 2;
    return density;
}

static CtsStatus plan_geometry(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    const CtsRenderSettings *settings = p->scene->settings;
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsStatus st;
    int density[2] = {1, 1};
    p->stack = cts_stack(p->scene->volume, p->scene->view.axis);
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    for (int c = 0; c < 2; c++)
        density[c] = choose_density(fmax(fabs(p->raster.by_x[c]), fabs(p->raster.by_y[c])));
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    if (p->picture) {
        p->raster.height = p->picture->height;
        p->raster.first_row = p->picture->first_row;
    }
    p->patches = cts_patches(&p->stack, density);
    p->patches.row_cells = p->raster.filled ? 1 : CTS_PATCH;
    p->samples = p->scene->plan.samples > 0 ? p->scene->plan.samples : 1;
    p->n_sheets = p->samples > 1 ? 2 : 1;
    p->n_threads = settings->n_threads;
    p->by_swaths =
        p->raster.filled && p->raster.by_layer[1] == 0 && p->patches.n_swaths >= SWATHS_A_THREAD * p->n_threads;
    p->simd = cts_simd_choice(cts_cpu_flags());
    if ((st = cts_footprint_init(&p->footprint, settings->kernel, settings->kernel_radius, density, err)))
        return st;
    const uint64_t n_taps = (uint64_t)(2 * p->footprint.reach[0] + 1) * (uint64_t)(2 * p->footprint.reach[1] + 1);
    cts_report_stage(report, CTS_STAGE_FOOTPRINT, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, n_taps, 0);
    return CTS_OK;
}

static CtsStatus plan_shading(CtsPaperPlan *p, CtsError *err)
{
    const CtsScene *scene = p->scene;
    const double length_mm = p->stack.n_layers > 1 ? scene->view.layer_mm / p->samples : 0;
    CtsStatus st;
    for (int i = 0; i < 2; i++)
        if ((st = cts_entries_init(&p->entries[i], scene->lut, i ? length_mm / 2 : length_mm, err)))
            return st;
    p->lit = scene->preset->shade;
    if (!p->lit)
        return CTS_OK;
    const int axes[3] = {p->stack.u_axis, p->stack.v_axis, p->stack.axis};
    if ((st = cts_shade_init(&p->shade, scene->preset, scene->volume, &scene->view, axes, err)) || !p->shade.air_beyond)
        return st;
    return cts_alloc_zeroed(&p->air, (size_t)p->stack.n[0], err);
}

static CtsStatus plan_void(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const CtsMacrocells *const macrocells = p->scene->model->macrocells;
    if (!p->skip_void)
        return CTS_OK;
    if ((st = cts_void_map_new(&p->map, &p->stack, &p->patches, &p->rule, macrocells, p->n_threads, err)))
        return st;
    int n_empty = 0;
    for (int k = 0; k < p->stack.n_layers; k++)
        n_empty += !p->map.active[k];
    cts_report_plan(report,
                    "void: macro-cells of %d^3 cells whose grey levels are invisible are left out, %.1f %% of all; %d "
                    "of %d layers are invisible",
                    CTS_PATCH, 100 * (1 - (double)p->map.n_shown / (double)p->map.n_patches), n_empty,
                    p->stack.n_layers);
    if (n_empty > 0)
        cts_report_skip(report, "layers", "%d of %d are invisible", n_empty, p->stack.n_layers);
    return CTS_OK;
}

/* Changes in row v between two layers, where the volume has them. */
static uint64_t count_changes(const CtsPaperPlan *p, int k, int old_k, int v)
{
    const uint16_t *const here = cts_stack_row(&p->stack, k, v), *const old = cts_stack_row(&p->stack, old_k, v);
    uint64_t n = 0;
    for (int u = 0; u < p->stack.n[0]; u++)
        n += abs(here[u] - old[u]) > p->tolerance;
    return n;
}

/* Share of the voxels that changed, by a few rows of a few layers and the one before that their sheet was made of. */
static double share_of_changes(const CtsPaperPlan *p)
{
    enum { SAMPLE_EVERY = 16, SAMPLE_AT = 5 };
    const int first = SAMPLE_AT < p->stack.n_layers ? SAMPLE_AT : p->n_sheets;
    uint64_t n_voxels = 0, n_changed = 0;
    for (int s = first; s < p->stack.n_layers; s += SAMPLE_EVERY)
        for (int v = SAMPLE_AT; v < p->stack.n[1]; v += SAMPLE_EVERY) {
            n_voxels += (uint64_t)p->stack.n[0];
            n_changed += count_changes(p, cts_paper_layer(p, s), cts_paper_layer(p, s - p->n_sheets), v);
        }
    return n_voxels > 0 ? (double)n_changed / (double)n_voxels : 0;
}

/* Decides by a sample of the layers if reusing them pays; the picture is the same with and without. Measured with all
 * kernels at a quarter of a voxel to one per pixel, 8 to 16 bits: by itself reuse takes 0.3 to 0.7 of the time where up
 * to 0.3 of the voxels change, and breaks even at 0.7, or at 0.36 where a footprint is a single row. With void
 * skipping, which drops the unchanged voxels anyway, it takes 1 to 1.15 of the time. */
static void plan_reuse(CtsPaperPlan *p, CtsReport *report)
{
    if (!p->reuse)
        return;
    const double changed = share_of_changes(p);
    const int vectors = (2 * p->footprint.reach[1] + 1) * ((2 * p->footprint.reach[0] + 8) / 8);
    /* A tolerance changes the picture, so it is not dropped where reuse does not pay. */
    p->reuse = p->tolerance > 0 || p->scene->settings->always_reuse_layers ||
               (!p->skip_void && changed < (vectors > 1 ? 0.5 : 0.3));
    if (p->reuse)
        cts_report_plan(report, "layer reuse: %.0f %% of voxels change between layers, so only changes are splatted",
                        100 * changed);
    else
        cts_report_skip(report, "layer reuse", "it would not pay: %s%.0f %% of voxels change between layers",
                        p->skip_void ? "void voxels are skipped, and " : "", 100 * changed);
}

static CtsStatus plan_savings(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    const CtsScene *scene = p->scene;
    CtsStatus st;
    if (p->reuse)
        p->tolerance = (int)fmin(floor(scene->settings->tolerance_hu / scene->volume->hu_step), 65535);
    else if (scene->settings->tolerance_hu > 0)
        cts_report_skip(report, "tolerance", "engine %s does not compare layers", p->skip_void ? "void" : "classic");
    p->rule = (CtsRangeRule){.lut = scene->lut,
                             .apron = p->footprint.apron,
                             .slack = (uint16_t)p->tolerance,
                             .sum_low = p->footprint.sum_low,
                             .sum_high = p->footprint.sum_high};
    p->least = cts_range_least(&p->rule);
    if ((st = plan_void(p, report, err)))
        return st;
    plan_reuse(p, report);
    return CTS_OK;
}

/* The place along v of picture row y, in a view whose picture rows run along the lattice's rows. */
static double v_at(const CtsRaster *r, int y)
{
    return r->origin[1] + r->by_y[1] * (double)(r->first_row + y);
}

/* True if picture row y may intersect the volume; false only where it certainly does not. */
static bool meets_volume(const CtsRaster *r, int y)
{
    return v_at(r, y) >= -1 && v_at(r, y) <= r->last[1] + 1;
}

/* Row limits of the swaths of a picture whose rows run along the lattice's: each row lies in one row of patches, except
 * for those that miss the volume, above and below. */
static CtsStatus plan_swath_rows(CtsPaperPlan *p, CtsError *err)
{
    const CtsStatus st = cts_alloc_array(&p->swath_row, (size_t)p->patches.n_swaths + 1, err);
    if (st)
        return st;
    const CtsRaster *r = &p->raster;
    const bool rising = r->by_y[1] > 0;
    const double lattice = CTS_SWATH * CTS_PATCH * p->patches.density[1];
    int y = 0, past = r->height;
    while (y < past && !meets_volume(r, y))
        y++;
    while (past > y && !meets_volume(r, past - 1))
        past--;
    for (int i = 0; i <= p->patches.n_swaths; i++) {
        /* The i-th swath in order of the picture's rows, and its end. */
        p->swath_row[i] = y;
        const int swath = rising ? i : p->patches.n_swaths - 1 - i;
        for (; y < past; y++) {
            const double at = v_at(r, y);
            if (rising ? i < p->patches.n_swaths - 1 && at >= (swath + 1) * lattice : swath > 0 && at < swath * lattice)
                break;
        }
    }
    return CTS_OK;
}

enum { LEFT_MARGIN = 16, MARGINS = 64 };

static CtsStatus sheet_init(CtsSheet *s, const CtsPatches *patches, CtsError *err)
{
    CtsStatus st;
    *s = (CtsSheet){.last = {0, 0}};
    for (int c = 0; c < 2; c++)
        s->last[c] = patches->last_voxel[c] * patches->density[c];
    s->stride = ((size_t)s->last[0] + 1 + MARGINS + 15) / 16 * 16;
    /* Rows a large power of two apart would fall on the same cache lines. */
    if (s->stride % 512 == 0)
        s->stride += 16;
    size_t n;
    if (cts_mul_overflows(s->stride, (size_t)s->last[1] + 2, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a layer's sheet is too large");
    if ((st = cts_alloc_zeroed(&s->memory, n, err)))
        return st;
    s->origin = s->memory + LEFT_MARGIN;
    if ((st = cts_alloc_array(&s->step, (size_t)patches->n_swaths, err)))
        return st;
    for (int i = 0; i < patches->n_swaths; i++)
        s->step[i] = -1;
    return CTS_OK;
}

CtsStatus cts_paper_store_init(CtsPaperStore *store, const CtsPaperPlan *p, CtsError *err)
{
    const size_t n_layer = (size_t)p->stack.n[0] * (size_t)p->stack.n[1];
    CtsStatus st;
    for (int i = 0; i < p->n_sheets; i++) {
        if ((st = sheet_init(&store->sheet[i], &p->patches, err)))
            return st;
        /* A row and a voxel more than the layer has, so that bilinear reads at its end stay inside. */
        const size_t n = (size_t)p->stack.n[0] * ((size_t)p->stack.n[1] + 1) + 1;
        if (p->lit && (st = cts_alloc_zeroed(&store->gradient[i], n, err)))
            return st;
    }
    if (p->tolerance == 0)
        return CTS_OK;
    st = cts_alloc_zeroed(&store->settled[0], 3 * n_layer, err);
    for (int i = 1; i < 3 && !st; i++)
        store->settled[i] = store->settled[i - 1] + n_layer;
    return st;
}

void cts_paper_store_free(CtsPaperStore *store)
{
    for (int i = 0; i < 2; i++) {
        cts_free(&store->gradient[i]);
        cts_free(&store->sheet[i].memory);
        cts_free(&store->sheet[i].step);
    }
    cts_free(&store->settled[0]);
}

static CtsStatus plan_memory(CtsPaperPlan *p, CtsError *err)
{
    CtsStatus st;
    if (p->by_swaths ? (st = plan_swath_rows(p, err)) : (st = cts_paper_store_init(&p->store, p, err)))
        return st;
    const size_t n_words = (size_t)p->patches.n_cell_words;
    for (int i = 0; i < p->n_sheets && p->reuse && !p->skip_void; i++)
        if ((st = cts_alloc_zeroed(&p->visible[i], (size_t)p->patches.n_swaths * CTS_SWATH_VOXELS * n_words, err)))
            return st;
    if (p->skip_void &&
        ((st = cts_culling_init(&p->culling, &p->raster, err)) ||
         (st = cts_alloc_zeroed(&p->open, (size_t)p->patches.n_swaths * (size_t)p->patches.n_words, err))))
        return st;
    return p->reuse || p->skip_void ? cts_alloc_array(&p->shown, (size_t)p->patches.n_cells[1] * n_words, err) : CTS_OK;
}

static void explain(const CtsPaperPlan *p, CtsReport *report)
{
    static const char axis_name[3] = {'x', 'y', 'z'};
    cts_report_plan(report,
                    "layers: %d across the volume's %c axis, %d x %d voxels each, %d plane%s of samples a layer",
                    p->stack.n_layers, axis_name[p->stack.axis], p->stack.n[0], p->stack.n[1], p->samples,
                    p->samples > 1 ? "s" : "");
    cts_report_plan(report, "sheet: %d x %d samples a voxel; footprint: %d x %d taps", p->footprint.density[0],
                    p->footprint.density[1], 2 * p->footprint.reach[0] + 1, 2 * p->footprint.reach[1] + 1);
    cts_report_plan(report, "order: %s", p->by_swaths ? "swaths of rows, each through all layers" : "layer by layer");
    cts_report_plan(report, "lighting: %s; threads: %d", p->scene->preset->shade ? "on" : "off", p->n_threads);
}

CtsStatus cts_paper_plan_init(CtsPaperPlan *p, const CtsScene *scene, bool reuse, bool skip_void, CtsPicture *picture,
                              CtsReport *report, CtsError *err)
{
    CtsStatus st;
    *p = (CtsPaperPlan){.scene = scene, .picture = picture, .skip_void = skip_void, .reuse = reuse};
    if ((st = plan_geometry(p, report, err)))
        return st;
    explain(p, report);
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if (p->stack.axis == 0 && (picture || reuse) &&
        (st = cts_model_transposed(scene->model, p->n_threads, &p->stack.grey, err)))
        return st;
    if ((st = plan_shading(p, err)) || (st = plan_savings(p, report, err)))
        return st;
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, 0, 0);
    return picture ? plan_memory(p, err) : CTS_OK;
}

void cts_paper_plan_free(CtsPaperPlan *p)
{
    for (int i = 0; i < 2; i++) {
        cts_free(&p->entries[i].entry);
        cts_free(&p->visible[i]);
    }
    cts_paper_store_free(&p->store);
    cts_free(&p->swath_row);
    cts_free(&p->culling.closed);
    cts_free(&p->open);
    cts_free(&p->shown);
    cts_free(&p->map.shows);
    cts_free(&p->map.active);
    cts_free(&p->air);
    cts_shade_free(&p->shade);
}

void cts_paper_add_open(const CtsPaperPlan *p, int step, int other_step, int patch_v, uint64_t *row)
{
    const int here = cts_paper_layer(p, step), last = p->stack.n_layers - 1;
    const bool between = p->samples > 1 && other_step >= 0 && other_step <= last;
    const uint64_t *open = p->open + (size_t)(patch_v / CTS_SWATH) * (size_t)p->patches.n_words;
    cts_void_add_row(&p->map, here, between ? cts_paper_layer(p, other_step) : here, patch_v, row);
    for (int w = 0; w < p->patches.n_words; w++)
        row[w] &= open[w];
}
