/* A picture, region by region. */
#include "engine/sheets/lattice.h"

#include "base/mem.h"
#include "base/parallel.h"
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
    SheetsWorker *workers;
    SheetsPatch pixels, lattice;
    size_t first;             /* of the regions that are rendered together */
    atomic_int *regions_left; /* to render before the contrast of each of the pixels' regions */
} Picturing;

/* A row of a group: four channels of four pixels, transposed. */
static void take_row(const SheetsPixels *g, int first, f32x4 pixel[4])
{
    f32x4 channel[4];
    for (int c = 0; c < 4; c++)
        channel[c] = *(const f32x4 *)(g->rgba[c] + first);
    const f32x4 rg[2] = {SHUFFLE(channel[0], channel[1], 0, 4, 1, 5), SHUFFLE(channel[0], channel[1], 2, 6, 3, 7)},
                ba[2] = {SHUFFLE(channel[2], channel[3], 0, 4, 1, 5), SHUFFLE(channel[2], channel[3], 2, 6, 3, 7)};
    for (int i = 0; i < 2; i++) {
        pixel[2 * i] = SHUFFLE(rg[i], ba[i], 0, 1, 4, 5);
        pixel[2 * i + 1] = SHUFFLE(rg[i], ba[i], 2, 3, 6, 7);
    }
}

static void march_group(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, int i, int j, const uint64_t *visible)
{
    SheetsPixels pixels;
    f32x4 rgba[SHEETS_LANES];
    const int pitch = patch->grid->pitch;
    const SheetsGroup group = {p->job, patch->grid, patch->x0 + i * pitch, patch->y0 + j * pitch, visible, &w->counts};
    p->job->kernels->march(&group, &pixels);
    for (int l = 0; l < SHEETS_LANES; l += SHEETS_SIDE)
        take_row(&pixels, l, rgba + l);
    sheets_store(patch, i, j, rgba, pixels.indicator);
    for (int l = 0; patch->depth_mm && l < SHEETS_LANES; l++) {
        const int x = i + l % SHEETS_SIDE, y = j + l / SHEETS_SIDE;
        if (x < patch->width && y < patch->height)
            patch->depth_mm[y * patch->width + x] = pixels.depth_mm[l];
    }
}

/* Layers that so many points of a patch may see, from point (i, j) on. */
static bool find_visible(const Picturing *p, const SheetsPatch *patch, int i, int j, int across, int down,
                         const uint64_t *of, uint64_t *bits)
{
    const int pitch = patch->grid->pitch, x = patch->x0 + i * pitch, y = patch->y0 + j * pitch;
    return p->job->kernels->find_visible(p->job, (const int[]){x, x + (across - 1) * pitch},
                                         (const int[]){y, y + (down - 1) * pitch}, of, bits);
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
            if (refines && cts_sheets_interpolate(patch, &p->lattice, i, j, p->job))
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
    find_visible(p, patch, i0, j0, SHEETS_REGION, SHEETS_REGION, NULL, w->region);
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

static void run_regions(const Picturing *p, int worker, const SheetsPatch *patch, size_t first, size_t end)
{
    SheetsPatch to = *patch;
    const size_t across = (size_t)regions_along(patch->width);
    for (size_t i = first; i < end && !cts_scene_stopped(p->job->scene); i++)
        run_region(p, &p->workers[worker], &to, (int)(i % across) * SHEETS_REGION, (int)(i / across) * SHEETS_REGION);
}

/* Adds the contrast of a region's last row, or of the others, once the regions that these lie beside are rendered,
 * while they are in the cache. Strip by strip, so that no band depends on another's pixels. */
static void finish_rows(const Picturing *p, int i, int j, bool last)
{
    const SheetsPatch *const to = &p->pixels;
    const int across = regions_along(to->width), x0 = i * SHEETS_REGION, y0 = j * SHEETS_REGION,
              end = cts_smaller_int(y0 + SHEETS_REGION, to->height), rows = cts_strip_rows(to->width),
              first = y0 / rows * rows, strip[2] = {first, cts_smaller_int(first + rows, to->height)};
    if (i >= 0 && i < across && j >= 0 && y0 < to->height &&
        atomic_fetch_sub(&p->regions_left[2 * (j * across + i) + last], 1) == 1)
        cts_sheets_add_contrast(to, x0, cts_smaller_int(x0 + SHEETS_REGION, to->width), last ? end - 1 : y0,
                                last ? end : end - 1, strip);
}

static void run_pixels(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    const size_t across = (size_t)regions_along(p->pixels.width);
    for (size_t region = p->first + first; region < p->first + end; region++) {
        const int i = (int)(region % across), j = (int)(region / across);
        run_regions(p, worker, &p->pixels, region, region + 1);
        for (int beside = i - 1; beside <= i + 1; beside++) {
            finish_rows(p, beside, j, false);
            finish_rows(p, beside, j + 1, false);
            finish_rows(p, beside, j - 1, true);
            finish_rows(p, beside, j, true);
        }
    }
}

static void run_lattice(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    run_regions(p, worker, &p->lattice, p->first + first, p->first + end);
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

/* Regions first to end - 1 of a patch; p->first: the first of them. */
static void run_part(Picturing *p, int n_threads, size_t first, size_t end, cts_work_fn run)
{
    p->first = first;
    cts_parallel(n_threads, end - first, 1, run, p);
}

/* Renders so many rows of regions at a time, each after the points that its pixels lie between: they are in the cache
 * still. More threads take more rows at a time. */
static void run_by_rows(Picturing *p, int n_threads)
{
    const size_t n = n_regions(&p->pixels), n_points = n_regions(&p->lattice),
                 across = (size_t)regions_along(p->pixels.width),
                 points_across = (size_t)regions_along(p->lattice.width), rows = 2 * ((size_t)n_threads / 4 + 1);
    for (size_t row = 0, done = 0; row * across < n; row += rows) {
        /* A region of points lies under two of pixels each way, and the next one's first points under their last. */
        const size_t last = cts_smaller_size((row + rows + 2) / 2 * points_across, n_points);
        run_part(p, n_threads, done, last, run_lattice);
        done = last;
        run_part(p, n_threads, row * across, cts_smaller_size((row + rows) * across, n), run_pixels);
    }
}

/* Renders a patch whose depths, if it has any, are infinite. */
static CtsStatus run_patch(const SheetsJob *job, const SheetsPatch *pixels, int n_threads, SheetsCounts *total,
                           CtsError *err)
{
    Picturing p = {.job = job, .pixels = *pixels};
    const size_t n = n_regions(pixels), across = (size_t)regions_along(pixels->width);
    CtsStatus st;
    if ((st = start_workers(&p.workers, job, n_threads, err)) || (st = cts_alloc_array(&p.regions_left, 2 * n, err)) ||
        (job->lattice && (st = cts_sheets_lattice_init(&p.lattice, job, pixels, err))))
        goto end;
    for (size_t i = 0; i < n; i++) {
        const int columns = 1 + (i % across > 0) + (i % across < across - 1);
        atomic_init(&p.regions_left[2 * i], columns * (1 + (i >= across)));
        atomic_init(&p.regions_left[2 * i + 1], columns * (1 + (i + across < n)));
    }
    if (job->lattice)
        run_by_rows(&p, n_threads);
    else
        run_part(&p, n_threads, 0, n, run_pixels);
    for (size_t i = 0; pixels->depth_mm && i < (size_t)pixels->width * (size_t)pixels->height; i++)
        pixels->depth_mm[i] = (float)(job->camera_mm + (double)pixels->depth_mm[i]);
    st = cts_scene_stopped(job->scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
end:
    cts_sheets_lattice_free(&p.lattice);
    cts_free(&p.regions_left);
    end_workers(&p.workers, n_threads, total);
    return st;
}

CtsStatus cts_sheets_run(const SheetsJob *job, CtsPicture *picture, float *indicator, SheetsCounts *total,
                         CtsError *err)
{
    const SheetsPatch pixels = {&job->grid[0],   0,         picture->first_row, picture->width, picture->height,
                                picture->pixels, indicator, picture->depth_mm};
    return run_patch(job, &pixels, job->scene->settings->n_threads, total, err);
}

/* Tiles of their own, each by one thread. A group tests the blocks of its own rays, whatever tile or region it is part
 * of. */
typedef struct TileProbing {
    const SheetsJob *job;
    const int (*corner)[2];
    float (*rgba)[4], *indicator;
    _Atomic CtsStatus failure;
} TileProbing;

static void probe_some(void *context, int worker, size_t first, size_t end)
{
    enum { TILE = SHEETS_TILE_X * SHEETS_TILE_Y };
    TileProbing *const p = context;
    (void)worker;
    for (size_t tile = first; tile < end; tile++) {
        SheetsCounts counts = {0};
        /* Neighbours outside the tile are not rendered: at its border contrast may be larger in the picture. */
        const SheetsPatch pixels = {.grid = &p->job->grid[0],
                                    .x0 = p->corner[tile][0],
                                    .y0 = p->corner[tile][1],
                                    .width = SHEETS_TILE_X,
                                    .height = SHEETS_TILE_Y,
                                    .rgba = p->rgba[tile * TILE],
                                    .indicator = p->indicator + tile * TILE};
        memset(pixels.rgba, 0, TILE * sizeof *p->rgba);
        memset(pixels.indicator, 0, TILE * sizeof *p->indicator);
        const CtsStatus st = run_patch(p->job, &pixels, 1, &counts, NULL);
        if (st)
            p->failure = st;
    }
}

CtsStatus cts_sheets_probe(const SheetsJob *job, const int (*corner)[2], size_t n, float (*rgba)[4], float *indicator,
                           CtsError *err)
{
    TileProbing p = {job, corner, rgba, indicator, CTS_OK};
    cts_parallel(job->scene->settings->n_threads, n, 1, probe_some, &p);
    return p.failure ? cts_fail(err, p.failure, p.failure == CTS_ERR_MEMORY ? "out of memory" : "interrupted") : CTS_OK;
}
