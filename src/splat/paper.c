#include "splat/paper.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "splat/composite.h"
#include "splat/sheet.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>

enum { BAND = 8 }; /* picture rows that one thread takes at a time */

/* What holds for the whole picture; threads only read it, but for the sheets and runs, whose parts they own in turn. */
typedef struct Plan {
    const CtsScene *scene;
    CtsPaperFeatures features;
    CtsPicture *picture;
    CtsKernels kernels;
    CtsFootprint footprint;
    CtsStack stack;
    CtsTiles tiles;
    CtsRaster raster;
    int samples, n_sheets, n_threads;
    CtsEntries entries[2]; /* a plane's length of ray, and half of it for the first and last plane */
    float (*table[2])[4];
    bool lit;
    CtsShade shade;
    CtsSheet sheet[2];
    float (*gradient[2])[4]; /* at the voxels of the sheets' layers */
    size_t gradient_stride;
    bool stopped;
} Plan;

typedef struct Worker {
    CtsCompositor compositor;
    uint64_t *marks;
    double busy_ms[CTS_N_STAGES];
    uint64_t splatted;
} Worker;

typedef struct LayerRows {
    const CtsStack *stack;
    int layer;
} LayerRows;

static const uint16_t *layer_row(const void *context, int v)
{
    const LayerRows *rows = context;
    return cts_stack_row(rows->stack, rows->layer, v);
}

/* Layers are crossed front to back; this is the s-th one's index in the volume. */
static int layer_at(const Plan *p, int s)
{
    return p->scene->view.axis_sign > 0 ? s : p->stack.n_layers - 1 - s;
}

/* About one lattice point a pixel, and a power of two. */
static int choose_density(double voxels_per_pixel)
{
    int density = 1;
    while (density < CTS_MAX_DENSITY && density * voxels_per_pixel * M_SQRT2 < 1)
        density *= 2;
    return density;
}

static CtsStatus plan_geometry(Plan *p, CtsError *err)
{
    const CtsRenderSettings *settings = p->scene->settings;
    CtsStatus st;
    int density[2] = {1, 1};
    if ((st = cts_stack_init(&p->stack, p->scene->volume, p->scene->view.axis, err)))
        return st;
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    for (int c = 0; c < 2; c++)
        density[c] = choose_density(fmax(fabs(p->raster.by_x[c]), fabs(p->raster.by_y[c])));
    cts_raster_init(&p->raster, &p->scene->view, &p->stack, density);
    p->tiles = cts_tiles(&p->stack, density);
    p->samples = settings->samples > 0 ? settings->samples : 1;
    p->n_sheets = p->samples > 1 ? 2 : 1;
    p->n_threads = settings->n_threads;
    cts_kernels_init(&p->kernels, cts_cpu_flags() & settings->cpu_mask);
    return cts_footprint_init(&p->footprint, settings->kernel, settings->kernel_radius, density, err);
}

static CtsStatus plan_memory(Plan *p, CtsError *err)
{
    CtsStatus st;
    for (int i = 0; i < p->n_sheets; i++) {
        if ((st = cts_sheet_init(&p->sheet[i], &p->tiles, err)))
            return st;
        /* A row and a voxel more than the layer has, so that bilinear reads at its end stay inside. */
        const size_t n = p->gradient_stride * ((size_t)p->stack.n[1] + 1) + 1;
        if (p->lit && (st = cts_alloc_zeroed(&p->gradient[i], n, err)))
            return st;
    }
    return CTS_OK;
}

static CtsStatus plan_look(Plan *p, CtsReport *report, CtsError *err)
{
    const CtsScene *scene = p->scene;
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    const double length_mm = p->stack.n_layers > 1 ? scene->view.layer_mm / p->samples : 0;
    CtsStatus st;
    for (int i = 0; i < 2; i++) {
        if ((st = cts_alloc_array(&p->table[i], CTS_N_GREY, err)))
            return st;
        cts_entries_init(&p->entries[i], p->table[i], scene->lut, i ? length_mm / 2 : length_mm);
    }
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, 0, 0);
    p->lit = scene->preset->shade;
    p->gradient_stride = (size_t)p->stack.n[0];
    if (!p->lit)
        return CTS_OK;
    const int axes[3] = {p->stack.u_axis, p->stack.v_axis, p->stack.axis};
    return cts_shade_init(&p->shade, scene->preset, scene->volume, &scene->view, axes, err);
}

/* Gradients at voxels u0..u1-1 of row v of layer k. */
static void gradient_row(const Plan *p, int k, int v, int u0, int u1, float (*field)[4])
{
    const CtsStack *s = &p->stack;
    const int v_low = v > 0 ? v - 1 : v, v_high = v < s->n[1] - 1 ? v + 1 : v;
    const int k_low = k > 0 ? k - 1 : k, k_high = k < s->n_layers - 1 ? k + 1 : k;
    const uint16_t *const before[2] = {cts_stack_row(s, k, v_low), cts_stack_row(s, k_low, v)};
    const uint16_t *const after[2] = {cts_stack_row(s, k, v_high), cts_stack_row(s, k_high, v)};
    const float scale[2] = {v_high - v_low == 1 ? 2 : 1, k_high - k_low == 1 ? 2 : 1};
    p->kernels.gradient(cts_stack_row(s, k, v), before, after, scale, s->n[0], u0, u1,
                        field + (size_t)v * p->gradient_stride);
}

/* One band of the sheet: the edge and the inside of a row of tiles, and behind the last row its far edge. */
static void splat_band(const Plan *p, Worker *w, int s, int tile_row)
{
    const CtsTiles *t = &p->tiles;
    const int slot = s % p->n_sheets, k = layer_at(p, s);
    const LayerRows rows = {&p->stack, k};
    const CtsSplat splat = {.kernels = &p->kernels,
                            .footprint = &p->footprint,
                            .sheet = &p->sheet[slot],
                            .rows = &rows,
                            .row_of = layer_row,
                            .n = {p->stack.n[0], p->stack.n[1]},
                            .marks = w->marks};
    const int first = 2 * tile_row, past = tile_row == t->n[1] - 1 ? first + 3 : first + 2;
    for (int segment = first; segment < past; segment++) {
        const CtsPatch patch = {.u0 = 0,
                                .u1 = p->sheet[slot].last[0] + 1,
                                .v0 = cts_segment_start(t, 1, segment, t->density[1]),
                                .v1 = cts_segment_start(t, 1, segment + 1, t->density[1])};
        w->splatted += cts_splat_patch(&splat, &patch);
    }
}

static void gradient_band(const Plan *p, int s, int tile_row)
{
    const int past = tile_row == p->tiles.n[1] - 1 ? p->stack.n[1] : (tile_row + 1) * CTS_TILE;
    for (int v = tile_row * CTS_TILE; v < past; v++)
        gradient_row(p, layer_at(p, s), v, 0, p->stack.n[0], p->gradient[s % p->n_sheets]);
}

static void composite_plane(const Plan *p, Worker *w, int s, int sub, const CtsEntries *entries)
{
    /* Sub-planes lie behind layer s - 1 on the way to layer s; sub 0 of one sheet a layer is layer s itself. */
    const bool between = sub > 0;
    const int front = p->samples > 1 && sub < p->samples ? s - 1 : s;
    const int slot = front % p->n_sheets, behind = s % p->n_sheets;
    const float weight = between && front < s ? (float)((double)sub / p->samples) : 0;
    const CtsLight light = {
        .shade = &p->shade,
        .first = (const float(*)[4])p->gradient[slot],
        .second = weight > 0 ? (const float(*)[4])p->gradient[behind] : NULL,
        .stride = p->gradient_stride,
        .weight = weight,
        .shift = {__builtin_ctz((unsigned)p->tiles.density[0]), __builtin_ctz((unsigned)p->tiles.density[1])}};
    const int sign = p->scene->view.axis_sign;
    const CtsPlane plane = {.layer = layer_at(p, front) + (front < s ? sign * ((double)sub / p->samples) : 0),
                            .sheets = {.first = p->sheet[slot].origin,
                                       .second = weight > 0 ? p->sheet[behind].origin : NULL,
                                       .stride = p->sheet[slot].stride,
                                       .weight = weight},
                            .entries = entries,
                            .light = p->lit ? &light : NULL};
    const int n_bands = (p->raster.height + BAND - 1) / BAND, n_threads = omp_get_num_threads();
    for (int band = omp_get_thread_num(); band < n_bands; band += n_threads) {
        const int y0 = band * BAND, y1 = y0 + BAND < p->raster.height ? y0 + BAND : p->raster.height;
        cts_composite_rows(&w->compositor, &plane, y0, y1);
    }
}

/* The planes that layer s completes, front to back; each thread keeps to its own rows of the picture, so that planes
 * need no barrier between them. */
static void composite_step(const Plan *p, Worker *w, int s)
{
    const int last = p->stack.n_layers - 1;
    const int first_sub = p->samples == 1 || s == 0 ? p->samples : 0;
    for (int sub = first_sub; sub <= p->samples; sub++) {
        /* Layer s itself, unless it will be sub 0 of the next step. */
        if (sub == p->samples && p->samples > 1 && s < last)
            continue;
        const bool end = (sub == 0 && s == 1) || (sub == p->samples && (s == 0 || s == last));
        composite_plane(p, w, s, sub, &p->entries[end]);
    }
}

/* Layers k - 2 to k + 2 can be read after this; all threads come here together. */
static void load_chunks(Plan *p, int s)
{
    for (int ahead = 0; ahead <= 2; ahead++) {
        const int k = layer_at(p, s + ahead < p->stack.n_layers ? s + ahead : p->stack.n_layers - 1);
        const int chunk = cts_stack_missing(&p->stack, k);
        if (chunk < 0)
            continue;
#pragma omp for schedule(dynamic, 4)
        for (int v = 0; v < p->stack.n[1]; v++)
            cts_stack_load(&p->stack, chunk, v, v + 1);
#pragma omp single
        cts_stack_set_loaded(&p->stack, chunk);
    }
}

static void run_thread(Plan *p, Worker *w)
{
    for (int s = 0; s < p->stack.n_layers; s++) {
        double start_ms = cts_thread_cpu_ms();
        load_chunks(p, s);
#pragma omp for schedule(dynamic, 1) nowait
        for (int row = 0; row < p->tiles.n[1]; row++)
            splat_band(p, w, s, row);
        double end_ms = cts_thread_cpu_ms();
        w->busy_ms[CTS_STAGE_SPLAT] += end_ms - start_ms;
        start_ms = end_ms;
        if (p->lit) {
#pragma omp for schedule(dynamic, 1) nowait
            for (int row = 0; row < p->tiles.n[1]; row++)
                gradient_band(p, s, row);
            end_ms = cts_thread_cpu_ms();
            w->busy_ms[CTS_STAGE_SHADE] += end_ms - start_ms;
        }
#pragma omp master
        p->stopped = cts_scene_stopped(p->scene);
#pragma omp barrier
        if (p->stopped)
            return;
        start_ms = cts_thread_cpu_ms();
        composite_step(p, w, s);
        w->busy_ms[CTS_STAGE_COMPOSITE] += cts_thread_cpu_ms() - start_ms;
#pragma omp barrier
    }
}

/* Between blends a pixel's fourth value is transmittance: 1 at first, alpha at last. */
static void flip_alpha(CtsPicture *picture)
{
    const size_t n = (size_t)picture->width * (size_t)picture->height;
    for (size_t i = 0; i < n; i++)
        picture->pixels[4 * i + 3] = 1 - picture->pixels[4 * i + 3];
}

static void report_run(const Plan *p, const Worker *workers, double wall_ms, double cpu_ms, CtsReport *report)
{
    double busy[CTS_N_STAGES] = {0}, timed_ms = 0, timed_blend_ms = 0;
    uint64_t items[CTS_N_STAGES] = {0}, splatted = 0, samples = 0;
    for (int t = 0; t < p->n_threads; t++) {
        for (int stage = 0; stage < CTS_N_STAGES; stage++)
            busy[stage] += workers[t].busy_ms[stage];
        timed_ms += workers[t].compositor.timed_ms;
        timed_blend_ms += workers[t].compositor.timed_blend_ms;
        splatted += workers[t].splatted;
        samples += workers[t].compositor.samples;
    }
    if (p->lit && timed_ms > 0) {
        const double lighting_ms = busy[CTS_STAGE_COMPOSITE] * timed_blend_ms / timed_ms;
        busy[CTS_STAGE_COMPOSITE] -= lighting_ms;
        busy[CTS_STAGE_SHADE] += lighting_ms;
    }
    items[CTS_STAGE_SPLAT] = splatted;
    items[CTS_STAGE_COMPOSITE] = samples;
    cts_report_region(report, wall_ms, cpu_ms, busy, items, NULL);
    if (report)
        report->voxels =
            (CtsVoxelCounts){.known = true, .total = cts_volume_n_voxels(p->scene->volume), .splatted = splatted};
}

static CtsStatus run(Plan *p, CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsStatus st = CTS_OK;
    Worker *workers = calloc((size_t)p->n_threads, sizeof *workers);
    if (!workers)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int t = 0; t < p->n_threads; t++)
        if ((st = cts_compositor_init(&workers[t].compositor, &p->kernels, &p->tiles, &p->raster, &p->scene->view,
                                      p->scene->volume, p->picture, err)) ||
            (st = cts_alloc_array(&workers[t].marks, (size_t)p->stack.n[0] / 64 + 1, err)))
            goto end;
    flip_alpha(p->picture);
    /* Threads may be fewer than asked for; each takes its worker by number, and bands go round whoever is there. */
#pragma omp parallel num_threads(p->n_threads)
    run_thread(p, &workers[omp_get_thread_num()]);
    flip_alpha(p->picture);
    report_run(p, workers, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, report);
    if (p->stopped)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
end:
    for (int t = 0; t < p->n_threads; t++) {
        cts_compositor_free(&workers[t].compositor);
        cts_free(&workers[t].marks);
    }
    free(workers);
    return st;
}

static void explain(const Plan *p, CtsReport *report)
{
    static const char axis_name[3] = {'x', 'y', 'z'};
    cts_report_plan(report,
                    "layers: %d across the volume's %c axis, %d x %d voxels each, %d plane%s of samples a layer",
                    p->stack.n_layers, axis_name[p->stack.axis], p->stack.n[0], p->stack.n[1], p->samples,
                    p->samples > 1 ? "s" : "");
    cts_report_plan(report, "sheet: %d x %d samples a voxel, footprint of %d x %d taps", p->footprint.density[0],
                    p->footprint.density[1], 2 * p->footprint.reach[0] + 1, 2 * p->footprint.reach[1] + 1);
    cts_report_plan(report, "lighting: %s; threads: %d", p->lit ? "on" : "off", p->n_threads);
}

CtsStatus cts_paper_render(const CtsScene *scene, CtsPaperFeatures features, CtsPicture *picture, CtsReport *report,
                           CtsError *err)
{
    Plan p = {.scene = scene, .features = features, .picture = picture};
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsStatus st;
    if ((st = plan_geometry(&p, err)))
        goto end;
    cts_report_stage(report, CTS_STAGE_FOOTPRINT, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms,
                     (uint64_t)(2 * p.footprint.reach[0] + 1) * (uint64_t)(2 * p.footprint.reach[1] + 1), 0);
    if ((st = plan_look(&p, report, err)))
        goto end;
    explain(&p, report);
    if (!picture)
        goto end;
    if ((st = plan_memory(&p, err)))
        goto end;
    st = run(&p, report, err);
end:
    for (int i = 0; i < 2; i++) {
        cts_free(&p.table[i]);
        cts_free(&p.gradient[i]);
        cts_sheet_free(&p.sheet[i]);
    }
    cts_shade_free(&p.shade);
    cts_stack_free(&p.stack);
    return st;
}
