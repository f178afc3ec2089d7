/* The paper's engines: sheets of exact integers, layer by layer, with its two savings switched on or off. */
#include "base/bits.h"
#include "base/clock.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/splat/swath.h"
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

typedef struct PaperWorker {
    CtsCompositor compositor;
    CtsSwathWork work;
    CtsPaperStore own; /* by swaths */
    double busy_ms[CTS_N_STAGES];
} PaperWorker;

struct LayerWalk;
/* The work of a step for one swath. */
typedef void Part(struct LayerWalk *walk, PaperWorker *w, int swath);

/* A walk through the layers: of all swaths by all threads, or of one by one. */
typedef struct LayerWalk {
    CtsPaperPlan *plan;
    PaperWorker *workers;
    int worker, swath;   /* by swaths */
    int s;               /* the step */
    int open_until;      /* the step up to which open patches hold */
    _Atomic bool needed; /* any work in the step */
    Part *part;
    CtsStage stage; /* the stage that the part counts for */
} LayerWalk;

/* The first and the last plane represent half a length of ray. */
static bool is_end_plane(const CtsPaperPlan *p, int s, int sub)
{
    const int last = p->stack.n_layers - 1;
    return (sub == 0 && s == 1) || (sub == p->samples && (s == 0 || s == last));
}

static void composite_plane(const CtsPaperPlan *p, PaperWorker *w, int s, int sub, int y0, int y1)
{
    /* Sub-plane 0 is the layer before; sub-plane `samples` (the only one where there is one) is this layer. */
    const int front = sub < p->samples ? s - 1 : s;
    const int slot = front % p->n_sheets, behind = s % p->n_sheets;
    const double part = sub < p->samples ? (double)sub / p->samples : 0;
    const double layer = cts_paper_layer(p, front) + p->scene->view.axis_sign * part;
    const CtsLight light = {
        .shade = &p->shade,
        .first = (const float(*)[4])w->work.store->gradient[slot],
        .second = part > 0 ? (const float(*)[4])w->work.store->gradient[behind] : NULL,
        .stride = (size_t)p->stack.n[0],
        .weight = (float)part,
        .shift = {__builtin_ctz((unsigned)p->patches.density[0]), __builtin_ctz((unsigned)p->patches.density[1])},
        .open = p->scene->openness,
        .axis = {p->stack.u_axis, p->stack.v_axis, p->stack.axis},
        .layer = layer};
    const CtsPlane plane = {.layer = layer,
                            .sheets = {.first = w->work.store->sheet[slot].origin,
                                       .second = part > 0 ? w->work.store->sheet[behind].origin : NULL,
                                       .stride = w->work.store->sheet[slot].stride,
                                       .weight = (float)part,
                                       .top = p->entries[0].top},
                            .entries = &p->entries[is_end_plane(p, s, sub) && !CTS_MUTATED(END_PLANES)],
                            .light = p->lit ? &light : NULL,
                            .shown = p->shown};
    cts_composite_rows(&w->compositor, &plane, y0, y1);
}

/* The planes that can be sampled once step s has its sheet, front to back, in rows y0 to y1 - 1 of the picture. */
static void composite_step(const CtsPaperPlan *p, PaperWorker *w, int s, int y0, int y1)
{
    /* This layer itself, unless it will be sub-plane 0 of the next step. */
    const int past = p->samples + (p->samples == 1 || s == p->stack.n_layers - 1);
    for (int sub = p->samples == 1 || s == 0 ? p->samples : 0; sub < past; sub++)
        composite_plane(p, w, s, sub, y0, y1);
}

/* The rows of voxels that a swath's part settles: its own, and with one thread per swath those beside that it reads. */
static void voxel_rows(const CtsPaperPlan *p, int swath, int *first, int *past)
{
    const int beside = p->by_swaths ? CTS_PATCH : 0, low = cts_swath_start(&p->patches, swath, 1) - beside,
              high = cts_swath_start(&p->patches, swath + 1, 1) + beside + p->by_swaths;
    *first = low > 0 ? low : 0;
    *past = high < p->stack.n[1] ? high : p->stack.n[1];
}

/* The rows of the picture that are composited with a swath: by swaths those whose rays meet it, else a share. */
static void picture_rows(const CtsPaperPlan *p, int swath, int *y0, int *y1)
{
    const int64_t height = p->raster.height, n = p->patches.n_swaths;
    *y0 = (int)(swath * height / n);
    *y1 = (int)((swath + 1) * height / n);
    if (p->by_swaths)
        cts_paper_picture_rows(p, swath, y0, y1);
}

/* The dead band of a tolerance: voxels that changed too little since the step before keep the value that was splatted,
 * which so stays within the tolerance. */
static void settle(LayerWalk *walk, PaperWorker *w, int swath)
{
    const CtsPaperPlan *p = walk->plan;
    const CtsPaperStore *store = w->work.store;
    const int s = walk->s;
    int first, past;
    voxel_rows(p, swath, &first, &past);
    for (int v = first; v < past; v++) {
        const size_t at = (size_t)v * (size_t)p->stack.n[0];
        const uint16_t *const fresh = cts_stack_row(&p->stack, cts_paper_layer(p, s), v);
        const uint16_t *const before = s > 0 ? store->settled[(s + 2) % 3] + at : NULL;
        uint16_t *const kept = store->settled[s % 3] + at;
        for (int i = 0; i < p->stack.n[0]; i++)
            kept[i] = before && abs(fresh[i] - before[i]) <= p->tolerance - CTS_MUTATED(TOLERANCE_LESS) ? before[i]
                                                                                                        : fresh[i];
    }
}

static void find_open(LayerWalk *walk, PaperWorker *w, int swath)
{
    const CtsPaperPlan *const p = walk->plan;
    /* The planes of these steps, of the one before and of the one behind. */
    const double half = 0.5 * (CTS_PAPER_OPEN_STEPS - 1);
    CtsOcclusionQuery query = {.layer = cts_paper_layer(p, walk->s) + p->scene->view.axis_sign * half,
                               .spread = half + 1};
    (void)w;
    cts_paper_picture_rows(p, swath, &query.y0, &query.y1);
    cts_culling_open_row(&p->culling, &p->raster, &p->patches, &query, swath,
                         p->open + (size_t)swath * (size_t)p->patches.n_words);
}

static void splat(LayerWalk *walk, PaperWorker *w, int swath)
{
    if (cts_swath_splat(walk->plan, &w->work, walk->s, swath))
        walk->needed = true;
}

static void shade(LayerWalk *walk, PaperWorker *w, int swath)
{
    cts_swath_gradients(walk->plan, &w->work, walk->s, swath);
}

static void composite(LayerWalk *walk, PaperWorker *w, int swath)
{
    int y0, y1;
    picture_rows(walk->plan, swath, &y0, &y1);
    composite_step(walk->plan, w, walk->s, y0, y1);
}

/* Between blends a pixel's fourth value is transmittance: 1 at first, alpha at last. */
static void flip_alpha(LayerWalk *walk, PaperWorker *w, int swath)
{
    CtsPicture *picture = walk->plan->picture;
    const size_t width = (size_t)picture->width;
    int y0, y1;
    (void)w;
    picture_rows(walk->plan, swath, &y0, &y1);
    for (size_t i = (size_t)y0 * width; i < (size_t)y1 * width; i++)
        picture->pixels[4 * i + 3] = 1 - picture->pixels[4 * i + 3];
}

static void do_part(void *context, int worker, size_t first, size_t end)
{
    LayerWalk *const walk = context;
    const double start_ms = cts_wall_ms();
    for (size_t swath = first; swath < end; swath++)
        walk->part(walk, &walk->workers[worker], (int)swath);
    walk->workers[worker].busy_ms[walk->stage] += cts_wall_ms() - start_ms;
}

static void each(LayerWalk *walk, CtsStage stage, Part *part)
{
    walk->part = part;
    walk->stage = stage;
    if (walk->plan->by_swaths)
        do_part(walk, walk->worker, (size_t)walk->swath, (size_t)walk->swath + 1);
    else
        cts_parallel(walk->plan->n_threads, (size_t)walk->plan->patches.n_swaths, 1, do_part, walk);
}

static void take_step(LayerWalk *walk)
{
    const CtsPaperPlan *const p = walk->plan;
    const bool needed = cts_paper_step_needed(p, walk->s);
    /* The dead band compares with the layer before, so it must see every layer, needed or not. */
    if (!needed && p->tolerance == 0)
        return;
    if (p->tolerance > 0)
        each(walk, CTS_STAGE_SPLAT, settle);
    if (!needed)
        return;
    if (p->skip_void && walk->s >= walk->open_until) {
        walk->open_until = walk->s + CTS_PAPER_OPEN_STEPS;
        each(walk, CTS_STAGE_SPLAT, find_open);
    }
    walk->needed = false;
    each(walk, CTS_STAGE_SPLAT, splat);
    if (walk->needed && p->lit)
        each(walk, CTS_STAGE_SHADE, shade);
    if (walk->needed)
        each(walk, CTS_STAGE_COMPOSITE, composite);
}

static void take_steps(LayerWalk *walk)
{
    CtsPaperPlan *const p = walk->plan;
    each(walk, CTS_STAGE_COMPOSITE, flip_alpha);
    for (; walk->s < p->stack.n_layers - CTS_MUTATED(LAST_LAYER) && !cts_scene_stopped(p->scene); walk->s++)
        take_step(walk);
    each(walk, CTS_STAGE_COMPOSITE, flip_alpha);
}

static void take_swaths(void *context, int worker, size_t first, size_t end)
{
    const LayerWalk *const all = context;
    for (size_t swath = first; swath < end; swath++) {
        LayerWalk walk = {.plan = all->plan, .workers = all->workers, .worker = worker, .swath = (int)swath};
        take_steps(&walk);
    }
}

static void report_run(const CtsPaperPlan *p, const PaperWorker *workers, double wall_ms, double cpu_ms,
                       CtsReport *report)
{
    double busy[CTS_N_STAGES] = {0};
    uint64_t items[CTS_N_STAGES] = {0}, splatted = 0, reused = 0, samples = 0;
    for (int t = 0; t < p->n_threads; t++) {
        for (int stage = 0; stage < CTS_N_STAGES; stage++)
            busy[stage] += workers[t].busy_ms[stage];
        splatted += workers[t].work.splatted;
        reused += workers[t].work.reused;
        samples += workers[t].compositor.samples;
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

static CtsStatus worker_init(PaperWorker *w, CtsPaperPlan *p, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_compositor_init(&w->compositor, p->simd, &p->patches, &p->raster, p->scene, p->picture, err)) ||
        (p->by_swaths && (st = cts_paper_store_init(&w->own, p, err))))
        return st;
    w->work.store = p->by_swaths ? &w->own : &p->store;
    w->compositor.culling = p->skip_void && !p->scene->settings->no_occlusion_culling ? &p->culling : NULL;
    return cts_swath_work_init(&w->work, p, err);
}

static void paper_worker_free(PaperWorker *w)
{
    cts_compositor_free(&w->compositor);
    cts_free(&w->work.marks);
    cts_paper_store_free(&w->own);
}

static CtsStatus run_plan(CtsPaperPlan *p, CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsStatus st = CTS_OK;
    LayerWalk walk = {.plan = p, .workers = calloc((size_t)p->n_threads, sizeof *walk.workers)};
    if (!walk.workers)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int t = 0; t < p->n_threads && !st; t++)
        st = worker_init(&walk.workers[t], p, err);
    if (!st && p->by_swaths)
        cts_parallel(p->n_threads, (size_t)p->patches.n_swaths, 1, take_swaths, &walk);
    else if (!st)
        take_steps(&walk);
    if (!st)
        report_run(p, walk.workers, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, report);
    if (!st && cts_scene_stopped(p->scene))
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    for (int t = 0; t < p->n_threads; t++)
        paper_worker_free(&walk.workers[t]);
    free(walk.workers);
    return st;
}

static CtsStatus render(const CtsScene *scene, bool reuse_layers, bool skip_void, CtsPicture *picture,
                        CtsReport *report, CtsError *err)
{
    CtsPaperPlan plan;
    CtsStatus st = cts_paper_plan_init(&plan, scene, reuse_layers, skip_void, picture, report, err);
    if (!st && picture)
        st = run_plan(&plan, report, err);
    cts_paper_plan_free(&plan);
    return st;
}

enum { COMPOSITE = 1u << CTS_MODE_COMPOSITE, EVERY_KERNEL = (1u << CTS_N_KERNELS) - 1 };

#define ENGINE(id, reuse_layers, without_void)                                                                         \
    static CtsStatus render_##id(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,   \
                                 CtsError *err)                                                                        \
    {                                                                                                                  \
        (void)errors;                                                                                                  \
        return render(scene, reuse_layers, without_void, picture, report, err);                                        \
    }                                                                                                                  \
    const CtsEngine cts_engine_##id = {                                                                                \
        .name = #id,                                                                                                   \
        .render = render_##id,                                                                                         \
        .modes = COMPOSITE,                                                                                            \
        .kernels = EVERY_KERNEL,                                                                                       \
        .is_layered = true,                                                                                            \
        .skips_void = without_void,                                                                                    \
        .uses_void_key = without_void,                                                                                 \
    };

ENGINE(classic, false, false)
ENGINE(layers, true, false)
ENGINE(void, false, true)
ENGINE(combined, true, true)
