#include "splat/paper.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "splat/paper_plan.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

/* One thread's scratch and counts. */
typedef struct Worker {
    CtsCompositor compositor;
    uint64_t *marks, *changed; /* a bit for each voxel of a row */
    uint8_t *above, *here;     /* by tile of the row before a band's and of its own: whether the sheet must hold it */
    uint8_t *segments;         /* likewise, by segment of a row */
    double busy_ms[CTS_N_STAGES];
    uint64_t splatted, reused;
} Worker;

/* Gradients at voxels u0..u1-1 of row v of layer k. */
static void gradient_row(const CtsPaperPlan *p, int k, int v, int u0, int u1, float (*field)[4])
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

/* Mark the segments that needed tiles are made of: those of this row of tiles, and for its edge (or the last edge, when
 * there is no row of tiles behind it) those of the row before too. */
static void needed_segments(Worker *w, int n, bool edge)
{
    for (int t = 0; t < n; t++)
        w->segments[2 * t + 1] = w->here[t] | (edge ? w->above[t] : 0);
    for (int t = 0; t <= n; t++)
        w->segments[2 * t] = (t > 0 && w->segments[2 * t - 1]) || (t < n && w->segments[2 * t + 1]);
}

/* Bring the needed segments of one row of segments up to date, in runs that start from the same state. */
static void splat_segments(const CtsPaperPlan *p, Worker *w, const CtsSplat *splat, int segment)
{
    const CtsTiles *t = &p->tiles;
    const int n = t->n_segments[0];
    uint8_t *holds = splat->sheet->holds + (size_t)segment * (size_t)n;
    for (int c = 0; c < n;) {
        if (!w->segments[c]) {
            c++;
            continue;
        }
        const bool from_old = splat->old_rows && holds[c];
        const int first = c;
        while (c < n && w->segments[c] && (splat->old_rows && holds[c]) == from_old)
            c++;
        const CtsPatch patch = {.u0 = cts_segment_start(t, 0, first, t->density[0]),
                                .u1 = cts_segment_start(t, 0, c, t->density[0]),
                                .v0 = cts_segment_start(t, 1, segment, t->density[1]),
                                .v1 = cts_segment_start(t, 1, segment + 1, t->density[1]),
                                .from_old = from_old,
                                .skip_equal = p->skip_void};
        const CtsSplatCount count = cts_splat_patch(splat, &patch);
        w->splatted += count.splatted;
        w->reused += from_old ? count.inside - count.splatted : 0;
    }
    memcpy(holds, w->segments, (size_t)n);
}

static void gradient_segments(const CtsPaperPlan *p, const Worker *w, int s, int segment)
{
    const CtsTiles *t = &p->tiles;
    const int v0 = cts_segment_start(t, 1, segment, 1), v1 = cts_segment_start(t, 1, segment + 1, 1);
    for (int c = 0; c < t->n_segments[0]; c++) {
        const int first = c;
        while (c < t->n_segments[0] && w->segments[c])
            c++;
        const int u0 = cts_segment_start(t, 0, first, 1), u1 = cts_segment_start(t, 0, c, 1);
        for (int v = v0; v < v1 && u0 < u1; v++)
            gradient_row(p, cts_paper_layer(p, s), v, u0, u1, p->gradient[s % p->n_sheets]);
    }
}

static void quiet_band(CtsPaperPlan *p, Worker *w, int tile_row, const CtsPaperRows *rows, const CtsPaperRows *old)
{
    const CtsQuietRow job = {.kernels = &p->kernels,
                             .tiles = &p->tiles,
                             .rule = &p->rule,
                             .row_of = cts_paper_row,
                             .rows = rows,
                             .old_rows = old,
                             .marks = w->marks,
                             .changed = w->changed,
                             .n = {p->stack.n[0], p->stack.n[1]}};
    cts_layers_quiet(&job, tile_row, p->quiet[rows->step % p->n_sheets] + (size_t)tile_row * (size_t)p->tiles.n[0]);
}

/* One band of step s's sheet: the edge and the inside of a row of tiles, and behind the last row its far edge. */
static void splat_band(CtsPaperPlan *p, Worker *w, int s, int tile_row)
{
    const CtsSheet *sheet = &p->sheet[s % p->n_sheets];
    const CtsPaperRows rows = {p, s}, old_rows = {p, s - p->n_sheets};
    const bool from_old = p->reuse && sheet->step == old_rows.step && old_rows.step >= 0;
    const CtsSplat splat = {.kernels = &p->kernels,
                            .footprint = &p->footprint,
                            .sheet = sheet,
                            .rows = &rows,
                            .old_rows = from_old ? &old_rows : NULL,
                            .row_of = cts_paper_row,
                            .base = p->base,
                            .n = {p->stack.n[0], p->stack.n[1]},
                            .marks = w->marks};
    const int first = 2 * tile_row, past = tile_row == p->tiles.n[1] - 1 ? first + 3 : first + 2;
    cts_paper_needed(p, s, tile_row - 1, w->above);
    cts_paper_needed(p, s, tile_row, w->here);
    for (int segment = first; segment < past; segment++) {
        needed_segments(w, p->tiles.n[0], segment == first);
        splat_segments(p, w, &splat, segment);
        if (p->lit) {
            const double start_ms = cts_wall_ms();
            gradient_segments(p, w, s, segment);
            w->busy_ms[CTS_STAGE_SHADE] += cts_wall_ms() - start_ms;
        }
    }
    if (p->reuse && !p->skip_void)
        quiet_band(p, w, tile_row, &rows, from_old ? &old_rows : NULL);
    if (p->reuse || p->skip_void) {
        cts_paper_shown(p, s, tile_row, w->here);
        cts_runs_set(&p->runs, tile_row, w->here, p->tiles.n[0]);
    }
}

static void composite_plane(const CtsPaperPlan *p, Worker *w, int s, int sub, const CtsEntries *entries)
{
    /* Sub-plane 0 is the layer before; sub-plane `samples` (the only one where there is one) is this layer. */
    const int front = sub < p->samples ? s - 1 : s;
    const int slot = front % p->n_sheets, behind = s % p->n_sheets;
    const double part = sub < p->samples ? (double)sub / p->samples : 0;
    const CtsLight light = {
        .shade = &p->shade,
        .first = (const float(*)[4])p->gradient[slot],
        .second = part > 0 ? (const float(*)[4])p->gradient[behind] : NULL,
        .stride = p->gradient_stride,
        .weight = (float)part,
        .shift = {__builtin_ctz((unsigned)p->tiles.density[0]), __builtin_ctz((unsigned)p->tiles.density[1])}};
    const CtsPlane plane = {.layer = cts_paper_layer(p, front) + p->scene->view.axis_sign * part,
                            .sheets = {.first = p->sheet[slot].origin,
                                       .second = part > 0 ? p->sheet[behind].origin : NULL,
                                       .stride = p->sheet[slot].stride,
                                       .weight = (float)part},
                            .entries = entries,
                            .light = p->lit ? &light : NULL,
                            .runs = p->reuse || p->skip_void ? &p->runs : NULL};
    const int height = p->raster.height, n_bands = (height + CTS_BLOCK_HEIGHT - 1) / CTS_BLOCK_HEIGHT;
    const int n_threads = omp_get_num_threads();
    for (int band = omp_get_thread_num(); band < n_bands; band += n_threads) {
        const int y0 = band * CTS_BLOCK_HEIGHT, y1 = y0 + CTS_BLOCK_HEIGHT;
        cts_composite_rows(&w->compositor, &plane, y0, y1 < height ? y1 : height);
    }
}

/* The planes that step s completes, front to back; each thread keeps to its own rows of the picture, so that planes
 * need no barrier between them. */
static void composite_step(const CtsPaperPlan *p, Worker *w, int s)
{
    const int last = p->stack.n_layers - 1;
    const int first_sub = p->samples == 1 || s == 0 ? p->samples : 0;
    for (int sub = first_sub; sub <= p->samples; sub++) {
        /* This layer itself, unless it will be sub-plane 0 of the next step. */
        if (sub == p->samples && p->samples > 1 && s < last)
            continue;
        const bool end = (sub == 0 && s == 1) || (sub == p->samples && (s == 0 || s == last));
        composite_plane(p, w, s, sub, &p->entries[end && !CTS_MUTATED(END_PLANES)]);
    }
}

/* The layers before and behind can be read after this too; all threads come here together. */
static void load_chunks(CtsPaperPlan *p, int s)
{
    for (int step = s - 1; step <= s + 1; step++) {
        const int chunk =
            step < 0 || step >= p->stack.n_layers ? -1 : cts_stack_missing(&p->stack, cts_paper_layer(p, step));
        if (chunk < 0)
            continue;
#pragma omp for schedule(dynamic, 4)
        for (int v = 0; v < p->stack.n[1]; v++)
            cts_stack_load(&p->stack, chunk, v, v + 1);
#pragma omp single
        cts_stack_set_loaded(&p->stack, chunk);
    }
}

/* Rows as they are splatted, where that is not as they are. */
static void settle_rows(CtsPaperPlan *p, int s)
{
    const size_t n = (size_t)p->stack.n[0];
#pragma omp for schedule(static)
    for (int v = 0; v < p->stack.n[1]; v++)
        cts_layers_settle(cts_stack_row(&p->stack, cts_paper_layer(p, s), v),
                          s > 0 && p->tolerance > 0 ? p->settled[(s + 2) % 3] + (size_t)v * n : NULL, p->rule.level,
                          p->tolerance, p->stack.n[0], p->settled[s % 3] + (size_t)v * n);
}

static void splat_step(CtsPaperPlan *p, Worker *w, int s)
{
    const double start_ms = cts_thread_cpu_ms(), shade_ms = w->busy_ms[CTS_STAGE_SHADE];
    load_chunks(p, s);
    if (p->settled[0])
        settle_rows(p, s);
    if (cts_paper_step_needed(p, s)) {
#pragma omp for schedule(dynamic, 1) nowait
        for (int row = 0; row < p->tiles.n[1]; row++)
            splat_band(p, w, s, row);
    }
    const double busy_ms = cts_thread_cpu_ms() - start_ms - (w->busy_ms[CTS_STAGE_SHADE] - shade_ms);
    w->busy_ms[CTS_STAGE_SPLAT] += busy_ms > 0 ? busy_ms : 0;
}

static void run_thread(CtsPaperPlan *p, Worker *w)
{
    for (int s = 0; s < p->stack.n_layers - CTS_MUTATED(LAST_LAYER); s++) {
        const bool needed = cts_paper_step_needed(p, s);
        /* A dead band must see every layer, needed or not. */
        if (!needed && p->tolerance == 0)
            continue;
        splat_step(p, w, s);
        if (!needed)
            continue;
#pragma omp master
        p->stopped = cts_scene_stopped(p->scene);
#pragma omp barrier
        if (p->stopped)
            return;
        const double start_ms = cts_thread_cpu_ms();
        composite_step(p, w, s);
        w->busy_ms[CTS_STAGE_COMPOSITE] += cts_thread_cpu_ms() - start_ms;
#pragma omp master
        p->sheet[s % p->n_sheets].step = s;
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

static void report_run(const CtsPaperPlan *p, const Worker *workers, double wall_ms, double cpu_ms, CtsReport *report)
{
    double busy[CTS_N_STAGES] = {0}, timed_ms = 0, timed_blend_ms = 0;
    uint64_t items[CTS_N_STAGES] = {0}, splatted = 0, reused = 0, samples = 0;
    for (int t = 0; t < p->n_threads; t++) {
        for (int stage = 0; stage < CTS_N_STAGES; stage++)
            busy[stage] += workers[t].busy_ms[stage];
        timed_ms += workers[t].compositor.timed_ms;
        timed_blend_ms += workers[t].compositor.timed_blend_ms;
        splatted += workers[t].splatted;
        reused += workers[t].reused;
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
    if (report) {
        const uint64_t total = cts_volume_n_voxels(p->scene->volume);
        report->voxels = (CtsVoxelCounts){.known = true,
                                          .total = total,
                                          .void_voxels = total - splatted - reused,
                                          .reused = reused,
                                          .splatted = splatted};
    }
}

static CtsStatus worker_init(Worker *w, CtsPaperPlan *p, CtsError *err)
{
    const size_t n_words = (size_t)p->stack.n[0] / 64 + 1, n_tiles = (size_t)p->tiles.n[0];
    CtsStatus st;
    if ((st = cts_compositor_init(&w->compositor, &p->kernels, &p->tiles, &p->raster, &p->scene->view, p->scene->volume,
                                  p->picture, err)) ||
        (st = cts_alloc_array(&w->marks, n_words, err)) || (st = cts_alloc_array(&w->changed, n_words, err)) ||
        (st = cts_alloc_array(&w->above, n_tiles, err)) || (st = cts_alloc_array(&w->here, n_tiles, err)))
        return st;
    w->compositor.hidden = p->skip_void ? &p->hidden : NULL;
    return cts_alloc_array(&w->segments, (size_t)p->tiles.n_segments[0], err);
}

static void worker_free(Worker *w)
{
    cts_compositor_free(&w->compositor);
    cts_free(&w->marks);
    cts_free(&w->changed);
    cts_free(&w->above);
    cts_free(&w->here);
    cts_free(&w->segments);
}

static CtsStatus run(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsStatus st = CTS_OK;
    Worker *workers = calloc((size_t)p->n_threads, sizeof *workers);
    if (!workers)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int t = 0; t < p->n_threads; t++)
        if ((st = worker_init(&workers[t], p, err)))
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
    for (int t = 0; t < p->n_threads; t++)
        worker_free(&workers[t]);
    free(workers);
    return st;
}

CtsStatus cts_paper_render(const CtsScene *scene, CtsPaperFeatures features, CtsPicture *picture, CtsReport *report,
                           CtsError *err)
{
    CtsPaperPlan plan;
    CtsStatus st = cts_paper_plan_init(&plan, scene, features, picture, report, err);
    if (!st && picture)
        st = run(&plan, report, err);
    cts_paper_plan_free(&plan);
    return st;
}
