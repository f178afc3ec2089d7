#include "splat/paper_plan.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include <math.h>
#include <string.h>

/* About one lattice point a pixel, and a power of two. */
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
    if ((st = cts_stack_init(&p->stack, p->scene->volume, p->scene->view.axis, err)))
        return st;
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    for (int c = 0; c < 2; c++)
        density[c] = choose_density(fmax(fabs(p->raster.by_x[c]), fabs(p->raster.by_y[c])));
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    if (p->picture) {
        p->raster.height = p->picture->height;
        p->raster.first_row = p->picture->first_row;
    }
    p->tiles = cts_tiles(&p->stack, density);
    p->samples = settings->samples > 0 ? settings->samples : 1;
    p->n_sheets = p->samples > 1 ? 2 : 1;
    p->n_threads = settings->n_threads;
    cts_kernels_init(&p->kernels, cts_cpu_flags() & settings->cpu_mask);
    if ((st = cts_footprint_init(&p->footprint, settings->kernel, settings->kernel_radius, density, err)))
        return st;
    const uint64_t n_taps = (uint64_t)(2 * p->footprint.reach[0] + 1) * (uint64_t)(2 * p->footprint.reach[1] + 1);
    cts_report_stage(report, CTS_STAGE_FOOTPRINT, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, n_taps, 0);
    return CTS_OK;
}

static CtsStatus plan_look(CtsPaperPlan *p, CtsError *err)
{
    const CtsScene *scene = p->scene;
    const double length_mm = p->stack.n_layers > 1 ? scene->view.layer_mm / p->samples : 0;
    CtsStatus st;
    for (int i = 0; i < 2; i++) {
        if ((st = cts_alloc_array(&p->table[i], CTS_N_GREY, err)))
            return st;
        cts_entries_init(&p->entries[i], p->table[i], scene->lut, i ? length_mm / 2 : length_mm);
    }
    p->lit = scene->preset->shade;
    p->gradient_stride = (size_t)p->stack.n[0];
    if (!p->lit)
        return CTS_OK;
    const int axes[3] = {p->stack.u_axis, p->stack.v_axis, p->stack.axis};
    return cts_shade_init(&p->shade, scene->preset, scene->volume, &scene->view, axes, err);
}

static CtsStatus plan_void(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    if (!p->skip_void) {
        cts_report_skip(report, "void skipping", "engine %s splats every voxel", p->reuse ? "layers" : "classic");
        return CTS_OK;
    }
    if ((st =
             cts_void_map_new(&p->map, &p->stack, &p->tiles, &p->rule, &p->kernels, p->samples > 1, p->n_threads, err)))
        return st;
    int n_empty = 0;
    for (int k = 0; k < p->stack.n_layers; k++)
        n_empty += p->map.box[k][2] == 0;
    cts_report_plan(report,
                    "void: tiles of %d x %d voxels whose grey levels show nothing are left out; %d of %d layers "
                    "show nothing at all",
                    CTS_TILE, CTS_TILE, n_empty, p->stack.n_layers);
    if (n_empty > 0)
        cts_report_skip(report, "layers", "%d of %d show nothing", n_empty, p->stack.n_layers);
    return CTS_OK;
}

/* A sample of the layers decides; the picture is the same either way, but for a tolerance that has no use then. */
static void plan_reuse(CtsPaperPlan *p, CtsReport *report)
{
    if (!p->reuse) {
        cts_report_skip(report, "layer reuse", "engine %s splats each layer anew", p->skip_void ? "void" : "classic");
        return;
    }
    const CtsChangeSample sample = cts_layers_sample(&p->stack, &p->tiles, p->skip_void ? &p->map : NULL, p->rule.level,
                                                     p->tolerance, p->n_sheets, p->scene->view.axis_sign);
    const double percent = sample.voxels > 0 ? 100.0 * (double)sample.changed / (double)sample.voxels : 0;
    p->reuse = cts_layers_pay(sample, &p->footprint);
    if (p->reuse)
        cts_report_plan(report, "layer reuse: %.0f %% of voxels change between layers, so only changes are splatted",
                        percent);
    else if (sample.voxels == 0)
        cts_report_skip(report, "layer reuse", "no layer has a visible one before it");
    else
        cts_report_skip(report, "layer reuse", "it would not pay: %.0f %% of voxels change between layers", percent);
    if (!p->reuse)
        p->tolerance = 0;
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
                             .outside = p->base,
                             .slack = (uint16_t)p->tolerance,
                             .sum_low = p->footprint.sum_low,
                             .sum_high = p->footprint.sum_high};
    if ((st = plan_void(p, report, err)))
        return st;
    plan_reuse(p, report);
    return CTS_OK;
}

static CtsStatus plan_memory(CtsPaperPlan *p, CtsError *err)
{
    const size_t n_tiles = (size_t)p->tiles.n[0] * (size_t)p->tiles.n[1];
    const size_t n_layer = (size_t)p->stack.n[0] * (size_t)p->stack.n[1];
    CtsStatus st;
    for (int i = 0; i < p->n_sheets; i++) {
        if ((st = cts_sheet_init(&p->sheet[i], &p->tiles, err)))
            return st;
        /* A row and a voxel more than the layer has, so that bilinear reads at its end stay inside. */
        const size_t n = p->gradient_stride * ((size_t)p->stack.n[1] + 1) + 1;
        if (p->lit && (st = cts_alloc_zeroed(&p->gradient[i], n, err)))
            return st;
        if (p->reuse && !p->skip_void && (st = cts_alloc_zeroed(&p->quiet[i], n_tiles, err)))
            return st;
    }
    for (int i = 0; i < 3 && (p->tolerance > 0 || p->rule.level); i++)
        if ((st = cts_alloc_zeroed(&p->settled[i], n_layer, err)))
            return st;
    if (p->skip_void && (st = cts_hidden_init(&p->hidden, &p->raster, err)))
        return st;
    return p->reuse || p->skip_void ? cts_runs_init(&p->runs, &p->tiles, err) : CTS_OK;
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
    cts_report_plan(report, "lighting: %s; threads: %d", p->scene->preset->shade ? "on" : "off", p->n_threads);
}

CtsStatus cts_paper_plan_init(CtsPaperPlan *p, const CtsScene *scene, CtsPaperFeatures features, CtsPicture *picture,
                              CtsReport *report, CtsError *err)
{
    CtsStatus st;
    *p = (CtsPaperPlan){
        .scene = scene, .picture = picture, .skip_void = features.skip_void, .reuse = features.reuse_layers};
    if ((st = plan_geometry(p, report, err)))
        return st;
    explain(p, report);
    if (scene->settings->max_error > 0)
        cts_report_skip(report, "error bound", "--samples is what this engine's error depends on");
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if ((st = plan_look(p, err)) || (st = plan_savings(p, report, err)))
        return st;
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, 0, 0);
    return picture ? plan_memory(p, err) : CTS_OK;
}

void cts_paper_plan_free(CtsPaperPlan *p)
{
    for (int i = 0; i < 2; i++) {
        cts_free(&p->table[i]);
        cts_free(&p->gradient[i]);
        cts_free(&p->quiet[i]);
        cts_sheet_free(&p->sheet[i]);
    }
    for (int i = 0; i < 3; i++)
        cts_free(&p->settled[i]);
    cts_hidden_free(&p->hidden);
    cts_runs_free(&p->runs);
    cts_void_map_free(&p->map);
    cts_shade_free(&p->shade);
    cts_stack_free(&p->stack);
}

/* Drop tiles that only opaque pixels look at. */
static void drop_hidden(const CtsPaperPlan *p, int step, int tile_v, uint8_t *tiles)
{
    const int k = cts_paper_layer(p, step);
    const double spread = p->samples > 1 ? 1 : 0;
    for (int t = 0; t < p->tiles.n[0]; t++)
        if (tiles[t])
            tiles[t] = !cts_hidden_tile(&p->hidden, &p->raster, &p->tiles, k, spread, t, tile_v);
}

void cts_paper_needed(const CtsPaperPlan *p, int step, int tile_v, uint8_t *needed)
{
    const int n = p->tiles.n[0], last = p->stack.n_layers - 1, here = cts_paper_layer(p, step);
    if (!p->skip_void || tile_v < 0 || tile_v >= p->tiles.n[1]) {
        memset(needed, !p->skip_void, (size_t)n);
        return;
    }
    memcpy(needed, cts_void_row(&p->map, here, step > 0 ? cts_paper_layer(p, step - 1) : here, tile_v), (size_t)n);
    if (p->samples > 1 && step < last) {
        const uint8_t *behind = cts_void_row(&p->map, here, cts_paper_layer(p, step + 1), tile_v);
        for (int t = 0; t < n; t++)
            needed[t] |= behind[t];
    }
    drop_hidden(p, step, tile_v, needed);
}

/* Tiles of which nothing is known, or something that shows. */
static void loud_tiles(const CtsPaperPlan *p, int step, int tile_v, uint8_t *shown)
{
    const size_t row = (size_t)tile_v * (size_t)p->tiles.n[0];
    const CtsQuiet *here = p->quiet[step % p->n_sheets] + row;
    const CtsQuiet *before = p->samples > 1 ? p->quiet[(step + 1) % 2] + row : here;
    for (int t = 0; t < p->tiles.n[0]; t++)
        shown[t] = !here[t].known || !before[t].known ||
                   cts_range_visible(&p->rule, cts_range_union(here[t].range, before[t].range));
}

void cts_paper_shown(const CtsPaperPlan *p, int step, int tile_v, uint8_t *shown)
{
    if (!p->skip_void) {
        loud_tiles(p, step, tile_v, shown);
        return;
    }
    const int here = cts_paper_layer(p, step), before = cts_paper_layer(p, step > 0 ? step - 1 : 0);
    memcpy(shown, cts_void_row(&p->map, here, before, tile_v), (size_t)p->tiles.n[0]);
    drop_hidden(p, step, tile_v, shown);
}
