/* A picture, region by region. */
#include "engine/sheets/sheets.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

_Static_assert(CTS_BAND_ROWS % SHEETS_REGION == 0, "a band is whole regions, or the picture would depend on it");
_Static_assert(SHEETS_REGION % SHEETS_TILE_X == 0 && SHEETS_REGION % SHEETS_TILE_Y == 0, "regions are whole tiles");

typedef struct Worker {
    SheetsCounts counts;
    uint64_t *region, *tile; /* bits of visible layers of blocks */
    float *extremes;         /* of three rows of pixels */
} Worker;

typedef struct Picturing {
    const SheetsJob *job;
    const SheetsKernels *kernels;
    const CtsScene *scene;
    CtsPicture *picture;
    float *indicator;
    Worker *workers;
    int across;
} Picturing;

static int at_most(int n, int most)
{
    return n < most ? n : most;
}

/* Pixels of a group that lie in the picture. */
static void store_group(const Picturing *p, const SheetsPixels *g, int x0, int y0)
{
    const CtsPicture *const to = p->picture;
    for (int l = 0; l < SHEETS_LANES; l++) {
        const int x = x0 + l % SHEETS_SIDE, y = y0 + l / SHEETS_SIDE;
        if (x >= to->width || y >= to->height)
            continue;
        const size_t at = (size_t)y * (size_t)to->width + (size_t)x;
        for (int c = 0; c < 4; c++)
            to->pixels[4 * at + (size_t)c] = g->rgba[c][l];
        p->indicator[at] = g->indicator[l];
        if (to->depth_mm)
            to->depth_mm[at] = g->depth_mm[l] < 1e29F ? (float)(p->job->camera_mm + (double)g->depth_mm[l]) : INFINITY;
    }
}

static void run_tile(const Picturing *p, Worker *w, int x0, int y0)
{
    const int first_row = p->picture->first_row;
    const int x[2] = {x0, x0 + SHEETS_TILE_X - 1}, y[2] = {first_row + y0, first_row + y0 + SHEETS_TILE_Y - 1};
    w->counts.tiles++;
    if (!cts_sheets_visible(p->job, x, y, w->region, w->tile)) {
        w->counts.void_tiles++;
        return;
    }
    for (int j = 0; j < SHEETS_TILE_Y && y0 + j < p->picture->height; j += SHEETS_SIDE)
        for (int i = 0; i < SHEETS_TILE_X && x0 + i < p->picture->width; i += SHEETS_SIDE) {
            SheetsPixels pixels;
            p->kernels->march(p->job, &p->job->grid[0], x0 + i, first_row + y0 + j, w->tile, &pixels, &w->counts);
            store_group(p, &pixels, x0 + i, y0 + j);
        }
}

static void run_region(const Picturing *p, Worker *w, int x0, int y0)
{
    const int first_row = p->picture->first_row;
    const int x1 = at_most(x0 + SHEETS_REGION, p->picture->width), y1 = at_most(y0 + SHEETS_REGION, p->picture->height);
    const int x[2] = {x0, x0 + SHEETS_REGION - 1}, y[2] = {first_row + y0, first_row + y0 + SHEETS_REGION - 1};
    if (!cts_sheets_visible(p->job, x, y, NULL, w->region)) {
        const int tiles =
            (x1 - x0 + SHEETS_TILE_X - 1) / SHEETS_TILE_X * ((y1 - y0 + SHEETS_TILE_Y - 1) / SHEETS_TILE_Y);
        w->counts.tiles += (uint64_t)tiles;
        w->counts.void_tiles += (uint64_t)tiles;
        return;
    }
    for (int j = y0; j < y1; j += SHEETS_TILE_Y)
        for (int i = x0; i < x1; i += SHEETS_TILE_X)
            run_tile(p, w, i, j);
}

static void run_some(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    for (size_t i = first; i < end && !cts_scene_stopped(p->scene); i++)
        run_region(p, &p->workers[worker], (int)i % p->across * SHEETS_REGION, (int)i / p->across * SHEETS_REGION);
}

/* A share of how far a pixel lies from its neighbours: where they differ, samples may have missed an edge between them.
 */
#define CONTRAST_SHARE (1.0F / 16)

static float smaller(float a, float b)
{
    return a < b ? a : b;
}

static float larger(float a, float b)
{
    return a > b ? a : b;
}

/* Largest difference of each pixel of row y to one of its eight neighbours, over channels. extremes: room for 2 (width
 * + 2) pixels. */
static void add_row_contrast(const CtsPicture *p, int y, int first, int end, float *extremes, float *indicator)
{
    const size_t n = 4 * (size_t)p->width;
    const float *const here = p->pixels + n * (size_t)y;
    const float *const above = y > first ? here - n : here, *const below = y + 1 < end ? here + n : here;
    float *const low = extremes + 4, *const high = extremes + n + 12;
    for (size_t i = 0; i < n; i++) {
        low[i] = smaller(smaller(above[i], below[i]), here[i]);
        high[i] = larger(larger(above[i], below[i]), here[i]);
    }
    for (size_t c = 0; c < 4; c++) { /* beyond the ends as at them */
        (low - 4)[c] = low[c];
        (high - 4)[c] = high[c];
        low[n + c] = low[n - 4 + c];
        high[n + c] = high[n - 4 + c];
    }
    for (size_t x = 0; x < (size_t)p->width; x++) {
        float most = 0;
        for (size_t i = 4 * x; i < 4 * x + 4; i++) {
            const float up = larger(larger((high - 4)[i], high[i + 4]), high[i]) - here[i];
            const float down = here[i] - smaller(smaller((low - 4)[i], low[i + 4]), low[i]);
            most = larger(most, larger(up, down));
        }
        indicator[x] += CONTRAST_SHARE * most;
    }
}

/* Strip by strip, so that no band sees another's pixels. */
static void add_contrast(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    for (size_t strip = first; strip < end; strip++) {
        const int y0 = (int)strip * SHEETS_REGION, y1 = at_most(y0 + SHEETS_REGION, p->picture->height);
        for (int y = y0; y < y1; y++)
            add_row_contrast(p->picture, y, y0, y1, p->workers[worker].extremes,
                             p->indicator + (size_t)y * (size_t)p->picture->width);
    }
}

static CtsStatus start_workers(Worker **workers, const SheetsJob *job, int width, int n_threads, CtsError *err)
{
    const size_t words = (size_t)cts_sheets_words(job->blocks->n_layers);
    CtsStatus st = cts_alloc_zeroed(workers, (size_t)n_threads, err);
    for (int i = 0; i < n_threads && !st; i++) {
        Worker *const w = &(*workers)[i];
        if (!(st = cts_alloc_array(&w->region, words, err)) && !(st = cts_alloc_array(&w->tile, words, err)))
            st = cts_alloc_array(&w->extremes, 8 * ((size_t)width + 2), err);
    }
    return st;
}

static void end_workers(Worker **workers, int n_threads, SheetsCounts *total)
{
    for (int i = 0; i < n_threads && *workers; i++) {
        Worker *const w = &(*workers)[i];
        const SheetsCounts *const c = &w->counts;
        total->groups += c->groups;
        total->sheets += c->sheets;
        total->slabs += c->slabs;
        total->lit += c->lit;
        total->tiles += c->tiles;
        total->void_tiles += c->void_tiles;
        cts_free(&w->region);
        cts_free(&w->tile);
        cts_free(&w->extremes);
    }
    cts_free(workers);
}

CtsStatus cts_sheets_run(const SheetsJob *job, const SheetsKernels *kernels, const CtsScene *scene, CtsPicture *picture,
                         float *indicator, SheetsCounts *total, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    Picturing p = {job, kernels, scene, picture, indicator, NULL, (picture->width + SHEETS_REGION - 1) / SHEETS_REGION};
    const size_t down = (size_t)(picture->height + SHEETS_REGION - 1) / SHEETS_REGION;
    CtsStatus st = start_workers(&p.workers, job, picture->width, n_threads, err);
    if (!st) {
        cts_parallel(n_threads, (size_t)p.across * down, 1, run_some, &p);
        cts_parallel(n_threads, down, 1, add_contrast, &p);
        st = cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
    }
    end_workers(&p.workers, n_threads, total);
    return st;
}

/* Tiles of their own, each by the same mask as in its region: a region's is the larger. */
typedef struct Probing {
    const SheetsJob *job;
    const SheetsKernels *kernels;
    const CtsScene *scene;
    const int (*corner)[2];
    float (*rgba)[4], *indicator;
    Worker *workers;
} Probing;

static void probe_some(void *context, int worker, size_t first, size_t end)
{
    const Probing *const p = context;
    Worker *const w = &p->workers[worker];
    for (size_t tile = first; tile < end && !cts_scene_stopped(p->scene); tile++) {
        const int x0 = p->corner[tile][0], y0 = p->corner[tile][1];
        const int x[2] = {x0, x0 + SHEETS_TILE_X - 1}, y[2] = {y0, y0 + SHEETS_TILE_Y - 1};
        const bool visible = cts_sheets_visible(p->job, x, y, NULL, w->tile);
        for (int group = 0; group < SHEETS_TILE_X * SHEETS_TILE_Y / SHEETS_LANES; group++) {
            const int i0 = group * SHEETS_SIDE % SHEETS_TILE_X;
            const int j0 = group * SHEETS_SIDE / SHEETS_TILE_X * SHEETS_SIDE;
            SheetsPixels pixels = {0};
            if (visible)
                p->kernels->march(p->job, &p->job->grid[0], x0 + i0, y0 + j0, w->tile, &pixels, &w->counts);
            for (int l = 0; l < SHEETS_LANES; l++) {
                const int i = i0 + l % SHEETS_SIDE, j = j0 + l / SHEETS_SIDE;
                const size_t at = tile * SHEETS_TILE_X * SHEETS_TILE_Y + (size_t)(j * SHEETS_TILE_X + i);
                for (int c = 0; c < 4; c++)
                    p->rgba[at][c] = pixels.rgba[c][l];
                p->indicator[at] = pixels.indicator[l];
            }
        }
    }
}

CtsStatus cts_sheets_probe(const SheetsJob *job, const SheetsKernels *kernels, const CtsScene *scene,
                           const int (*corner)[2], size_t n, float (*rgba)[4], float *indicator, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    Probing p = {job, kernels, scene, corner, rgba, indicator, NULL};
    SheetsCounts counts = {0};
    CtsStatus st = start_workers(&p.workers, job, 0, n_threads, err);
    if (!st)
        cts_parallel(n_threads, n, 1, probe_some, &p);
    end_workers(&p.workers, n_threads, &counts);
    return st ? st : cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}
