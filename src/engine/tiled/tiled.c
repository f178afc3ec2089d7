/* The tiled engine: rays through the cells between voxels, in which the field is a cubic (tiled_march.h). Empty space
 * is skipped, and a ray ends when it is opaque. ctsplat-methods(7) has the mathematics. */
#include "core/scene/engine.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "core/model/macrocells.h"
#include "core/scene/visible.h"
#include "engine/project/project.h"
#include "engine/tiled/tiled_march.h"
#include "engine/tiled/tiles.h"
#include <stdlib.h>
#include <string.h>

/* Data that depend on volume and preset only: computed for the first frame, and cached for the following ones. */
typedef struct TiledCache {
    TiledMask mask;
    int mask_frame;
    TiledAppearances appearances; /* of the scale that they were made for */
    double appearances_scale;
    CtsVisibleBlocks *visible; /* by mip and its kin */
} TiledCache;

static void free_cache(void *cache)
{
    TiledCache *const k = cache;
    if (!k)
        return;
    cts_tiled_mask_free(&k->mask);
    cts_tiled_appearances_free(&k->appearances);
    cts_visible_blocks_free(&k->visible);
    free(k);
}

/* For a volume with labels; they depend on the view only with opacity per voxel. */
static CtsStatus make_appearances(TiledCache *k, const CtsScene *scene, CtsError *err)
{
    if (!scene->model->voxel_labels || (k->appearances.transfer && k->appearances_scale == scene->extinction_scale))
        return CTS_OK;
    cts_tiled_appearances_free(&k->appearances);
    k->appearances_scale = scene->extinction_scale;
    return cts_tiled_appearances_init(&k->appearances, scene, err);
}

/* Cells of visible blocks are tested for many rays alone (CtsPlan.few_rays): one ray loses the time in which 1.5 to 5
 * blocks are tested (measured on heads and a chest). The purpose of the rays decides, not whether an earlier frame
 * tested cells: a ray's rounding depends on it, and a picture must not depend on the frames before it. */
static CtsStatus find_mask(const CtsScene *scene, TiledCache **cache, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    TiledCache *const k = *cache = cts_scene_cache(scene, sizeof *k, err);
    if (!k)
        return CTS_ERR_MEMORY;
    const bool is_made = k->mask.words;
    if ((st = make_appearances(k, scene, err)))
        return st;
    const TiledAppearances *const appearances = scene->model->voxel_labels ? &k->appearances : NULL;
    if (!is_made && (st = cts_tiled_mask_init(&k->mask, scene, appearances, err)))
        return st;
    const bool refines = !k->mask.refined && !scene->plan.few_rays;
    if (refines && (st = cts_tiled_mask_refine(&k->mask, scene, appearances, err)))
        return st;
    if (is_made && !refines) {
        if (k->mask_frame != scene->frame)
            cts_report_skip(report, "mask of what is visible", "made for an earlier frame");
        return CTS_OK;
    }
    k->mask_frame = scene->frame;
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     (uint64_t)k->mask.n[0] * (uint64_t)k->mask.n[1] * (uint64_t)k->mask.n[2], 0);
    return CTS_OK;
}

/* Tolerances of a march, as shares of the requested error. */
typedef struct Tolerances {
    double segment;                 /* of segments: errors have either sign and are far smaller than estimated, */
    double ray_end;                 /* of ray ends: truncations add up */
    double deferred;                /* weight below which segments are shaded with the next ones; */
    double normal_deviation;        /* normal deviation, weighted */
    double touch_levels;            /* precision of levels, of the first RANGE_LEVELS */
    double interpolation_tolerance; /* interpolation error up to which pixels are interpolated */
} Tolerances;
static const Tolerances for_pictures = {1.5, 1, 2.5, 0.75, 0.1, 1.5},
                        for_reference = {0.002, 0.01, 1e-6, 0.005, 1e-7, 0};
/* INTERPOLATED_FROM: below this requested error hardly any pixels can be interpolated. MISSED_SHARE: thin structures
 * may be missed, so one pixel wrong from black to white must not contribute more than an eighth of the requested error
 * to the picture's. */
static const double INTERPOLATED_FROM = 4.0 / 255, MISSED_SHARE = 1.0 / 8;

/* Rounding errors of a field grow with its levels; they were measured in a scanner's range. */
static const double RANGE_LEVELS = 4096;

static double touch_scale(const CtsVolume *v)
{
    return fmin(fmax((v->hu_max - v->hu_offset) / v->hu_step / RANGE_LEVELS, 1), 65536 / RANGE_LEVELS);
}

static bool is_preview(const CtsScene *scene)
{
    const double requested = cts_scene_requested_error(scene), pixels = (double)scene->view.width * scene->view.height;
    return requested >= INTERPOLATED_FROM && 1 / sqrt(pixels) <= MISSED_SHARE * requested &&
           !cts_scene_has_step(scene->preset, scene->volume);
}

/* requested: rms error of a picture, over 0..1. */
static void init_tiled_job(TiledJob *j, const CtsScene *scene, const TiledCache *cache, const Tolerances *may,
                           double requested)
{
    const CtsVolume *const v = scene->volume;
    *j = (TiledJob){.grey = v->grey,
                    .shown = cts_model_shown(scene->model)->volume->grey,
                    .view = scene->view,
                    .mask = cache->mask,
                    .whole_blocks = scene->plan.few_rays};
    for (int a = 0; a < 3; a++) {
        j->dims[a] = v->dims[a];
        j->step[a] = scene->view.forward_vox[a];
    }
    cts_volume_cells(v, j->n_cells, j->stride);
    cts_tiled_transfer_init(&j->transfer, scene);
    j->appearances = scene->model->voxel_labels ? &cache->appearances : NULL;
    j->max_colour_difference =
        cts_voxel_labels_coloured(scene->model->voxel_labels) ? 1 : j->transfer.max_colour_difference;
    j->tolerance = (float)(may->segment * requested);
    j->min_transmittance = (float)fmin(may->ray_end * requested, 1.0 / 16);
    j->min_shaded_weight = (float)(may->deferred * requested);
    j->shading_tolerance = (float)(may->normal_deviation * requested);
    j->grazing_tolerance = (float)(may->touch_levels * touch_scale(v));
    j->interpolation_tolerance = is_preview(scene) ? (float)(may->interpolation_tolerance * requested) : 0;
    j->camera_mm = cts_volume_diagonal_mm(v) / 2 + CTS_MUTATED(DEPTH_SLAB);
}

/* Job and lighting of a march; free shade with cts_shade_free(), also after a failure. */
static CtsStatus begin_march(TiledJob *j, CtsShade *shade, const CtsScene *scene, const TiledCache *cache,
                             const Tolerances *may, double requested, CtsError *err)
{
    init_tiled_job(j, scene, cache, may, requested);
    if (!scene->preset->shade)
        return CTS_OK;
    const CtsStatus st = cts_shade_init(shade, scene->preset, scene->volume, &scene->view, (const int[]){0, 1, 2}, err);
    if (st)
        return st;
    j->shade = shade;
    j->open = CTS_MUTATED(OPEN_UNUSED) ? NULL : scene->openness;
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++)
            j->frame[i][a] = shade->frame[i][a] * (a == 2 && CTS_MUTATED(GRADIENT_SIGN) ? -1 : 1);
    return CTS_OK;
}

/* The SIMD path of the march in single precision: plain C where offsets exceed those of vectors. */
static unsigned path_of(const TiledJob *j)
{
    const bool narrow = j->dims[0] > 1 && (double)j->dims[0] * j->dims[1] * j->dims[2] < INT32_MAX;
    return narrow ? cts_cpu_flags() : 0;
}

static void report_march_plan(const TiledJob *j, const CtsScene *scene, CtsReport *report)
{
    const CtsRenderSettings *const s = scene->settings;
    const int64_t n = (int64_t)j->mask.n[0] * j->mask.n[1] * j->mask.n[2];
    cts_report_plan(report, "engine tiled: %d x %d x %d cells; the field along a ray is a cubic in each", j->n_cells[0],
                    j->n_cells[1], j->n_cells[2]);
    cts_report_plan(report, "blocks of %d^3 cells: %lld of %lld may be visible (%.1f %%)", TILED_BLOCK,
                    (long long)j->mask.n_visible, (long long)n, 100.0 * (double)j->mask.n_visible / (double)n);
    cts_report_plan(report, "ray segments: two-point rule, split at %d control points where the error exceeds %.3g/255",
                    j->transfer.n_control_points, 255 * (double)j->tolerance);
    cts_report_plan(report, "rays end below transmittance %.3g; lighting %s; SIMD path %s; %d threads",
                    (double)j->min_transmittance, j->shade ? "on" : "off", cts_cpu_path_name(path_of(j)), s->n_threads);
    if (j->mask.n_visible == n)
        cts_report_skip(report, "void skipping", "every block may be visible");
    if (scene->plan.samples > 0)
        cts_report_skip(report, "samples", "the engine has no sheets");
    if (s->tolerance_hu > 0)
        cts_report_skip(report, "tolerance", "the engine compares no layers");
}

static void report_march_counts(const TiledCounts *c, const CtsScene *scene, const TiledMask *mask, double wall_ms,
                                double cpu_ms, CtsReport *report)
{
    double busy[CTS_N_STAGES] = {0};
    uint64_t items[CTS_N_STAGES] = {0}, bytes[CTS_N_STAGES] = {0};
    busy[CTS_STAGE_SHADE] = c->ticks > 0 ? (double)c->shade_ticks / (double)c->ticks : 0;
    busy[CTS_STAGE_COMPOSITE] = 1 - busy[CTS_STAGE_SHADE];
    items[CTS_STAGE_SHADE] = c->queues;
    items[CTS_STAGE_COMPOSITE] = c->segments;
    bytes[CTS_STAGE_COMPOSITE] = c->segments * 8 * sizeof(uint16_t); /* voxels of a cell */
    cts_report_region(report, wall_ms, cpu_ms, busy, items, bytes);
    if (report) {
        CtsVoxelCounts *v = &report->voxels;
        const double n = (double)mask->n[0] * mask->n[1] * mask->n[2];
        v->known = true;
        v->total = cts_volume_n_voxels(scene->volume);
        v->splatted = (uint64_t)((double)v->total * (double)mask->n_visible / n);
        v->void_voxels = v->total - v->splatted;
        v->reused = 0;
    }
}

static CtsStatus render_composite(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                                  CtsError *err)
{
    CtsStatus st;
    CtsShade shade = {0};
    TiledJob job;
    TiledCounts counts = {0};
    TiledCache *cache;
    if ((st = find_mask(scene, &cache, report, err)) ||
        (st = begin_march(&job, &shade, scene, cache, &for_pictures, cts_scene_requested_error(scene), err)))
        goto end;
    cts_scene_report_region(scene, report);
    report_march_plan(&job, scene, report);
    if (!picture)
        goto end;
    job.want_depth = picture->depth_mm;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if ((st =
             cts_tiled_run(&job, CTS_CPU_CHOICE(path_of(&job), cts_tiled_march), scene, picture, errors, &counts, err)))
        goto end;
    if (counts.interpolated > 0)
        cts_report_plan(report, "%llu of %llu pixels were not marched but interpolated, to within about %.3g/255",
                        (unsigned long long)counts.interpolated,
                        (unsigned long long)picture->width * (unsigned long long)picture->height,
                        255 * (double)job.interpolation_tolerance);
    report_march_counts(&counts, scene, &job.mask, cts_wall_ms() - wall, cts_cpu_ms() - cpu, report);
end:
    cts_shade_free(&shade);
    return st;
}

/* Pixels that are marched again, list by list. */
typedef struct Rerendering {
    const TiledJob *job;
    const CtsScene *scene;
    const CtsPicture *band;
    const uint32_t *place;
    float (*rgba)[4], *off;
    TiledScratch *scratch; /* of each worker */
    cts_tiled_march_fn march;
} Rerendering;

enum { AT_ONCE = 64 }; /* rays that are marched together */

static void march_some(const Rerendering *a, TiledScratch *scratch, size_t first, size_t end)
{
    TiledRays *const rays = &scratch->rays;
    const size_t width = (size_t)a->band->width;
    size_t which[AT_ONCE];
    rays->n = 0;
    for (; first < end; first++) {
        const uint32_t at = a->place[first];
        memset(a->rgba[first], 0, sizeof a->rgba[first]);
        a->off[first] = 0;
        which[rays->n] = first; /* stays only where the ray does not miss the box */
        cts_tiled_add_ray(a->job, rays, (int)(at % width), a->band->first_row + (int)(at / width), -INFINITY);
    }
    a->march(a->job, rays, &scratch->counts);
    for (int i = 0; i < rays->n; i++) {
        memcpy(a->rgba[which[i]], rays->rgba[i], sizeof rays->rgba[i]);
        a->off[which[i]] = rays->bound[i];
    }
}

static void rerender_some(void *context, int worker, size_t first, size_t end)
{
    const Rerendering *const a = context;
    for (; first < end && !cts_scene_stopped(a->scene); first += AT_ONCE)
        march_some(a, &a->scratch[worker], first, end - first < AT_ONCE ? end : first + AT_ONCE);
}

static CtsStatus render_pixels(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n,
                               double error, float (*rgba)[4], float *off, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    CtsStatus st;
    CtsShade shade = {0};
    TiledJob job;
    TiledCache *cache;
    Rerendering a = {.job = &job, .scene = scene, .band = band, .place = place, .rgba = rgba, .off = off};
    if ((st = find_mask(scene, &cache, NULL, err)) ||
        (st = begin_march(&job, &shade, scene, cache, error > 0 ? &for_pictures : &for_reference,
                          error > 0 ? error : cts_scene_requested_error(scene), err)))
        goto end;
    a.march = error > 0 ? CTS_CPU_CHOICE(path_of(&job), cts_tiled_march)
                        : CTS_CPU_CHOICE(cts_cpu_flags(), cts_tiled_march_double);
    if ((st = cts_alloc_zeroed(&a.scratch, (size_t)n_threads, err)))
        goto end;
    cts_parallel(n_threads, n, AT_ONCE, rerender_some, &a);
    st = cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
end:
    cts_free(&a.scratch);
    cts_shade_free(&shade);
    return st;
}

static CtsStatus render_tiled(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                              CtsError *err)
{
    if (scene->preset->mode == CTS_MODE_COMPOSITE)
        return render_composite(scene, picture, errors, report, err);
    TiledCache *const cache = cts_scene_cache(scene, sizeof *cache, err);
    return cache ? cts_project(scene, &cache->visible, picture, report, err) : CTS_ERR_MEMORY;
}

const CtsEngine cts_engine_tiled = {
    .name = "tiled",
    .render = render_tiled,
    .render_pixels = render_pixels,
    .indicator = CTS_INDICATOR_BOUND,
    .skips_void = true,
    .supports_slabs = true,
    .supports_labels = true,
    .modes = (1u << CTS_N_MODES) - 1,
    .kernels = 1u << CTS_KERNEL_TENT,
    .free_cache = free_cache,
};
