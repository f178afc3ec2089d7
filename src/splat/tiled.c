/* The tiled engine: the paper's idea taken to its limit. Sheets are sampled only where the final pixels' rays cross
 * them (so no warp), blocks that cannot be seen are leapt over, the slab between two sheets is integrated exactly, and
 * a packet of pixels ends when it is opaque (ALGORITHMS section 7, engine C). */
#include "splat/engine.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "splat/tiled_kernel.h"
#include "volume/blocks.h"
#include <math.h>
#include <string.h>

enum { TILE_WIDTH = 64, TILE_HEIGHT = 8 };

/* u = at[0] + at[1] x + at[2] y + at[3] q for the ray of pixel (x, y) at layer q. */
static void plane_map(const CtsView *view, int axis, double at[4])
{
    double start[3], right[3], down[3];
    const int k = view->axis;
    cts_view_ray(view, 0, 0, start);
    for (int a = 0; a < 3; a++) {
        right[a] = view->right_vox[a] * view->mm_per_pixel;
        down[a] = -view->up_vox[a] * view->mm_per_pixel;
    }
    const double slope = view->forward_vox[axis] / view->forward_vox[k]; /* voxels per layer of rising k */
    const double first = view->axis_sign > 0 ? 0 : view->dims[k] - 1;
    at[0] = start[axis] + slope * (first - start[k]);
    at[1] = right[axis] - slope * right[k];
    at[2] = down[axis] - slope * down[k];
    at[3] = slope * view->axis_sign + 0.0;
}

static int choose_samples(const CtsScene *scene)
{
    if (scene->settings->samples > 0)
        return scene->settings->samples;
    return 1;
}

static void init_job(TiledJob *j, const CtsScene *scene, const CtsLayout *layout)
{
    const CtsView *view = &scene->view;
    plane_map(view, layout->axis_u, j->u_at);
    plane_map(view, layout->axis_v, j->v_at);
    j->nu = layout->nu;
    j->nv = layout->nv;
    j->nk = layout->nk;
    j->rising = view->axis_sign > 0;
    j->row_stride = layout->row_stride;
    j->layer_stride = layout->layer_stride * view->axis_sign;
    j->layer0 = layout->grey + (j->rising ? 0 : (layout->nk - 1) * layout->layer_stride);
    j->window_u = layout->alloc_u - CTS_LAYOUT_MIN_U;
    j->window_v = layout->alloc_v - CTS_LAYOUT_MIN_V;
    j->windowed = 3 * fabs(j->u_at[1]) <= 6 && 3 * fabs(j->v_at[1]) <= 1;
    j->straight = j->u_at[3] == 0 && j->v_at[3] == 0;
    j->samples = choose_samples(scene);
    j->layer_mm = (float)view->layer_mm;
    j->stop_transmittance = 1.0f / 1024;
    j->width = view->width;
    j->height = view->height;
}

static void run_tiles(const TiledJob *j, tiled_row_fn row, const CtsScene *scene, TiledCounts *total)
{
    const int nx = (j->width + TILE_WIDTH - 1) / TILE_WIDTH, ny = (j->height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    uint64_t samples = 0, slabs = 0, packets = 0;
#pragma omp parallel for schedule(dynamic) num_threads(scene->settings->n_threads) reduction(+ : samples, slabs, packets)
    for (int tile = 0; tile < nx * ny; tile++) {
        if (cts_scene_stopped(scene))
            continue;
        TiledCounts counts = {0};
        const int x0 = tile % nx * TILE_WIDTH, y0 = tile / nx * TILE_HEIGHT;
        const int x1 = x0 + TILE_WIDTH < j->width ? x0 + TILE_WIDTH : j->width;
        const int y1 = y0 + TILE_HEIGHT < j->height ? y0 + TILE_HEIGHT : j->height;
        for (int y = y0; y < y1; y++)
            row(j, y, x0, x1, &counts);
        samples += counts.samples;
        slabs += counts.slabs;
        packets += counts.packets;
    }
    *total = (TiledCounts){.samples = samples, .slabs = slabs, .packets = packets};
}

static CtsStatus render_tiled(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    CtsBlocks *blocks = NULL;
    CtsLayout layout = {0};
    TiledJob job = {0};
    const CtsRenderSettings *s = scene->settings;
    double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if ((st = cts_blocks_new(&blocks, scene->volume, s->n_threads, err)) ||
        (st = cts_layout_init(&layout, scene->volume, &scene->view, s->n_threads, err)))
        goto end;
    cts_report_stage(report, CTS_STAGE_GREY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, cts_volume_n_voxels(scene->volume),
                     0);
    wall = cts_wall_ms(), cpu = cts_cpu_ms();
    init_job(&job, scene, &layout);
    if ((st = cts_slab_table_init(&job.table, scene, blocks->all, err)) ||
        (st = cts_leap_init(&job.leap, blocks, &layout, scene->lut, err)))
        goto end;
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, (uint64_t)job.leap.n_blocks,
                     0);
    if (!picture)
        goto end;
    job.rgba = picture->pixels;
    job.depth_mm = picture->depth_mm;
    wall = cts_wall_ms(), cpu = cts_cpu_ms();
    TiledCounts counts;
    const bool avx2 = cts_cpu_flags() & s->cpu_mask & CTS_CPU_AVX2;
    run_tiles(&job, avx2 ? tiled_row_avx2 : tiled_row_c, scene, &counts);
    if (cts_scene_stopped(scene)) {
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
        goto end;
    }
    cts_report_stage(report, CTS_STAGE_COMPOSITE, cts_wall_ms() - wall, cts_cpu_ms() - cpu, counts.samples, 0);
end:
    cts_slab_table_free(&job.table);
    cts_leap_free(&job.leap);
    cts_layout_free(&layout);
    cts_blocks_free(&blocks);
    return st;
}

const CtsEngine cts_engine_tiled = {
    .name = "tiled",
    .render = render_tiled,
    .modes = 1u << CTS_MODE_COMPOSITE,
    .kernels = 1u << CTS_KERNEL_TENT,
};
