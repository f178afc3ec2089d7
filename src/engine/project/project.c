#include "engine/project/project.h"

#include "base/clamp.h"
#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "engine/project/project_packets.h"
#include <math.h>

/* State of a picture. */
typedef struct Projecting {
    const CtsScene *scene;
    CtsProjection projection;
    cts_project_tile_fn tile;
    CtsProjectedLayer *layers; /* of each thread, n_layers */
    size_t n_layers;
    CtsPicture *picture;
} Projecting;

static void write_pixel(const Projecting *pr, double grey, float out[4])
{
    const CtsPreset *preset = pr->scene->preset;
    const CtsVolume *v = pr->scene->volume;
    const double width_hu = preset->window_high_hu - preset->window_low_hu;
    if (isinf(grey))
        return;
    const double hu = v->hu_offset + v->hu_step * grey;
    const double shown = width_hu != 0 ? (hu - preset->window_low_hu) / width_hu : hu >= preset->window_low_hu;
    out[0] = out[1] = out[2] = cts_clamp_to_level(shown);
    out[3] = 1;
}

static void project_tiles(const Projecting *pr, int worker, int y)
{
    const CtsPicture *picture = pr->picture;
    const int left = picture->height - y, height = left < CTS_PROJECT_TILE ? left : CTS_PROJECT_TILE;
    for (int x = 0; x < picture->width; x += CTS_PROJECT_TILE) {
        const int n = picture->width - x, width = n < CTS_PROJECT_TILE ? n : CTS_PROJECT_TILE;
        double grey[CTS_PROJECT_TILE * CTS_PROJECT_TILE];
        pr->tile(&pr->projection, pr->layers + (size_t)worker * pr->n_layers, x, picture->first_row + y, width, height,
                 grey);
        for (int j = 0; j < height; j++)
            for (int i = 0; i < width; i++)
                write_pixel(pr, grey[CTS_PROJECT_TILE * j + i],
                            picture->pixels + 4 * ((size_t)(y + j) * (size_t)picture->width + (size_t)(x + i)));
    }
}

static void project_some(void *context, int worker, size_t first, size_t end)
{
    const Projecting *const pr = context;
    for (size_t i = first; i < end && !cts_scene_stopped(pr->scene); i++)
        project_tiles(pr, worker, (int)i * CTS_PROJECT_TILE);
}

/* Levels beyond the window, which are black or white, need not be distinguished. */
static void narrow_window(const CtsScene *scene, CtsProjection *p)
{
    const CtsPreset *preset = scene->preset;
    const CtsVolume *v = scene->volume;
    p->sign = preset->mode == CTS_MODE_MINIP ? -1 : 1;
    p->least = -INFINITY;
    p->enough = INFINITY;
    if (preset->window_high_hu == preset->window_low_hu || !(v->hu_step > 0))
        return;
    const double low = (fmin(preset->window_low_hu, preset->window_high_hu) - v->hu_offset) / v->hu_step - 1;
    const double high = (fmax(preset->window_low_hu, preset->window_high_hu) - v->hu_offset) / v->hu_step + 1;
    p->least = p->sign > 0 ? low : -high;
    p->enough = p->sign > 0 ? high : -low;
}

struct CtsVisibleBlocks {
    const struct CtsBodyMask *body; /* of this body's inside */
    int32_t *visibility;
    CtsVisibleCells *cells;
};

void cts_visible_blocks_free(CtsVisibleBlocks **blocks)
{
    if (!*blocks)
        return;
    cts_free(&(*blocks)->visibility);
    cts_free(&(*blocks)->cells);
    cts_free(blocks);
}

typedef struct Seeing {
    const CtsProjector *projector;
    CtsVisibleBlocks *blocks;
} Seeing;

static void test_macrocell_rows(void *context, int worker, size_t first, size_t end)
{
    const Seeing *const s = context;
    const CtsProjector *p = s->projector;
    const int *n = p->macrocells->n_fine;
    (void)worker;
    for (size_t row = first; row < end; row++)
        for (int i = 0; i < n[0]; i++) {
            const int at[3] = {i, (int)(row % (size_t)n[1]), (int)(row / (size_t)n[1])};
            const size_t block = row * (size_t)n[0] + (size_t)i;
            const int appearance = p->voxel_labels ? p->voxel_labels->block[block] : CTS_APPEARANCE_PRESET;
            int low[3], high[3];
            for (int a = 0; a < 3; a++) {
                low[a] = at[a] * CTS_FINE_MACROCELL;
                high[a] = low[a] + CTS_FINE_MACROCELL;
            }
            const CtsMaskCover body = p->body ? cts_body_mask_cover(p->body, low, high) : CTS_COVER_ALL;
            s->blocks->visibility[block] = appearance == CTS_APPEARANCE_HIDDEN || body == CTS_COVER_NONE ? CTS_NO_CELL
                                           : appearance == CTS_APPEARANCES_DIFFER || body == CTS_COVER_SOME
                                               ? 0
                                               : CTS_ALL_CELLS;
        }
}

/* The cells of a macro-cell one by one: their field lies between the smallest and the largest voxel of each. */
static CtsVisibleCells visible_cells(const CtsProjector *p, const int block[3])
{
    enum { N = CTS_FINE_MACROCELL, CORNERS = N + 1 };
    double field[CORNERS][CORNERS][CORNERS];
    CtsVisibleCells cells = {0, 0};
    for (int c = 0; p->body && c < CORNERS * CORNERS * CORNERS; c++) {
        const int in[3] = {c % CORNERS, c / CORNERS % CORNERS, c / CORNERS / CORNERS};
        double at[3];
        for (int a = 0; a < 3; a++)
            at[a] = fmin(N * block[a] + in[a], p->view->dims[a] - 1);
        field[in[2]][in[1]][in[0]] = cts_body_mask_at(p->body, at);
    }
    for (int c = 0; c < N * N * N; c++) {
        const int i = c % N, j = c / N % N, k = c / N / N,
                  cell[3] = {N * block[0] + i, N * block[1] + j, N * block[2] + k};
        int n_inside = p->body ? 0 : 8;
        bool inside = true;
        for (int a = 0; a < 3; a++)
            inside &= cell[a] < p->n_cells[a];
        if (!inside)
            continue;
        for (int m = 0; p->body && m < 8; m++)
            n_inside += field[k + (m >> 2)][j + (m >> 1 & 1)][i + (m & 1)] > CTS_BODY_THRESHOLD;
        const int appearance = p->voxel_labels ? cts_appearance_of_cell(p->voxel_labels, cell) : CTS_APPEARANCE_PRESET;
        if (appearance == CTS_APPEARANCE_HIDDEN || n_inside == 0)
            continue;
        cells.some |= UINT64_C(1) << c;
        cells.all |= (uint64_t)(appearance != CTS_APPEARANCES_DIFFER && n_inside == 8) << c;
    }
    return cells;
}

static void test_cells(void *context, int worker, size_t first, size_t end)
{
    const Seeing *const s = context;
    const int *const n = s->projector->macrocells->n_fine;
    (void)worker;
    for (size_t row = first; row < end; row++)
        for (int i = 0; i < n[0]; i++) {
            const int32_t place = s->blocks->visibility[row * (size_t)n[0] + (size_t)i];
            const int at[3] = {i, (int)(row % (size_t)n[1]), (int)(row / (size_t)n[1])};
            if (place >= 0)
                s->blocks->cells[place] = visible_cells(s->projector, at);
        }
}

/* Once for all views. */
static CtsStatus find_visible_blocks(const CtsProjector *projector, int n_threads, CtsVisibleBlocks **blocks,
                                     CtsError *err)
{
    const int *const n = projector->macrocells->n_fine;
    const size_t n_rows = (size_t)n[1] * (size_t)n[2], n_blocks = n_rows * (size_t)n[0];
    int32_t n_some = 0;
    CtsStatus st;
    if (*blocks && (*blocks)->body == projector->body)
        return CTS_OK;
    cts_visible_blocks_free(blocks);
    if ((st = cts_alloc_zeroed(blocks, 1, err)) || (st = cts_alloc_array(&(*blocks)->visibility, n_blocks, err)))
        goto end;
    Seeing s = {projector, *blocks};
    (*blocks)->body = projector->body;
    cts_parallel(n_threads, n_rows, 0, test_macrocell_rows, &s);
    for (size_t i = 0; i < n_blocks; i++)
        if ((*blocks)->visibility[i] >= 0)
            (*blocks)->visibility[i] = n_some++;
    if (!(st = cts_alloc_array(&(*blocks)->cells, (size_t)n_some, err)))
        cts_parallel(n_threads, n_rows, 0, test_cells, &s);
end:
    if (st)
        cts_visible_blocks_free(blocks);
    return st;
}

static CtsStatus prepare_projection(Projecting *pr, int n_threads, CtsVisibleBlocks **blocks, CtsError *err)
{
    CtsStatus st;
    CtsProjection *p = &pr->projection;
    const CtsProjector *projector = &p->projector;
    const int *n = projector->macrocells->n_fine;
    const double *forward = projector->view->forward_vox;
    const unsigned cpu = cts_cpu_flags();
    for (int a = 0; a < 3; a++)
        p->axes[2] = fabs(forward[a]) > fabs(forward[p->axes[2]]) ? a : p->axes[2];
    p->axes[0] = p->axes[2] == 0;
    p->axes[1] = 3 - p->axes[0] - p->axes[2];
    pr->n_layers = (size_t)n[p->axes[2]];
    if ((st = cts_alloc_array(&pr->layers, (size_t)n_threads * pr->n_layers, err)))
        return st;
    if (projector->body || projector->voxel_labels) {
        if ((st = find_visible_blocks(projector, n_threads, blocks, err)))
            return st;
        p->visibility = (*blocks)->visibility;
        p->cells = (*blocks)->cells;
    }
    pr->tile = CTS_CPU_CHOICE(cpu, cts_project_tile);
    return CTS_OK;
}

CtsStatus cts_project(const CtsScene *scene, CtsVisibleBlocks **blocks, CtsPicture *picture, CtsReport *report,
                      CtsError *err)
{
    const CtsVolume *v = scene->volume;
    const int n_threads = scene->settings->n_threads;
    Projecting pr = {
        .scene = scene,
        .picture = picture,
        .projection.projector = {
            .volume = v,
            .macrocells = scene->model->macrocells,
            .view = &scene->view,
            .mode = scene->preset->mode,
            .body = cts_scene_body(scene),
            .voxel_labels = cts_model_shown(scene->model) != scene->model ? scene->model->voxel_labels : NULL,
        }};
    const CtsMode mode = scene->preset->mode;
    cts_volume_cells(v, pr.projection.projector.n_cells, pr.projection.projector.stride);
    cts_report_plan(report, "mode %s: each ray through the cells it crosses, extremes and means of the cubic in each",
                    cts_mode_names[mode]);
    cts_report_plan(report, mode == CTS_MODE_AVERAGE
                                ? "macro-cells of 4^3 cells of one grey level are added as a whole"
                                : "macro-cells of 4^3 cells that cannot change the pixel's extreme, or lie beyond the "
                                  "window, are skipped; the most promising ones come first");
    cts_scene_report_region(scene, report);
    if (!picture)
        return CTS_OK;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    narrow_window(scene, &pr.projection);
    CtsStatus st = prepare_projection(&pr, n_threads, blocks, err);
    if (!st)
        cts_parallel(n_threads, (size_t)((picture->height + CTS_PROJECT_TILE - 1) / CTS_PROJECT_TILE), 1, project_some,
                     &pr);
    cts_free(&pr.layers);
    if (st)
        return st;
    if (cts_scene_stopped(scene))
        return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    cts_report_stage(report, CTS_STAGE_COMPOSITE, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     (uint64_t)picture->width * (uint64_t)picture->height, 0);
    return CTS_OK;
}
