#include "engine/splat/paper.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/splat/paper_plan.h"
#include "base/bits.h"
#include <stdlib.h>
#include <string.h>

/* One thread's scratch and counts. */
typedef struct Worker {
    CtsCompositor compositor;
    uint64_t *marks, *changed; /* a bit for each voxel of a row */
    uint64_t *needed, *row;    /* bits for each patch of the rows that a swath meets, and for one */
    int swath, open_until;     /* by swaths: which one, and the step up to which its open patches hold */
    bool stopped;
    int beside[2];             /* voxels beside a patch, along u and v, that its samples depend on */
    CtsPaperStore *store, own; /* own: by swaths */
    double busy_ms[CTS_N_STAGES];
    uint64_t splatted, reused;
} Worker;

/* Gradients at voxels u0..u1-1 of row v of layer k. */
static void gradient_row(const CtsPaperPlan *p, const CtsStack *s, int k, int v, int u0, int u1, float (*field)[4])
{
    const int dv = p->shade.step[1], dk = p->shade.step[2];
    const bool ends[2][2] = {{v < dv, v >= s->n[1] - dv}, {k < dk, k >= s->n_layers - dk}};
    CtsGradientRows rows = {.row = cts_stack_row(s, k, v), .n = s->n[0], .air_beyond = p->shade.air_beyond};
    const uint16_t *const beyond = p->air ? p->air : rows.row;
    for (int i = 0; i < 2; i++) {
        const int u = i == 0 ? dv : 0, q = i == 0 ? 0 : dk;
        rows.before[i] = ends[i][0] ? beyond : cts_stack_row(s, k - q, v - u);
        rows.after[i] = ends[i][1] ? beyond : cts_stack_row(s, k + q, v + u);
        rows.scale[i] = !p->air && (ends[i][0] || ends[i][1]) ? 2 : 1;
    }
    p->simd.gradient(&rows, u0, u1, field + (size_t)v * p->gradient_stride);
}

/* Gradients of a swath's rows, at the voxels of needed patches. */
static void gradient_swath(const CtsPaperPlan *p, const Worker *w, int s, int swath)
{
    const bool far_edge = p->by_swaths && swath < p->patches.n_swaths - 1;
    const int past = cts_swath_start(&p->patches, swath + 1, 1) + far_edge, n = p->patches.n[0];
    for (int v = cts_swath_start(&p->patches, swath, 1); v < past; v++) {
        int first, last;
        cts_patch_rows(&p->patches, v, 1, &first, &last);
        cts_needed_rows(&p->patches, w->needed, swath, first, last, w->row);
        for (int t = 0, end; cts_next_run(w->row, n, &t, &end); t = end) {
            const int u1 = end * CTS_PATCH < p->stack.n[0] ? end * CTS_PATCH + 1 : p->stack.n[0];
            gradient_row(p, &w->store->stack, cts_paper_layer(p, s), v, t * CTS_PATCH, u1,
                         w->store->gradient[s % p->n_sheets]);
        }
    }
}

static void quiet_swath(CtsPaperPlan *p, Worker *w, int swath, const CtsPaperRows *rows, const CtsPaperRows *old)
{
    const CtsQuietJob job = {.simd = &p->simd,
                             .rule = &p->rule,
                             .row_of = cts_paper_row,
                             .rows = rows,
                             .old_rows = old,
                             .marks = w->marks,
                             .changed = w->changed,
                             .n = {p->stack.n[0], p->stack.n[1]}};
    cts_quiet_swath(&p->quiet[rows->step % p->n_sheets], &job, swath);
}

/* The patches that the sheet must hold, of the swath's rows and, where another swath has their edge, of the row before;
 * true when there are any. */
static bool find_needed(const CtsPaperPlan *p, Worker *w, int s, int swath)
{
    const int n_words = p->patches.n_words, first = p->by_swaths ? 1 : 0;
    uint64_t any = 0;
    memset(w->needed, 0, (size_t)CTS_NEEDED_ROWS * (size_t)n_words * sizeof *w->needed);
    for (int r = first; r <= CTS_SWATH; r++)
        cts_paper_needed(p, s, swath * CTS_SWATH - 1 + r, w->needed + (size_t)r * (size_t)n_words);
    for (int i = 0; i < n_words; i++) {
        uint64_t all = 0;
        for (int r = 0; r < CTS_NEEDED_ROWS; r++)
            all |= w->needed[r * n_words + i];
        /* With reuse a sheet keeps account by whole swaths, so all rows of the swath need what any of them needs. */
        for (int r = 0; r < CTS_NEEDED_ROWS && p->reuse; r++)
            w->needed[r * n_words + i] = all;
        any |= all;
    }
    return any != 0;
}

static void find_runs(CtsPaperPlan *p, Worker *w, int s, int swath)
{
    for (int r = swath * CTS_SWATH; r < (swath + 1) * CTS_SWATH && r < p->patches.n[1]; r++) {
        cts_paper_shown(p, s, r, w->row);
        cts_runs_set(&p->runs, r, w->row, p->patches.n[0]);
    }
}

/* Returns false when nothing of the swath is needed. */
static bool splat_swath(CtsPaperPlan *p, Worker *w, int s, int swath)
{
    const CtsSheet *sheet = &w->store->sheet[s % p->n_sheets];
    const CtsPaperRows rows = {p, w->store, s}, old_rows = {p, w->store, s - p->n_sheets};
    const CtsPaperRows next_rows = {p, w->store, s + 1};
    const bool from_old = p->reuse && sheet->step == old_rows.step && old_rows.step >= 0;
    const CtsSplat splat = {.simd = &p->simd,
                            .footprint = &p->footprint,
                            .sheet = sheet,
                            .patches = &p->patches,
                            .rows = &rows,
                            .old_rows = from_old ? &old_rows : NULL,
                            .next_rows = p->skip_void && s + 1 < p->stack.n_layers ? &next_rows : NULL,
                            .row_of = cts_paper_row,
                            .base = p->base,
                            .n = {p->stack.n[0], p->stack.n[1]},
                            .reuse = p->reuse,
                            .needed = w->needed,
                            .row = w->row,
                            .marks = w->marks};
    const bool needed = find_needed(p, w, s, swath);
    if (needed || p->reuse) {
        const CtsSplatCount count = cts_splat_swath(&splat, swath, p->by_swaths);
        w->splatted += count.splatted;
        w->reused += count.reused;
    }
    if (p->lit && needed) {
        const double start_ms = cts_wall_ms();
        gradient_swath(p, w, s, swath);
        w->busy_ms[CTS_STAGE_SHADE] += cts_wall_ms() - start_ms;
    }
    if (p->reuse && !p->skip_void)
        quiet_swath(p, w, swath, &rows, from_old ? &old_rows : NULL);
    if (p->reuse || p->skip_void)
        find_runs(p, w, s, swath);
    return needed;
}

/* The first plane and the last stand for half a length of ray. */
static bool at_end(const CtsPaperPlan *p, int s, int sub)
{
    const int last = p->stack.n_layers - 1;
    return (sub == 0 && s == 1) || (sub == p->samples && (s == 0 || s == last));
}

static void composite_plane(const CtsPaperPlan *p, Worker *w, int s, int sub, int y0, int y1)
{
    /* Sub-plane 0 is the layer before; sub-plane `samples` (the only one where there is one) is this layer. */
    const int front = sub < p->samples ? s - 1 : s;
    const int slot = front % p->n_sheets, behind = s % p->n_sheets;
    const double part = sub < p->samples ? (double)sub / p->samples : 0;
    const CtsLight light = {
        .shade = &p->shade,
        .first = (const float(*)[4])w->store->gradient[slot],
        .second = part > 0 ? (const float(*)[4])w->store->gradient[behind] : NULL,
        .stride = p->gradient_stride,
        .weight = (float)part,
        .shift = {__builtin_ctz((unsigned)p->patches.density[0]), __builtin_ctz((unsigned)p->patches.density[1])}};
    const CtsPlane plane = {.layer = cts_paper_layer(p, front) + p->scene->view.axis_sign * part,
                            .sheets = {.first = w->store->sheet[slot].origin,
                                       .second = part > 0 ? w->store->sheet[behind].origin : NULL,
                                       .stride = w->store->sheet[slot].stride,
                                       .weight = (float)part},
                            .entries = &p->entries[at_end(p, s, sub) && !CTS_MUTATED(END_PLANES)],
                            .light = p->lit ? &light : NULL,
                            .runs = p->reuse || p->skip_void ? &p->runs : NULL};
    cts_composite_rows(&w->compositor, &plane, y0, y1);
}

/* The planes that can be sampled once step s has its sheet, front to back, in rows y0 to y1 - 1 of the picture. */
static void composite_step(const CtsPaperPlan *p, Worker *w, int s, int y0, int y1)
{
    const int last = p->stack.n_layers - 1;
    const int first_sub = p->samples == 1 || s == 0 ? p->samples : 0;
    for (int sub = first_sub; sub <= p->samples; sub++) {
        /* This layer itself, unless it will be sub-plane 0 of the next step. */
        if (sub == p->samples && p->samples > 1 && s < last)
            continue;
        composite_plane(p, w, s, sub, y0, y1);
    }
}

/* The eights of voxels of row v that a chunk is loaded for: those that reach into wanted patches, and for gradients
 * their neighbours. */
static void find_eights(const CtsPaperPlan *p, Worker *w, int v)
{
    const int n = p->patches.n[0], n_words = p->patches.n_words, last = p->patches.n[1] - 1;
    const int above = v > w->beside[1] ? v - w->beside[1] : 0, below = v + w->beside[1];
    int first, unused, past;
    cts_patch_rows(&p->patches, above, 1, &first, &unused);
    cts_patch_rows(&p->patches, below, 1, &unused, &past);
    memset(w->row, 0, (size_t)n_words * sizeof *w->row);
    memset(w->marks, 0, ((size_t)p->stack.n[0] / 64 + 1) * sizeof *w->marks);
    for (int r = first; r <= past && r <= last; r++)
        for (int i = 0; i < n_words; i++)
            w->row[i] |= w->store->wanted[(size_t)r * (size_t)n_words + (size_t)i];
    for (int t = 0, end; cts_next_run(w->row, n, &t, &end); t = end) {
        const int low = t * CTS_PATCH - w->beside[0], high = (end * CTS_PATCH + w->beside[0]) / 8;
        cts_bits_fill(w->marks, low > 0 ? low / 8 : 0, (high < p->stack.n[0] / 8 ? high : p->stack.n[0] / 8) + 1);
    }
}

/* Whether chunks are loaded only where something may show. With a dead band (--tolerance) every voxel of every layer is
 * looked at, and without void skipping every voxel is splatted: both need whole chunks. */
static bool loads_partly(const CtsPaperPlan *p)
{
    return p->skip_void && p->tolerance == 0;
}

static void load_row(const CtsPaperPlan *p, Worker *w, int chunk, int v)
{
    if (loads_partly(p))
        find_eights(p, w, v);
    cts_stack_load(&w->store->stack, chunk, v, loads_partly(p) ? w->marks : NULL);
}

/* The chunk to load before a step's neighbour can be read, or -1. */
static int chunk_missing(const CtsPaperPlan *p, const CtsPaperStore *store, int step)
{
    return step < 0 || step >= p->stack.n_layers ? -1 : cts_stack_missing(&store->stack, cts_paper_layer(p, step));
}

/* What all workers share while a layer is worked on. */
typedef struct Step {
    CtsPaperPlan *plan;
    Worker *workers;
    int s, chunk;
} Step;

static void find_wanted(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    (void)worker;
    for (size_t row = first; row < end; row++)
        cts_paper_find_wanted(step->plan, &step->plan->store, step->chunk, (int)row);
}

static void load_rows(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    Worker *const w = &step->workers[worker];
    const double start_ms = cts_thread_cpu_ms();
    for (size_t v = first; v < end; v++)
        load_row(step->plan, w, step->chunk, (int)v);
    w->busy_ms[CTS_STAGE_SPLAT] += cts_thread_cpu_ms() - start_ms;
}

/* Load the chunks that the layers of steps s - 1 to s + 1 lie in. */
static void load_chunks(Step *step)
{
    CtsPaperPlan *const p = step->plan;
    for (int s = step->s - 1; s <= step->s + 1; s++) {
        step->chunk = chunk_missing(p, &p->store, s);
        if (step->chunk < 0)
            continue;
        if (loads_partly(p))
            cts_parallel(p->n_threads, (size_t)p->patches.n[1], 0, find_wanted, step);
        cts_parallel(p->n_threads, (size_t)p->stack.n[1], 0, load_rows, step);
        cts_stack_set_loaded(&p->store.stack, step->chunk);
    }
}

static void find_open(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    (void)worker;
    for (size_t swath = first; swath < end; swath++)
        cts_paper_find_open(step->plan, step->s, (int)swath);
}

/* Row v of step s as it is splatted under a tolerance: voxels that changed too little since the step before keep its
 * value. */
static void settle_row(const CtsPaperPlan *p, const CtsPaperStore *store, int s, int v)
{
    const size_t at = (size_t)v * (size_t)p->stack.n[0];
    cts_layers_settle(cts_stack_row(&store->stack, cts_paper_layer(p, s), v),
                      s > 0 ? store->settled[(s + 2) % 3] + at : NULL, p->tolerance, p->stack.n[0],
                      store->settled[s % 3] + at);
}

static void settle_rows(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    (void)worker;
    for (size_t v = first; v < end; v++)
        settle_row(step->plan, &step->plan->store, step->s, (int)v);
}

static void splat_swaths(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    Worker *const w = &step->workers[worker];
    const double start_ms = cts_thread_cpu_ms(), shade_ms = w->busy_ms[CTS_STAGE_SHADE];
    for (size_t swath = first; swath < end; swath++)
        splat_swath(step->plan, w, step->s, (int)swath);
    const double busy_ms = cts_thread_cpu_ms() - start_ms - (w->busy_ms[CTS_STAGE_SHADE] - shade_ms);
    w->busy_ms[CTS_STAGE_SPLAT] += busy_ms > 0 ? busy_ms : 0;
}

/* Rows of zones of the picture, each through all planes of the step, so that planes need not wait for each other. */
static void composite_zones(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    Worker *const w = &step->workers[worker];
    const int height = step->plan->raster.height, y1 = (int)end * CTS_ZONE_HEIGHT;
    const double start_ms = cts_thread_cpu_ms();
    composite_step(step->plan, w, step->s, (int)first * CTS_ZONE_HEIGHT, y1 < height ? y1 : height);
    w->busy_ms[CTS_STAGE_COMPOSITE] += cts_thread_cpu_ms() - start_ms;
}

/* All threads, layer after layer. */
static void run_layers(CtsPaperPlan *p, Worker *workers)
{
    Step step = {.plan = p, .workers = workers};
    int open_until = 0; /* the step up to which the plan's open patches hold */
    for (int s = 0; s < p->stack.n_layers - CTS_MUTATED(LAST_LAYER) && !p->stopped; s++) {
        const bool needed = cts_paper_step_needed(p, s);
        /* The dead band compares with the layer before, so it must see every layer, needed or not. */
        if (!needed && p->tolerance == 0)
            continue;
        step.s = s;
        load_chunks(&step);
        if (p->tolerance > 0)
            cts_parallel(p->n_threads, (size_t)p->stack.n[1], 0, settle_rows, &step);
        if (!needed)
            continue;
        if (p->skip_void && s >= open_until) {
            open_until = s + CTS_PAPER_OPEN_STEPS;
            cts_parallel(p->n_threads, (size_t)p->patches.n_swaths, 0, find_open, &step);
        }
        cts_parallel(p->n_threads, (size_t)p->patches.n_swaths, 1, splat_swaths, &step);
        p->stopped = cts_scene_stopped(p->scene);
        if (!p->stopped)
            cts_parallel(p->n_threads, (size_t)(p->raster.height + CTS_ZONE_HEIGHT - 1) / CTS_ZONE_HEIGHT, 0,
                         composite_zones, &step);
        p->store.sheet[s % p->n_sheets].step = s;
    }
}

static void load_swath_chunks(CtsPaperPlan *p, Worker *w, int s)
{
    int first, past;
    cts_paper_voxel_rows(p, w->swath, &first, &past);
    for (int step = s - 1; step <= s + 1; step++) {
        const int chunk = chunk_missing(p, w->store, step), n_rows = p->patches.n[1];
        if (chunk < 0)
            continue;
        for (int r = w->swath * CTS_SWATH; r < (w->swath + 1) * CTS_SWATH && r < n_rows && loads_partly(p); r++)
            cts_paper_find_wanted(p, w->store, chunk, r);
        for (int v = first; v < past; v++)
            load_row(p, w, chunk, v);
        cts_stack_set_loaded(&w->store->stack, chunk);
    }
}

static void step_swath(CtsPaperPlan *p, Worker *w, int s)
{
    const double start_ms = cts_wall_ms(), shade_ms = w->busy_ms[CTS_STAGE_SHADE];
    int first, past;
    load_swath_chunks(p, w, s);
    cts_paper_voxel_rows(p, w->swath, &first, &past);
    for (int v = first; v < past && p->tolerance > 0; v++)
        settle_row(p, w->store, s, v);
    if (!cts_paper_step_needed(p, s))
        return;
    if (p->skip_void && s >= w->open_until) {
        w->open_until = s + CTS_PAPER_OPEN_STEPS;
        cts_paper_find_open(p, s, w->swath);
    }
    const bool needed = splat_swath(p, w, s, w->swath);
    const double splat_ms = cts_wall_ms();
    w->busy_ms[CTS_STAGE_SPLAT] += splat_ms - start_ms - (w->busy_ms[CTS_STAGE_SHADE] - shade_ms);
    int y0, y1;
    cts_paper_picture_rows(p, w->swath, &y0, &y1);
    if (needed)
        composite_step(p, w, s, y0, y1);
    w->busy_ms[CTS_STAGE_COMPOSITE] += cts_wall_ms() - splat_ms;
    w->store->sheet[s % p->n_sheets].step = s;
}

/* Between blends a pixel's fourth value is transmittance: 1 at first, alpha at last. */
static void flip_alpha(CtsPicture *picture, int y0, int y1)
{
    const size_t width = (size_t)picture->width;
    for (size_t i = (size_t)y0 * width; i < (size_t)y1 * width; i++)
        picture->pixels[4 * i + 3] = 1 - picture->pixels[4 * i + 3];
}

/* One thread takes a swath through all layers. */
static void run_swath(CtsPaperPlan *p, Worker *w, int swath)
{
    int first, past, y0, y1;
    w->swath = swath;
    w->open_until = 0;
    cts_paper_voxel_rows(p, swath, &first, &past);
    cts_stack_begin(&w->store->stack, first);
    cts_paper_picture_rows(p, swath, &y0, &y1);
    flip_alpha(p->picture, y0, y1);
    for (int i = 0; i < p->n_sheets; i++)
        w->store->sheet[i].step = -1;
    for (int s = 0; s < p->stack.n_layers - CTS_MUTATED(LAST_LAYER) && !w->stopped; s++) {
        w->stopped = cts_scene_stopped(p->scene);
        if (!w->stopped && (cts_paper_step_needed(p, s) || p->tolerance > 0))
            step_swath(p, w, s);
    }
    flip_alpha(p->picture, y0, y1);
}

static void flip_rows(void *context, int worker, size_t first, size_t end)
{
    (void)worker;
    flip_alpha(context, (int)first, (int)end);
}

static void run_swaths(void *context, int worker, size_t first, size_t end)
{
    const Step *const step = context;
    for (size_t swath = first; swath < end; swath++)
        run_swath(step->plan, &step->workers[worker], (int)swath);
}

static void run_all(CtsPaperPlan *p, Worker *workers)
{
    Step all = {.plan = p, .workers = workers};
    const size_t height = (size_t)p->picture->height;
    if (p->by_swaths) {
        cts_parallel(p->n_threads, (size_t)p->patches.n_swaths, 1, run_swaths, &all);
        return;
    }
    cts_parallel(p->n_threads, height, 0, flip_rows, p->picture);
    run_layers(p, workers);
    cts_parallel(p->n_threads, height, 0, flip_rows, p->picture);
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
    const size_t n_marks = (size_t)p->stack.n[0] / 64 + 1, n_words = (size_t)p->patches.n_words;
    CtsStatus st;
    if ((st = cts_compositor_init(&w->compositor, &p->simd, &p->patches, &p->raster, p->scene, p->picture, err)) ||
        (st = cts_alloc_array(&w->marks, n_marks, err)) || (st = cts_alloc_array(&w->changed, n_marks, err)) ||
        (st = cts_alloc_array(&w->needed, n_words * CTS_NEEDED_ROWS, err)) ||
        (p->by_swaths && (st = cts_paper_store_init(&w->own, p, err))))
        return st;
    w->store = p->by_swaths ? &w->own : &p->store;
    w->compositor.occlusion = p->skip_void && !p->scene->settings->sees_hidden ? &p->occlusion : NULL;
    for (int c = 0; c < 2; c++) {
        w->beside[c] = p->footprint.reach[c] / p->footprint.density[c];
        if (p->lit && w->beside[c] < p->shade.step[c])
            w->beside[c] = p->shade.step[c];
    }
    return cts_alloc_array(&w->row, n_words, err);
}

static void worker_free(Worker *w)
{
    cts_compositor_free(&w->compositor);
    cts_free(&w->marks);
    cts_free(&w->changed);
    cts_free(&w->needed);
    cts_free(&w->row);
    cts_paper_store_free(&w->own);
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
    run_all(p, workers);
    for (int t = 0; t < p->n_threads; t++)
        p->stopped |= workers[t].stopped;
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
