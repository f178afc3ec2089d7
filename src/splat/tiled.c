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
#include <omp.h>
#include <string.h>
#include <stdio.h>
#include <stdlib.h>

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

static void init_job(TiledJob *j, const CtsScene *scene, const CtsLayout *layout)
{
    const CtsView *view = &scene->view;
    const CtsRenderSettings *s = scene->settings;
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
    j->samples = s->samples > 0 ? s->samples : 2; /* adaptive: one sheet half way */
    j->u_step = (int64_t)floor(j->u_at[3] / j->samples * 4294967296.0 + 0.5);
    j->v_step = (int64_t)floor(j->v_at[3] / j->samples * 4294967296.0 + 0.5);
    for (int l = 0; l < CTS_PACKET; l++) {
        j->lane_u[l] = (int32_t)floor(l * j->u_at[1] * 65536 + 0.5);
        j->lane_v[l] = (int32_t)floor(l * j->v_at[1] * 65536 + 0.5);
    }
    for (int l = 0; l < CTS_PACKET; l++) {
        const int a = l / 4 * 4, b = a + 3; /* lanes are monotone, so a half's smallest is at one of its ends */
        j->half_u[l] = j->lane_u[a] < j->lane_u[b] ? j->lane_u[a] : j->lane_u[b];
        j->half_v[l] = j->lane_v[a] < j->lane_v[b] ? j->lane_v[a] : j->lane_v[b];
    }
    j->adaptive = s->samples == 0;
    j->refine_grey = getenv("REFINE") ? (float)atof(getenv("REFINE")) : 100;
    j->refine_transmittance = getenv("RT") ? (float)atof(getenv("RT")) : 0.02f;
    j->bend_grey = getenv("BEND") ? (float)atof(getenv("BEND")) : 50;
    j->stiff_depth = getenv("STIFF") ? (float)atof(getenv("STIFF")) : 3;
    j->layer_mm = (float)view->layer_mm;
    j->stop_transmittance = getenv("STOP") ? 1.0f/(float)atof(getenv("STOP")) : 1.0f / 256;
    j->width = view->width;
    j->height = view->height;
}

/* One tile: first as a single wide beam, which finds most of what is empty, then packet by packet. */
static void run_tile(const TiledJob *j, tiled_packet_fn packet, TiledRun *runs, int x0, int y0, TiledCounts *counts)
{
    const int x1 = x0 + TILE_WIDTH < j->width ? x0 + TILE_WIDTH : j->width;
    const int y1 = y0 + TILE_HEIGHT < j->height ? y0 + TILE_HEIGHT : j->height;
    TiledBeam wide = {.runs = runs}, beam = {.runs = runs};
    if (!tiled_beam_init(j, &wide, x0, y0, x1, y1, 0))
        return;
    for (int x = x0; x < x1; x += CTS_PACKET)
        if (tiled_beam_init(j, &beam, x, y0, x + CTS_PACKET, y1, wide.first))
            for (int y = y0; y < y1; y++)
                packet(j, &beam, x, y, x1 - x < CTS_PACKET ? x1 - x : CTS_PACKET, counts);
}

static CtsStatus run_tiles(const TiledJob *j, tiled_packet_fn packet, const CtsScene *scene, TiledCounts *total,
                           CtsError *err)
{
    const int nx = (j->width + TILE_WIDTH - 1) / TILE_WIDTH, ny = (j->height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    uint64_t samples = 0, slabs = 0, packets = 0;
    TiledRun *runs = NULL;
    const size_t per_thread = (size_t)j->nk + 1;
    const CtsStatus st = cts_alloc_array(&runs, per_thread * (size_t)scene->settings->n_threads, err);
    if (st)
        return st;
#pragma omp parallel for schedule(dynamic) num_threads(scene->settings->n_threads) reduction(+ : samples, slabs, packets)
    for (int tile = 0; tile < nx * ny; tile++) {
        if (cts_scene_stopped(scene))
            continue;
        TiledCounts counts = {0};
        run_tile(j, packet, runs + per_thread * (size_t)omp_get_thread_num(), tile % nx * TILE_WIDTH,
                 tile / nx * TILE_HEIGHT, &counts);
        samples += counts.samples;
        slabs += counts.slabs;
        packets += counts.packets;
    }
    cts_free(&runs);
    if (getenv("CNT")) printf("samples %lu slabs %lu packets %lu\n", samples, slabs, packets);
    *total = (TiledCounts){.samples = samples, .slabs = slabs, .packets = packets};
    return CTS_OK;
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
    if ((st = run_tiles(&job, avx2 ? tiled_packet_avx2 : tiled_packet_c, scene, &counts, err)))
        goto end;
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
