#include "engine/sheets/lattice.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "core/model/transposed.h"
#include <math.h>
#include <stdlib.h>

/* Data that depend on volume and preset only: computed for the first frame that needs them, and cached. */
typedef struct SheetsCache {
    SheetsTransfer transfer;
    SheetsOpacity opacity[3];               /* of half a slab, a slab, two slabs */
    SheetsVoid blocks[3];                   /* by principal axis */
    int blocks_frame[3];                    /* frame that they were made for */
    SheetsPatch lattices[SHEETS_GRIDS - 1]; /* of a rotation, for the next frame */
} SheetsCache;

static void free_cache(void *cache)
{
    SheetsCache *const k = cache;
    if (!k)
        return;
    cts_sheets_transfer_free(&k->transfer);
    for (int i = 0; i < 3; i++) {
        cts_free(&k->opacity[i].rgba);
        cts_free(&k->opacity[i].light);
        cts_free(&k->opacity[i].near);
        cts_free(&k->blocks[i].bits);
    }
    for (int i = 0; i < SHEETS_GRIDS - 1; i++)
        cts_sheets_lattice_free(&k->lattices[i]);
    free(k);
}

/* Number of the finest table that a level takes: of half a slab or of a slab. */
static int finest_of(CtsEngineLevel level)
{
    return level >= CTS_LEVEL_HALF_SHEETS ? 0 : 1;
}

/* True where the errors of slabs are estimated: at level lattice they say little beside those of interpolation, and in
 * straight views there are none by the field between two sheets. */
static bool has_slab_errors(CtsEngineLevel level, const SheetsView *view)
{
    return level != CTS_LEVEL_LATTICE && !view->straight;
}

/* The coarser table and near misses are what the errors of slabs are estimated by. */
static CtsStatus find_tables(SheetsCache *k, const CtsScene *scene, CtsEngineLevel level, const SheetsView *view,
                             const SheetsKernels *kernels, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const int finest = finest_of(level), n = has_slab_errors(level, view) ? 2 : 1;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if (k->transfer.part && k->transfer.extinction_scale != scene->extinction_scale)
        cts_sheets_transfer_free(&k->transfer);
    if (!k->transfer.part &&
        (st = cts_sheets_transfer_init(&k->transfer, scene, scene->model->macrocells->all.high, err)))
        return st;
    for (int i = finest; i < finest + n; i++)
        if ((st = cts_sheets_opacity_find(&k->opacity[i], &k->transfer, scene->view.layer_mm * ldexp(1, i - 1),
                                          i == finest && n > 1, i == finest && scene->preset->shade, kernels,
                                          scene->settings->n_threads, err)))
            return st;
    cts_report_stage(report, CTS_STAGE_FOOTPRINT, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     (uint64_t)n * SHEETS_BINS * SHEETS_BINS, 0);
    return CTS_OK;
}

/* The blocks of 4^3 cells that may be visible, across axis p. */
static CtsStatus void_init(SheetsVoid *v, const CtsMacrocells *m, const CtsLut *lut, int p, CtsError *err)
{
    const int a = p == 0, b = p == 2 ? 1 : 2;
    const size_t stride[3] = {1, (size_t)m->n_fine[0], (size_t)m->n_fine[0] * (size_t)m->n_fine[1]};
    CtsStatus st;
    *v = (SheetsVoid){.n = {m->n_fine[a], m->n_fine[b]},
                      .n_layers = m->n_fine[p],
                      .row_words = (m->n_fine[a] + SHEETS_WORD_STEP - 1) / SHEETS_WORD_STEP};
    const size_t rows = (size_t)v->n[1] * (size_t)v->n_layers;
    if ((st = cts_alloc_zeroed(&v->bits, rows * (size_t)v->row_words, err)))
        return st;
    for (size_t layer = 0; layer < (size_t)v->n_layers; layer++)
        for (size_t j = 0; j < (size_t)v->n[1]; j++) {
            uint32_t *const row = v->bits + (layer * (size_t)v->n[1] + j) * (size_t)v->row_words;
            for (size_t i = 0; i < (size_t)v->n[0]; i++) {
                const CtsRange r = m->fine[layer * stride[p] + j * stride[b] + i * stride[a]];
                const size_t word = i / SHEETS_WORD_STEP, bit = i % SHEETS_WORD_STEP;
                if (!cts_lut_visible(lut, r.low, r.high))
                    continue;
                v->n_visible++;
                row[word] |= UINT32_C(1) << bit;
                if (word > 0)
                    row[word - 1] |= UINT32_C(1) << (bit + SHEETS_WORD_STEP);
            }
        }
    return CTS_OK;
}

/* *grey: voxels as the view needs them. */
static CtsStatus find_blocks(SheetsCache *k, const CtsScene *scene, const uint16_t **grey, CtsReport *report,
                             CtsError *err)
{
    const int p = scene->view.axis;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    CtsStatus st = CTS_OK;
    if (!k->blocks[p].bits) {
        st = void_init(&k->blocks[p], scene->model->macrocells, scene->lut, p, err);
        k->blocks_frame[p] = scene->frame;
    } else if (k->blocks_frame[p] != scene->frame) {
        cts_report_skip(report, "blocks that may be visible", "made for an earlier frame");
    }
    *grey = scene->volume->grey;
    if (!st && p == 0)
        st = cts_model_transposed(scene->model, scene->settings->n_threads, grey, err);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, 0, 0);
    return st;
}

/* MIN_TRANSMITTANCE: a ray ends when less of its light is left than a step of eight bits; the rest counts as what it
 * has met. MIN_SHADED: the same for the weight from which a part of a slab is lit by itself; with half-sheets a step of
 * ten bits, since rays pass so many of them. */
#define MIN_TRANSMITTANCE (1.0 / 256)
#define MIN_SHADED (1.0 / 256)
#define MIN_SHADED_HALF (1.0 / 1024)

/* The same at lattice and sheets: half of the requested error between 2/255 and 8/255, which adds 0.1 to 0.6 of 255 to
 * a picture's error. Half-sheets keep the fixed values; they are there for small errors. */
static double at_least(double least, const CtsScene *scene)
{
    return fmax(least, fmin(cts_scene_requested_error(scene) / 2, 1.0 / 64));
}

static void init_job(SheetsJob *j, const CtsScene *scene, const SheetsCache *k, const SheetsKernels *kernels,
                     const SheetsView *view, CtsEngineLevel level, const CtsShade *shade)
{
    const SheetsOpacity *const finest = &k->opacity[finest_of(level)];
    const bool half = level >= CTS_LEVEL_HALF_SHEETS;
    *j = (SheetsJob){.scene = scene,
                     .kernels = kernels,
                     .view = *view,
                     .bins = k->transfer.bins,
                     .opacity = {k->opacity[0].rgba, k->opacity[1].rgba, k->opacity[2].rgba},
                     .light = finest->light,
                     .near = has_slab_errors(level, view) ? finest->near : NULL,
                     .part = k->transfer.part,
                     .all_depths = scene->view.near_mm == -INFINITY && scene->view.far_mm == INFINITY,
                     .blocks = &k->blocks[scene->view.axis],
                     .half = half,
                     .n_lattices = level != CTS_LEVEL_LATTICE   ? 0
                                   : scene->plan.coarse_lattice ? 2
                                                                : 1,
                     .min_transmittance = (float)(half ? MIN_TRANSMITTANCE : at_least(MIN_TRANSMITTANCE, scene)),
                     .min_shaded_weight = (float)(half ? MIN_SHADED_HALF : at_least(MIN_SHADED, scene)),
                     .shade = shade,
                     .open = shade ? scene->openness : NULL,
                     .camera_mm = cts_volume_diagonal_mm(scene->volume) / 2};
    for (int i = 0; i < SHEETS_GRIDS; i++)
        cts_sheets_grid_init(&j->grid[i], &j->view, 1 << i);
}

static CtsStatus refuse(const CtsScene *scene, CtsError *err)
{
    const CtsVolume *const v = scene->volume;
    for (int a = 0; a < 3; a++)
        if (v->dims[a] < 2)
            return cts_fail(err, CTS_ERR_USAGE,
                            "a volume of %d x %d x %d voxels: engine sheets needs two each way (engine "
                            "tiled does not)",
                            v->dims[0], v->dims[1], v->dims[2]);
    /* Offsets of a window's voxels are 32 bits. */
    if (cts_volume_n_voxels(v) > INT32_MAX)
        return cts_fail(err, CTS_ERR_USAGE,
                        "a volume of %d x %d x %d voxels is too large for engine sheets (engine tiled "
                        "takes it; or crop it)",
                        v->dims[0], v->dims[1], v->dims[2]);
    if (cts_scene_voxels_per_pixel(scene) > CTS_SCENE_COARSEST_PIXEL)
        return cts_fail(err, CTS_ERR_USAGE,
                        "pixels of %g mm, %g voxels, are too coarse for engine sheets (engine tiled takes them)",
                        scene->view.mm_per_pixel, cts_scene_voxels_per_pixel(scene));
    return CTS_OK;
}

/* Everything that a picture's threads need. */
typedef struct Session {
    SheetsCache *cache;
    CtsShade shade;
    SheetsJob job;
    CtsEngineLevel level;
} Session;

static CtsStatus begin(Session *s, const CtsScene *scene, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const uint16_t *grey;
    SheetsView view;
    const SheetsKernels *const kernels = CTS_CPU_CHOICE(cts_cpu_flags(), &cts_sheets);
    *s = (Session){.level = scene->plan.level ? scene->plan.level : CTS_LEVEL_HALF_SHEETS};
    if ((st = refuse(scene, err)))
        return st;
    if (!(s->cache = cts_scene_cache(scene, sizeof *s->cache, err)))
        return CTS_ERR_MEMORY;
    if ((st = find_blocks(s->cache, scene, &grey, report, err)))
        return st;
    cts_sheets_view_init(&view, &scene->view, grey);
    if ((st = find_tables(s->cache, scene, s->level, &view, kernels, report, err)))
        return st;
    const int p = scene->view.axis, axes[3] = {p == 0 ? 1 : 0, p == 2 ? 1 : 2, p};
    if (scene->preset->shade && (st = cts_shade_init(&s->shade, scene->preset, scene->volume, &scene->view, axes, err)))
        return st;
    init_job(&s->job, scene, s->cache, kernels, &view, s->level, scene->preset->shade ? &s->shade : NULL);
    return CTS_OK;
}

static void plan(const Session *s, const CtsScene *scene, CtsReport *report)
{
    const SheetsJob *const j = &s->job;
    cts_report_plan(report, "engine sheets, level %s%s: %d sheets across axis %d, groups of %d x %d pixels",
                    cts_engine_level_names[s->level], j->n_lattices > 1 ? " of every fourth pixel" : "", j->view.n[2],
                    j->view.p, SHEETS_SIDE, SHEETS_SIDE);
    cts_report_plan(report, "footprint: tent, windows of %d x %d voxels; slabs of %.3g mm by a table of %d x %d bins",
                    j->grid[0].reach[0], j->grid[0].reach[1], j->view.slab_mm / (j->half ? 2 : 1), SHEETS_BINS,
                    SHEETS_BINS);
    cts_report_plan(report, "rays end below transmittance %.3g; lighting %s; SIMD path %s; %d threads",
                    (double)j->min_transmittance, j->shade ? "on" : "off", cts_cpu_path_name(cts_cpu_flags()),
                    scene->settings->n_threads);
    if (j->view.straight)
        cts_report_skip(report, "errors between sheets", "rays follow axis %d, so that the field is linear there",
                        j->view.p);
}

static void report_counts(const SheetsCounts *c, const SheetsVoid *blocks, const CtsScene *scene, double wall_ms,
                          double cpu_ms, CtsReport *report)
{
    cts_report_plan(report, "%llu groups met %llu sheets and %llu visible slabs (%llu shaded); %llu of %llu tiles void",
                    (unsigned long long)c->groups, (unsigned long long)c->sheets, (unsigned long long)c->slabs,
                    (unsigned long long)c->lit, (unsigned long long)c->void_tiles, (unsigned long long)c->tiles);
    cts_report_stage(report, CTS_STAGE_SPLAT, wall_ms, cpu_ms, c->sheets, c->sheets * SHEETS_LANES * 8);
    if (report) {
        const double share = (double)blocks->n_visible / ((double)blocks->n[0] * blocks->n[1] * blocks->n_layers);
        CtsVoxelCounts *const v = &report->voxels;
        v->known = true;
        v->total = cts_volume_n_voxels(scene->volume);
        v->splatted = (uint64_t)((double)v->total * share);
        v->void_voxels = v->total - v->splatted;
    }
}

static CtsStatus render_sheets(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                               CtsError *err)
{
    Session s;
    SheetsCounts counts = {0};
    float *own_indicator = NULL;
    CtsStatus st = begin(&s, scene, report, err);
    if (!st) {
        cts_scene_report_region(scene, report);
        plan(&s, scene, report);
    }
    if (st || !picture)
        goto end;
    s.job.want_depth = picture->depth_mm;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if (!errors && (st = cts_alloc_array(&own_indicator, (size_t)picture->width * (size_t)picture->height, err)))
        goto end;
    if (!(st = cts_sheets_run(&s.job, picture, errors ? errors->indicator : own_indicator, s.cache->lattices, &counts,
                              err)))
        report_counts(&counts, s.job.blocks, scene, cts_wall_ms() - wall, cts_cpu_ms() - cpu, report);
end:
    cts_free(&own_indicator);
    cts_shade_free(&s.shade);
    for (int i = 0; i < SHEETS_GRIDS - 1 && s.cache && scene->settings->rotation_frames <= 1; i++)
        cts_sheets_lattice_free(&s.cache->lattices[i]);
    return st;
}

static CtsStatus render_tiles(const CtsScene *scene, const int (*corner)[2], size_t n, float (*rgba)[4],
                              float *indicator, CtsError *err)
{
    Session s;
    CtsStatus st = begin(&s, scene, NULL, err);
    if (!st)
        st = cts_sheets_probe(&s.job, corner, n, rgba, indicator, err);
    cts_shade_free(&s.shade);
    return st;
}

const CtsEngine cts_engine_sheets = {
    .name = "sheets",
    .render = render_sheets,
    .render_tiles = render_tiles,
    .indicator = CTS_INDICATOR_ESTIMATE,
    .levels = 1u << CTS_LEVEL_LATTICE | 1u << CTS_LEVEL_SHEETS | 1u << CTS_LEVEL_HALF_SHEETS | 1u << CTS_LEVEL_HYBRID,
    .sets_all = true,
    .skips_void = true,
    .supports_slabs = true,
    .modes = 1u << CTS_MODE_COMPOSITE,
    .kernels = 1u << CTS_KERNEL_TENT,
    .free_cache = free_cache,
};
