/* A picture, region by region. */
#include "engine/sheets/contrast.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <stdatomic.h>
#include <string.h>

_Static_assert(CTS_BAND_ROWS % SHEETS_REGION == 0, "a band is whole regions, or the picture would depend on it");
_Static_assert(SHEETS_REGION % SHEETS_TILE_X == 0 && SHEETS_REGION % SHEETS_TILE_Y == 0, "regions are whole tiles");

typedef struct SheetsWorker {
    SheetsCounts counts;
    uint64_t *region, *tile; /* bits of visible layers of blocks */
} SheetsWorker;

typedef struct Picturing {
    const SheetsJob *job;
    const SheetsKernels *kernels;
    const CtsScene *scene;
    SheetsWorker *workers;
    SheetsPatch pixels, lattice;
    atomic_int *regions_left; /* to render before the contrast of each of the pixels' regions */
} Picturing;

/* A row of a group: four channels of four pixels, transposed. */
static void store_row(float *rgba, const SheetsPixels *g, int first)
{
    f32x4 *const to = (f32x4 *)rgba, channel[4];
    for (int c = 0; c < 4; c++)
        channel[c] = *(const f32x4 *)(g->rgba[c] + first);
    const f32x4 rg[2] = {SHUFFLE(channel[0], channel[1], 0, 4, 1, 5), SHUFFLE(channel[0], channel[1], 2, 6, 3, 7)},
                ba[2] = {SHUFFLE(channel[2], channel[3], 0, 4, 1, 5), SHUFFLE(channel[2], channel[3], 2, 6, 3, 7)};
    for (int i = 0; i < 2; i++) {
        to[2 * i] = SHUFFLE(rg[i], ba[i], 0, 1, 4, 5);
        to[2 * i + 1] = SHUFFLE(rg[i], ba[i], 2, 3, 6, 7);
    }
}

/* Points of a group that lie in the patch. */
static void store_group(SheetsPatch *to, const SheetsPixels *g, int x0, int y0)
{
    const size_t width = (size_t)to->width, first = (size_t)y0 * width + (size_t)x0;
    if (x0 + SHEETS_SIDE <= to->width && y0 + SHEETS_SIDE <= to->height && !to->depth_mm) {
        for (int j = 0; j < SHEETS_SIDE; j++) {
            const size_t at = first + (size_t)j * width;
            store_row(to->rgba + 4 * at, g, SHEETS_SIDE * j);
            *(f32x4 *)(to->indicator + at) = *(const f32x4 *)(g->indicator + SHEETS_SIDE * j);
        }
        return;
    }
    for (int l = 0; l < SHEETS_LANES; l++) {
        const int x = l % SHEETS_SIDE, y = l / SHEETS_SIDE;
        if (x0 + x >= to->width || y0 + y >= to->height)
            continue;
        const size_t at = first + (size_t)y * width + (size_t)x;
        for (int c = 0; c < 4; c++)
            to->rgba[4 * at + (size_t)c] = g->rgba[c][l];
        to->indicator[at] = g->indicator[l];
        if (to->depth_mm)
            to->depth_mm[at] = g->depth_mm[l];
    }
}

static void march_group(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, int i, int j, const uint64_t *visible)
{
    SheetsPixels pixels;
    p->kernels->march(p->job, patch->grid, patch->x0 + i * patch->grid->pitch, patch->y0 + j * patch->grid->pitch,
                      visible, &pixels, &w->counts);
    store_group(patch, &pixels, i, j);
}

/* First and last pixel of n points from number `first` on. */
static void pixels_of(int origin, int pitch, int first, int n, int pixel[2])
{
    pixel[0] = origin + first * pitch;
    pixel[1] = pixel[0] + (n - 1) * pitch;
}

static bool find_visible(const Picturing *p, const SheetsPatch *patch, int i, int j, int across, int down,
                         const uint64_t *of, uint64_t *bits)
{
    int x[2], y[2];
    pixels_of(patch->x0, patch->grid->pitch, i, across, x);
    pixels_of(patch->y0, patch->grid->pitch, j, down, y);
    return p->kernels->find_visible(p->job, x, y, of, bits);
}

/* True if a point of the lattice within a tile of pixels is visible, so that the tile is not void. */
static bool any_point_visible(const SheetsPatch *lattice, int i0, int j0)
{
    for (int j = j0 / 2; j < (j0 + SHEETS_TILE_Y) / 2 && j < lattice->height; j++)
        for (int i = i0 / 2; i < (i0 + SHEETS_TILE_X) / 2 && i < lattice->width; i++)
            if (lattice->rgba[4 * ((size_t)j * (size_t)lattice->width + (size_t)i) + 3] > 0)
                return true;
    return false;
}

/* At level lattice pixels are interpolated where its points allow it: of a tile in which any is visible, visible blocks
 * are found for the first group that has to be marched. */
static void run_tile(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, int i0, int j0)
{
    const bool refines = p->job->lattice && patch->grid == &p->job->grid[0];
    bool found = !refines || !any_point_visible(&p->lattice, i0, j0);
    w->counts.tiles++;
    if (found && !find_visible(p, patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y, w->region, w->tile)) {
        w->counts.void_tiles++;
        return;
    }
    for (int j = j0; j < j0 + SHEETS_TILE_Y && j < patch->height; j += SHEETS_SIDE)
        for (int i = i0; i < i0 + SHEETS_TILE_X && i < patch->width; i += SHEETS_SIDE) {
            if (refines && cts_sheets_interpolate(patch, &p->lattice, i, j, cts_sheets_refined_from(p->scene),
                                                  p->job->view.slab_mm))
                continue;
            if (!found)
                find_visible(p, patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y, w->region, w->tile);
            found = true;
            march_group(p, w, patch, i, j, w->tile);
        }
}

static void run_region(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, int i0, int j0)
{
    const int i1 = cts_smaller_int(i0 + SHEETS_REGION, patch->width),
              j1 = cts_smaller_int(j0 + SHEETS_REGION, patch->height);
    if (!find_visible(p, patch, i0, j0, SHEETS_REGION, SHEETS_REGION, NULL, w->region)) {
        const int tiles =
            (i1 - i0 + SHEETS_TILE_X - 1) / SHEETS_TILE_X * ((j1 - j0 + SHEETS_TILE_Y - 1) / SHEETS_TILE_Y);
        w->counts.tiles += (uint64_t)tiles;
        w->counts.void_tiles += (uint64_t)tiles;
        return;
    }
    for (int j = j0; j < j1; j += SHEETS_TILE_Y)
        for (int i = i0; i < i1; i += SHEETS_TILE_X)
            run_tile(p, w, patch, i, j);
}

static int regions_along(int n)
{
    return (n + SHEETS_REGION - 1) / SHEETS_REGION;
}

static size_t n_regions(const SheetsPatch *patch)
{
    return (size_t)regions_along(patch->width) * (size_t)regions_along(patch->height);
}

static void run_patch(const Picturing *p, int worker, const SheetsPatch *patch, size_t first, size_t end)
{
    SheetsPatch to = *patch;
    const size_t across = (size_t)regions_along(patch->width);
    for (size_t i = first; i < end && !cts_scene_stopped(p->scene); i++)
        run_region(p, &p->workers[worker], &to, (int)(i % across) * SHEETS_REGION, (int)(i / across) * SHEETS_REGION);
}

/* Adds the contrast of a region once it and its neighbours of the strip are rendered, while they are in the cache.
 * Strip by strip, so that no band depends on another's pixels. */
static void finish_region(const Picturing *p, int i, int j)
{
    const SheetsPatch *const to = &p->pixels;
    const int across = regions_along(to->width), x0 = i * SHEETS_REGION, y0 = j * SHEETS_REGION;
    if (i >= 0 && i < across && atomic_fetch_sub(&p->regions_left[j * across + i], 1) == 1)
        cts_sheets_add_contrast(to, x0, cts_smaller_int(x0 + SHEETS_REGION, to->width), y0,
                                cts_smaller_int(y0 + SHEETS_REGION, to->height));
}

static void run_pixels(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    const size_t across = (size_t)regions_along(p->pixels.width);
    run_patch(p, worker, &p->pixels, first, end);
    for (size_t region = first; region < end; region++)
        for (int i = -1; i <= 1; i++)
            finish_region(p, (int)(region % across) + i, (int)(region / across));
}

static void run_lattice(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    run_patch(p, worker, &p->lattice, first, end);
}

static CtsStatus start_workers(SheetsWorker **workers, const SheetsJob *job, int n_threads, CtsError *err)
{
    const size_t words = (size_t)cts_sheets_words(job->blocks->n_layers);
    CtsStatus st = cts_alloc_zeroed(workers, (size_t)n_threads, err);
    for (int i = 0; i < n_threads && !st; i++) {
        SheetsWorker *const w = &(*workers)[i];
        if (!(st = cts_alloc_array(&w->region, words, err)))
            st = cts_alloc_array(&w->tile, words, err);
    }
    return st;
}

static void end_workers(SheetsWorker **workers, int n_threads, SheetsCounts *total)
{
    for (int i = 0; i < n_threads && *workers; i++) {
        SheetsWorker *const w = &(*workers)[i];
        const SheetsCounts *const c = &w->counts;
        total->groups += c->groups;
        total->sheets += c->sheets;
        total->slabs += c->slabs;
        total->lit += c->lit;
        total->tiles += c->tiles;
        total->void_tiles += c->void_tiles;
        cts_free(&w->region);
        cts_free(&w->tile);
    }
    cts_free(workers);
}

static void finish_depth(const SheetsPatch *p, double camera_mm)
{
    for (size_t i = 0; p->depth_mm && i < (size_t)p->width * (size_t)p->height; i++)
        p->depth_mm[i] = p->depth_mm[i] < SHEETS_FAR / 8 ? (float)(camera_mm + (double)p->depth_mm[i]) : INFINITY;
}

CtsStatus cts_sheets_run(const SheetsJob *job, const SheetsKernels *kernels, const CtsScene *scene, CtsPicture *picture,
                         float *indicator, SheetsCounts *total, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    Picturing p = {.job = job,
                   .kernels = kernels,
                   .scene = scene,
                   .pixels = {&job->grid[0], 0, picture->first_row, picture->width, picture->height, picture->pixels,
                              indicator, picture->depth_mm}};
    const size_t n = n_regions(&p.pixels), across = (size_t)regions_along(picture->width);
    CtsStatus st = start_workers(&p.workers, job, n_threads, err);
    if (!st)
        st = cts_alloc_array(&p.regions_left, n, err);
    for (size_t i = 0; !st && i < n; i++)
        atomic_init(&p.regions_left[i], 1 + (i % across > 0) + (i % across < across - 1));
    for (size_t i = 0; picture->depth_mm && i < (size_t)picture->width * (size_t)picture->height; i++)
        picture->depth_mm[i] = SHEETS_FAR;
    if (!st && job->lattice && !(st = cts_sheets_lattice_init(&p.lattice, job, &p.pixels, err)))
        cts_parallel(n_threads, n_regions(&p.lattice), 1, run_lattice, &p);
    if (!st) {
        cts_parallel(n_threads, n, 1, run_pixels, &p);
        finish_depth(&p.pixels, job->camera_mm);
        st = cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
    }
    cts_sheets_lattice_free(&p.lattice);
    cts_free(&p.regions_left);
    end_workers(&p.workers, n_threads, total);
    return st;
}

/* Tiles of their own. A group tests the blocks of its own rays, whatever tile or region it is part of. */
typedef struct TileProbing {
    Picturing picturing;
    const int (*corner)[2];
    float (*rgba)[4], *indicator;
} TileProbing;

static void probe_tile(const TileProbing *probing, int worker, size_t tile)
{
    enum { POINTS = SHEETS_POINTS(SHEETS_TILE_X) * SHEETS_POINTS(SHEETS_TILE_Y) };
    _Alignas(f32x4) float rgba[4 * POINTS] = {0}, indicator[POINTS + 1] = {0};
    Picturing p = probing->picturing;
    SheetsWorker *const w = &p.workers[worker];
    const size_t first = tile * SHEETS_TILE_X * SHEETS_TILE_Y;
    p.pixels = (SheetsPatch){.grid = &p.job->grid[0],
                             .x0 = probing->corner[tile][0],
                             .y0 = probing->corner[tile][1],
                             .width = SHEETS_TILE_X,
                             .height = SHEETS_TILE_Y,
                             .rgba = probing->rgba[first],
                             .indicator = probing->indicator + first};
    memset(p.pixels.rgba, 0, SHEETS_TILE_X * SHEETS_TILE_Y * sizeof *probing->rgba);
    memset(p.pixels.indicator, 0, SHEETS_TILE_X * SHEETS_TILE_Y * sizeof *probing->indicator);
    if (p.job->lattice) {
        p.lattice = cts_sheets_lattice_of(p.job, &p.pixels);
        p.lattice.rgba = rgba;
        p.lattice.indicator = indicator;
        run_region(&p, w, &p.lattice, 0, 0);
    }
    run_region(&p, w, &p.pixels, 0, 0);
    /* Neighbours outside the tile are not rendered: at its border contrast may be larger in the picture. */
    cts_sheets_add_contrast(&p.pixels, 0, SHEETS_TILE_X, 0, SHEETS_TILE_Y);
}

static void probe_some(void *context, int worker, size_t first, size_t end)
{
    const TileProbing *const p = context;
    for (size_t tile = first; tile < end && !cts_scene_stopped(p->picturing.scene); tile++)
        probe_tile(p, worker, tile);
}

CtsStatus cts_sheets_probe(const SheetsJob *job, const SheetsKernels *kernels, const CtsScene *scene,
                           const int (*corner)[2], size_t n, float (*rgba)[4], float *indicator, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    TileProbing p = {.picturing = {.job = job, .kernels = kernels, .scene = scene},
                     .corner = corner,
                     .rgba = rgba,
                     .indicator = indicator};
    SheetsCounts counts = {0};
    CtsStatus st = start_workers(&p.picturing.workers, job, n_threads, err);
    if (!st)
        cts_parallel(n_threads, n, 1, probe_some, &p);
    end_workers(&p.picturing.workers, n_threads, &counts);
    return st ? st : cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}
