#include "engine/project/project.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/levels.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "engine/project/project_packets.h"
#include <math.h>
#include <string.h>

/* A picture under way. */
typedef struct Projecting {
    const CtsScene *scene;
    CtsProjection projection;
    cts_project_tile_fn tile; /* NULL: ray by ray, the plain way */
    CtsProjectScratch *scratch;
    CtsPicture *picture;
} Projecting;

static void show(const Projecting *pr, double grey, float out[4])
{
    const CtsPreset *preset = pr->scene->preset;
    const CtsVolume *v = pr->scene->volume;
    const double width_hu = preset->window_high_hu - preset->window_low_hu;
    if (isinf(grey))
        return;
    const double hu = v->hu_offset + v->hu_step * grey;
    const double shown = width_hu > 0 ? (hu - preset->window_low_hu) / width_hu : hu >= preset->window_low_hu;
    out[0] = out[1] = out[2] = cts_level_float(shown);
    out[3] = 1;
}

static float *pixel_of(const CtsPicture *picture, int x, int y)
{
    return picture->pixels + 4 * ((size_t)y * (size_t)picture->width + (size_t)x);
}

static void project_row(const Projecting *pr, int y)
{
    const CtsProjector *p = &pr->projection.projector;
    for (int x = 0; x < pr->picture->width; x++) {
        CtsProjectedRay ray;
        if (cts_project_clip(p->view, x, pr->picture->first_row + y, &ray))
            show(pr, cts_project_along(p, &ray), pixel_of(pr->picture, x, y));
    }
}

static void project_tiles(const Projecting *pr, int worker, int y)
{
    const CtsPicture *picture = pr->picture;
    const int left = picture->height - y, height = left < CTS_PROJECT_TILE ? left : CTS_PROJECT_TILE;
    for (int x = 0; x < picture->width; x += CTS_PROJECT_TILE) {
        const int n = picture->width - x, width = n < CTS_PROJECT_TILE ? n : CTS_PROJECT_TILE;
        double grey[CTS_PROJECT_TILE * CTS_PROJECT_TILE];
        pr->tile(&pr->projection, &pr->scratch[worker], x, picture->first_row + y, width, height, grey);
        for (int j = 0; j < height; j++)
            for (int i = 0; i < width; i++)
                show(pr, grey[CTS_PROJECT_TILE * j + i], pixel_of(picture, x + i, y + j));
    }
}

static void project_some(void *context, int worker, size_t first, size_t end)
{
    const Projecting *const pr = context;
    for (size_t i = first; i < end && !cts_scene_stopped(pr->scene); i++)
        if (pr->tile)
            project_tiles(pr, worker, (int)i * CTS_PROJECT_TILE);
        else
            project_row(pr, (int)i);
}

/* Levels that the window shows as black or white need not be told apart. */
static void set_window(const CtsScene *scene, CtsProjection *p)
{
    const CtsPreset *preset = scene->preset;
    const CtsVolume *v = scene->volume;
    p->sign = preset->mode == CTS_MODE_MINIP ? -1 : 1;
    p->least = -INFINITY;
    p->enough = INFINITY;
    if (!(preset->window_high_hu > preset->window_low_hu) || !(v->hu_step > 0))
        return;
    const double low = (preset->window_low_hu - v->hu_offset) / v->hu_step - 1;
    const double high = (preset->window_high_hu - v->hu_offset) / v->hu_step + 1;
    p->least = p->sign > 0 ? low : -high;
    p->enough = p->sign > 0 ? high : -low;
}

/* Which of the cells of each fine macro-cell are seen. */
typedef struct Seeing {
    const CtsProjector *projector;
    uint8_t *sees;
} Seeing;

static void look_into_rows(void *context, int worker, size_t first, size_t end)
{
    const Seeing *const s = context;
    const CtsProjector *p = s->projector;
    const int *n = p->macrocells->n_fine;
    const int cells[3] = {p->view->dims[0] - 1, p->view->dims[1] - 1, p->view->dims[2] - 1};
    const int n_words = (cells[0] + 63) / 64;
    (void)worker;
    for (size_t row = first; row < end; row++) {
        const int j0 = (int)(row % (size_t)n[1]) * CTS_FINE_MACROCELL,
                  k0 = (int)(row / (size_t)n[1]) * CTS_FINE_MACROCELL;
        uint64_t some[CTS_BITS_ROW_WORDS] = {0}, all[CTS_BITS_ROW_WORDS], own[CTS_BITS_ROW_WORDS];
        memset(all, 0xff, (size_t)n_words * sizeof *all);
        for (int k = k0; k < k0 + CTS_FINE_MACROCELL && k < cells[2]; k++)
            for (int j = j0; j < j0 + CTS_FINE_MACROCELL && j < cells[1]; j++) {
                if (p->body)
                    cts_body_mask_row(p->body, j, k, cells[0], own);
                else
                    memset(own, 0xff, (size_t)n_words * sizeof *own);
                for (int w = 0; w < n_words; w++) {
                    some[w] |= own[w];
                    all[w] &= own[w];
                }
            }
        for (int bi = 0; bi < n[0]; bi++) {
            const int at = bi * CTS_FINE_MACROCELL, left = cells[0] - at;
            const uint64_t mask = (UINT64_C(1) << (left < CTS_FINE_MACROCELL ? left : CTS_FINE_MACROCELL)) - 1;
            const int look = p->owners ? p->owners->block[row * (size_t)n[0] + (size_t)bi] : CTS_LOOK_PRESET;
            const bool none = look == CTS_LOOK_HIDDEN || !(some[at / 64] >> at % 64 & mask);
            const bool whole = look != CTS_LOOKS_DIFFER && (~all[at / 64] >> at % 64 & mask) == 0;
            s->sees[row * (size_t)n[0] + (size_t)bi] = none ? CTS_SEES_NONE : whole ? CTS_SEES_ALL : CTS_SEES_SOME;
        }
    }
}

static CtsStatus prepare(Projecting *pr, int n_threads, uint8_t **sees, CtsError *err)
{
    CtsStatus st;
    CtsProjection *p = &pr->projection;
    const CtsProjector *projector = &p->projector;
    const int *dims = projector->view->dims, *n = projector->macrocells->n_fine;
    const double *forward = projector->view->forward_vox;
    const unsigned cpu = cts_cpu_flags();
    if (dims[0] < 2 || dims[1] < 2 || dims[2] < 2)
        return CTS_OK;
    for (int a = 0; a < 3; a++)
        p->axes[2] = fabs(forward[a]) > fabs(forward[p->axes[2]]) ? a : p->axes[2];
    p->axes[0] = p->axes[2] == 0;
    p->axes[1] = 3 - p->axes[0] - p->axes[2];
    const size_t n_layers = (size_t)n[p->axes[2]];
    if ((st = cts_alloc_zeroed(&pr->scratch, (size_t)n_threads, err)))
        return st;
    for (int t = 0; t < n_threads; t++)
        if ((st = cts_alloc_array(&pr->scratch[t].bound, n_layers, err)) ||
            (st = cts_alloc_array(&pr->scratch[t].order, n_layers, err)))
            return st;
    if (projector->body || projector->owners) {
        if ((st = cts_alloc_array(sees, (size_t)n[0] * (size_t)n[1] * (size_t)n[2], err)))
            return st;
        Seeing seeing = {projector, *sees};
        cts_parallel(n_threads, (size_t)n[1] * (size_t)n[2], 0, look_into_rows, &seeing);
    }
    p->sees = *sees;
    pr->tile = cpu & CTS_CPU_AVX512 ? cts_project_tile_avx512
               : cpu & CTS_CPU_AVX2 ? cts_project_tile_avx2
                                    : cts_project_tile;
    return CTS_OK;
}

static void free_scratch(Projecting *pr, int n_threads)
{
    for (int t = 0; pr->scratch && t < n_threads; t++) {
        cts_free(&pr->scratch[t].bound);
        cts_free(&pr->scratch[t].order);
    }
    cts_free(&pr->scratch);
}

CtsStatus cts_project(const CtsScene *scene, const CtsMacrocells *macrocells, CtsPicture *picture, CtsReport *report,
                      CtsError *err)
{
    const CtsVolume *v = scene->volume;
    const int n_threads = scene->settings->n_threads;
    Projecting pr = {.scene = scene,
                     .picture = picture,
                     .projection.projector = {.volume = v,
                                              .macrocells = macrocells,
                                              .view = &scene->view,
                                              .mode = scene->preset->mode,
                                              .body = cts_scene_body(scene),
                                              .owners = v->owners && v->owners->shown ? v->owners : NULL,
                                              .stride = {1, v->dims[0], (ptrdiff_t)v->dims[0] * v->dims[1]}}};
    const CtsMode mode = scene->preset->mode;
    uint8_t *sees = NULL;
    cts_report_plan(report, "mode %s: each ray through the cells it crosses, extremes and means of the cubic in each",
                    cts_mode_names[mode]);
    cts_report_plan(report, mode == CTS_MODE_AVERAGE
                                ? "macro-cells of 4^3 cells of one grey level are taken whole"
                                : "macro-cells of 4^3 cells that cannot beat what was found, or leave the window, are "
                                  "skipped; those of most promise come first");
    cts_scene_tell_parts(scene, report);
    if (!picture)
        return CTS_OK;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    set_window(scene, &pr.projection);
    CtsStatus st = prepare(&pr, n_threads, &sees, err);
    const int step = pr.tile ? CTS_PROJECT_TILE : 1;
    if (!st)
        cts_parallel(n_threads, (size_t)((picture->height + step - 1) / step), 1, project_some, &pr);
    free_scratch(&pr, n_threads);
    cts_free(&sees);
    if (st)
        return st;
    if (cts_scene_stopped(scene))
        return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    cts_report_stage(report, CTS_STAGE_COMPOSITE, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     (uint64_t)picture->width * (uint64_t)picture->height, 0);
    return CTS_OK;
}
