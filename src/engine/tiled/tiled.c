/* The tiled engine: the paper's idea taken to its limit. Sheets are sampled only where the final pixels' rays cross
 * them (so no warp), macro-cells that cannot be seen are skipped, the slab between two sheets is integrated exactly,
 * and a packet of pixels ends when it is opaque. ctsplat-methods(7) has the mathematics. */
#include "core/scene/engine.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/tiled/kept.h"
#include "engine/tiled/lattice.h"
#include "engine/tiled/march_plan.h"
#include "engine/project/project.h"
#include "engine/tiled/tile.h"
#include <math.h>

/* at[0] + at[1] x + at[2] y + at[3] q is the coordinate along `axis` at which the ray of pixel (x, y) meets layer q;
 * for axis -1 its distance from the camera plane in mm. */
static void plane_map(const CtsView *view, int axis, double camera_mm, double at[4])
{
    double start[3], right[3], down[3];
    const int k = view->axis;
    cts_view_ray(view, 0, 0, start);
    for (int a = 0; a < 3; a++) {
        right[a] = view->right_vox[a] * view->mm_per_pixel;
        down[a] = -view->up_vox[a] * view->mm_per_pixel;
    }
    const double slope = (axis < 0 ? 1 : view->forward_vox[axis]) / view->forward_vox[k]; /* for each rising layer */
    const double first = view->axis_sign > 0 ? 0 : view->dims[k] - 1;
    at[0] = (axis < 0 ? camera_mm : start[axis]) + slope * (first - start[k]);
    at[1] = (axis < 0 ? 0 : right[axis]) - slope * right[k];
    at[2] = (axis < 0 ? 0 : down[axis]) - slope * down[k];
    at[3] = slope * view->axis_sign + 0.0;
}

/* Layer q lies mm[0] + mm[1] x + mm[2] y + mm[3] q behind the plane through the view's centre; x and y follow from
 * where the ray meets layer 0. */
static void slab_map(const TiledJob *j, const double mm[4], double face_mm, double at[3])
{
    at[0] = face_mm;
    at[1] = at[2] = 0;
    if (!isfinite(face_mm))
        return;
    const double area = j->u_at[1] * j->v_at[2] - j->u_at[2] * j->v_at[1];
    const double by_u = (mm[1] * j->v_at[2] - mm[2] * j->v_at[1]) / area;
    const double by_v = (mm[2] * j->u_at[1] - mm[1] * j->u_at[2]) / area;
    at[0] = (face_mm - mm[0] + by_u * j->u_at[0] + by_v * j->v_at[0]) / mm[3];
    at[1] = -by_u / mm[3];
    at[2] = -by_v / mm[3];
}

/* A packet's pixels and sheets as exact steps of 2^-16 and 2^-32 voxels. */
static void init_steps(TiledJob *j)
{
    j->u_step = (int64_t)floor(j->u_at[3] / j->samples * 4294967296.0 + 0.5);
    j->v_step = (int64_t)floor(j->v_at[3] / j->samples * 4294967296.0 + 0.5);
    enum { LAYERS_AHEAD = 5 };
    j->fetch_ahead = LAYERS_AHEAD * j->layer_stride + (ptrdiff_t)floor(LAYERS_AHEAD * j->v_at[3]) * j->row_stride +
                     (ptrdiff_t)floor(LAYERS_AHEAD * j->u_at[3]);
    for (int l = 0; l < CTS_PACKET && (j->windowed || j->gathers); l++) {
        j->lane_u[l] = (int32_t)floor(l * j->u_at[1] * 65536 + 0.5);
        j->lane_v[l] = (int32_t)floor(l * j->v_at[1] * 65536 + 0.5);
    }
    for (int l = 0; l < CTS_PACKET; l++) {
        const int a = l / 4 * 4, b = a + 3; /* lanes are monotone, so a half's smallest is at one of its ends */
        j->half_u[l] = j->lane_u[a] < j->lane_u[b] ? j->lane_u[a] : j->lane_u[b];
        j->half_v[l] = j->lane_v[a] < j->lane_v[b] ? j->lane_v[a] : j->lane_v[b];
    }
}

/* Which packets fit which windows. */
enum { TILE_PIXELS = 64 };

static void init_windows(TiledJob *j, const CtsLayout *layout)
{
    const double u = fabs(j->u_at[1]), v = fabs(j->v_at[1]);
    j->window_u = layout->alloc_u - CTS_LAYOUT_MIN_U;
    j->window_v = layout->alloc_v - CTS_LAYOUT_MIN_V;
    /* Positions of 2^-16 voxels must fit 32 bits, a tile's overhang included. */
    const bool small = layout->nu < 30000 && layout->nv < 30000;
    j->windowed = small && 3 * u <= 6 && 3 * v <= 1;
    j->gathers = !j->windowed && small && TILE_PIXELS * (u + fabs(j->u_at[2])) < 2000 &&
                 TILE_PIXELS * (v + fabs(j->v_at[2])) < 2000 && (double)layout->row_stride * layout->alloc_v < 2e9;
    j->narrow_offsets = (j->windowed || j->gathers) && (double)layout->row_stride * layout->alloc_v < 1e9;
    const bool one = j->windowed && layout->alloc_u >= 16 && layout->alloc_v >= 4;
    j->one_window_rows = 0;
    for (int rows = 1; one && rows < CTS_PACKET; rows++)
        if (7 * u + rows * fabs(j->u_at[2]) <= 13 && 7 * v + rows * fabs(j->v_at[2]) <= 1.99)
            j->one_window_rows = rows;
}

static void init_frame(TiledJob *j)
{
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++)
            j->frame[i][c] =
                j->shade->frame[i][c] * (c == 2 && j->rising == CTS_MUTATED(GRADIENT_SIGN) ? -1 : 1) / 16384;
}

static void init_job(TiledJob *j, const CtsScene *scene, const CtsLayout *layout)
{
    const CtsView *view = &scene->view;
    plane_map(view, layout->axis_u, 0, j->u_at);
    plane_map(view, layout->axis_v, 0, j->v_at);
    const double too_far_mm = CTS_MUTATED(DEPTH_SLAB) ? view->layer_mm : 0;
    plane_map(view, -1, cts_volume_diagonal_mm(scene->volume) / 2 + too_far_mm, j->depth_at);
    double behind_mm[4];
    plane_map(view, -1, 0, behind_mm);
    slab_map(j, behind_mm, view->near_mm, j->near_at);
    slab_map(j, behind_mm, view->far_mm, j->far_at);
    j->slab = isfinite(view->near_mm);
    j->nu = layout->nu;
    j->nv = layout->nv;
    j->nk = layout->nk - (CTS_MUTATED(LAST_SLAB) && layout->nk > 2);
    j->rising = view->axis_sign > 0;
    j->row_stride = layout->row_stride;
    j->layer_stride = layout->layer_stride * view->axis_sign;
    init_windows(j, layout);
    j->straight = j->u_at[3] == 0 && j->v_at[3] == 0;
    j->layer_mm = CTS_MUTATED(LAYER_LENGTH) ? 1 : (float)view->layer_mm;
    j->width = view->width;
    cts_tiled_plan(j, scene);
    init_steps(j);
}

/* How far, in macro-cells, from a visible one lies what a beam may sample: beams are sampled as a whole, up to the next
 * layer of fine macro-cells; a voxel more for interpolation, and for slopes as far as these look. */
static int sampled_reach(const TiledJob *j)
{
    const int apart = j->draft.mean ? 2 : 1; /* on a lattice */
    const double u = 7 * apart * (fabs(j->u_at[1]) + fabs(j->u_at[2])) + CTS_FINE_MACROCELL * fabs(j->u_at[3]);
    const double v = 7 * apart * (fabs(j->v_at[1]) + fabs(j->v_at[2])) + CTS_FINE_MACROCELL * fabs(j->v_at[3]);
    int slopes = 1;
    for (int axis = 0; axis < 3 && j->shade; axis++)
        slopes = j->shade->step[axis] > slopes ? j->shade->step[axis] : slopes;
    return (int)fmin(ceil((fmax(fmax(u, v), CTS_FINE_MACROCELL) + 1 + slopes) / CTS_MACROCELL), 255);
}

static TiledPath choose_path(const TiledJob *j)
{
    const unsigned cpu = cts_cpu_flags();
    if (cpu & CTS_CPU_AVX512 && (j->windowed || j->gathers))
        return (TiledPath){"AVX-512", cts_tiled_packets_avx512, cts_tiled_packets_avx2, 2};
    if (cpu & CTS_CPU_AVX2)
        return (TiledPath){"AVX2", cts_tiled_packets_avx2, cts_tiled_packets_avx2, 1};
    return (TiledPath){"plain C", cts_tiled_packets_c, cts_tiled_packets_c, 1};
}

typedef struct Tiles {
    const TiledJob *job;
    const TiledPath *path;
    const CtsScene *scene;
    TiledWorkspace *workspaces; /* of each worker */
} Tiles;

static void run_some_tiles(void *context, int worker, size_t first, size_t end)
{
    const Tiles *const t = context;
    for (size_t tile = first; tile < end && !cts_scene_stopped(t->scene); tile++)
        cts_tiled_run_tile(t->job, t->path, &t->workspaces[worker], (int)tile);
}

static CtsStatus run_tiles(const TiledJob *j, const TiledPath *path, const CtsScene *scene, TiledCounts *total,
                           CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    const size_t n_runs = cts_tiled_n_runs(j);
    TiledRun *runs = NULL;
    TiledWorkspace *workspaces = NULL;
    CtsStatus st;
    if ((st = cts_alloc_array(&runs, n_runs * (size_t)n_threads, err)) ||
        (st = cts_alloc_zeroed(&workspaces, (size_t)n_threads, err)))
        goto end;
    for (int t = 0; t < n_threads; t++)
        workspaces[t].runs = runs + n_runs * (size_t)t;
    Tiles tiles = {j, path, scene, workspaces};
    cts_parallel(n_threads, (size_t)cts_tiled_n_tiles(j), 1, run_some_tiles, &tiles);
    for (int t = 0; t < n_threads; t++) {
        total->samples += workspaces[t].counts.samples;
        total->slabs += workspaces[t].counts.slabs;
        total->marches += workspaces[t].counts.marches;
        total->splat_ticks += workspaces[t].counts.splat_ticks;
        total->composite_ticks += workspaces[t].counts.composite_ticks;
        total->shade_ticks += workspaces[t].counts.shade_ticks;
    }
    if (cts_scene_stopped(scene))
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
end:
    cts_free(&workspaces);
    cts_free(&runs);
    return st;
}

static void report_counts(const TiledCounts *counts, const CtsScene *scene, const CtsEmptySpace *empty, double wall_ms,
                          double cpu_ms, CtsReport *report)
{
    const double ticks = (double)(counts->splat_ticks + counts->composite_ticks + counts->shade_ticks);
    double busy[CTS_N_STAGES] = {0};
    uint64_t items[CTS_N_STAGES] = {0}, bytes[CTS_N_STAGES] = {0};
    busy[CTS_STAGE_SPLAT] = ticks > 0 ? (double)counts->splat_ticks / ticks : 0.5;
    busy[CTS_STAGE_SHADE] = ticks > 0 ? (double)counts->shade_ticks / ticks : 0;
    busy[CTS_STAGE_COMPOSITE] = 1 - busy[CTS_STAGE_SPLAT] - busy[CTS_STAGE_SHADE];
    items[CTS_STAGE_SPLAT] = counts->samples;
    items[CTS_STAGE_COMPOSITE] = counts->slabs;
    items[CTS_STAGE_SHADE] = scene->preset->shade ? counts->slabs : 0;
    bytes[CTS_STAGE_SPLAT] = counts->samples * 4 * sizeof(uint16_t); /* the voxels around each */
    cts_report_region(report, wall_ms, cpu_ms, busy, items, bytes);
    if (report) {
        CtsVoxelCounts *v = &report->voxels;
        v->known = true;
        v->total = cts_volume_n_voxels(scene->volume);
        v->splatted = (uint64_t)((double)v->total * (double)empty->n_visible / (double)empty->n_macrocells);
        v->void_voxels = v->total - v->splatted;
        v->reused = 0;
    }
}

/* Pixels further apart than this, times the error asked for, are not filled in between: what is filled in straight is
 * off by a small part of that. Beyond an eighth of the range edges would show as steps. */
#define AGREE_WITHIN 4
#define AGREE_AT_MOST 0.125

/* A draft's lattice first, where one pays, then the picture. */
static CtsStatus run_picture(TiledJob *j, const TiledPath *path, const CtsScene *scene, const CtsLayout *layout,
                             TiledKept *kept, TiledCounts *total, CtsError *err)
{
    CtsStatus st;
    TiledJob lattice;
    if (!cts_lattice_pays(j, scene))
        return run_tiles(j, path, scene, total, err);
    cts_lattice_spread(&lattice, j);
    init_steps(&lattice);
    init_windows(&lattice, layout);
    const TiledPath spread_path = choose_path(&lattice);
    const size_t n = (size_t)lattice.width * (size_t)(lattice.past_row - lattice.first_row);
    if ((st = cts_tiled_kept_lattice(kept, n, &lattice.rgba, err)) ||
        (st = run_tiles(&lattice, &spread_path, scene, total, err)))
        return st;
    j->lattice = (TiledLattice){lattice.rgba, lattice.width, lattice.first_row,
                                (float)fmin(AGREE_WITHIN * cts_scene_error_asked(scene), AGREE_AT_MOST)};
    return run_tiles(j, path, scene, total, err);
}

static CtsStatus composite(const CtsScene *scene, TiledKept *kept, const CtsMacrocells *macrocells, CtsPicture *picture,
                           CtsReport *report, CtsError *err)
{
    CtsStatus st;
    CtsLayout layout;
    CtsShade shade = {0};
    TiledJob job = {0};
    TiledCounts counts = {0};
    layout = cts_layout_plan(scene->volume, &scene->view);
    double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const int axes[3] = {layout.axis_u, layout.axis_v, layout.axis_k};
    if ((st = cts_tiled_kept_tables(kept, scene, macrocells, &layout, report, err)))
        goto end;
    job.table = kept->table;
    job.table.quiet_high -= CTS_MUTATED(QUIET_HIGH);
    job.empty = kept->empty;
    if (cts_scene_drafts(scene))
        job.draft = kept->draft;
    if (scene->preset->shade) {
        if ((st = cts_shade_init(&shade, scene->preset, scene->volume, &scene->view, axes, err)))
            goto end;
        job.shade = &shade;
    }
    job.grey_least = (float)macrocells->all.low;
    job.grey_most = (float)macrocells->all.high;
    job.narrow = job.grey_most - job.grey_least < 32768;
    init_job(&job, scene, &layout);
    if (job.shade)
        init_frame(&job);
    const TiledPath path = choose_path(&job);
    cts_scene_tell_parts(scene, report);
    cts_tiled_plan_report(&job, scene, &layout, sampled_reach(&job), path.name, report);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     (uint64_t)job.empty.n_macrocells, 0);
    if (!picture)
        goto end;
    if ((st = cts_tiled_kept_layout(kept, scene, sampled_reach(&job), &layout, report, err)))
        goto end;
    job.layer0 = layout.grey + (job.rising ? 0 : (layout.nk - 1) * layout.layer_stride);
    job.rgba = picture->pixels;
    job.first_row = picture->first_row;
    job.past_row = picture->first_row + picture->height;
    job.depth_mm = picture->depth_mm;
    job.bound = picture->bound;
    wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if ((st = run_picture(&job, &path, scene, &layout, kept, &counts, err)))
        goto end;
    report_counts(&counts, scene, &job.empty, cts_wall_ms() - wall, cts_cpu_ms() - cpu, report);
end:
    cts_shade_free(&shade);
    return st;
}

static CtsStatus render_tiled(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    TiledKept *kept = NULL;
    const CtsMacrocells *macrocells;
    if ((st = cts_tiled_kept_open(scene, &kept, err)) ||
        (st = cts_tiled_kept_macrocells(kept, scene, &macrocells, report, err)))
        goto end;
    st = scene->preset->mode == CTS_MODE_COMPOSITE ? composite(scene, kept, macrocells, picture, report, err)
                                                   : cts_project(scene, macrocells, picture, report, err);
end:
    cts_tiled_kept_close(scene, kept);
    return st;
}

const CtsEngine cts_engine_tiled = {
    .name = "tiled",
    .render = render_tiled,
    .bounds_error = true,
    .skips_void = true,
    .cuts_slabs = true,
    .modes = (1u << CTS_N_MODES) - 1,
    .kernels = 1u << CTS_KERNEL_TENT,
    .forget = cts_tiled_kept_free,
};
