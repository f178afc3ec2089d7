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
    SheetsPatch patch[SHEETS_GRIDS]; /* the pixels; the points that they are interpolated from; likewise */
    size_t n_done[SHEETS_GRIDS];     /* regions of each that are rendered */
    int current;                     /* grid of which regions are being rendered, from n_done[current] on */
    atomic_int *regions_left;        /* to render before the contrast of each of the pixels' regions */
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

static uint8_t *may_show_at(const SheetsPatch *patch, int i, int j)
{
    return patch->may_show + j / SHEETS_SIDE * sheets_groups_along(patch->width) + i / SHEETS_SIDE;
}

static void march_group(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, int i, int j, const uint64_t *visible)
{
    SheetsPixels pixels;
    f32x4 rgba[SHEETS_LANES];
    const int pitch = patch->grid->pitch;
    const SheetsGroup group = {p->job, patch->grid, patch->x0 + i * pitch, patch->y0 + j * pitch, visible, &w->counts};
    const uint64_t before = w->counts.may_show;
    p->job->kernels->march(&group, &pixels);
    *may_show_at(patch, i, j) = w->counts.may_show > before;
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

/* Clears those pixels that lie in a patch of so many from (x0, y0) on. */
static void clear(SheetsPatch *patch, int x0, int y0, int across, int down)
{
    const size_t n = (size_t)cts_smaller_int(across, patch->width - x0);
    const int end = cts_smaller_int(y0 + down, patch->height);
    for (int y = y0; y < end; y++) {
        const size_t at = (size_t)y * (size_t)patch->width + (size_t)x0;
        memset(patch->rgba + 4 * at, 0, 4 * n * sizeof *patch->rgba);
        memset(patch->indicator + at, 0, n * sizeof *patch->indicator);
    }
}

/* At level lattice a grid is interpolated where the points of the next one allow it: of a tile in which any is visible,
 * visible blocks are found for the first group that has to be marched. */
static void run_tile(const Picturing *p, SheetsWorker *w, SheetsPatch *patch, const SheetsPatch *from, int i0, int j0)
{
    bool found = !from || !any_point_visible(from, i0, j0);
    w->counts.tiles++;
    if (found && !find_visible(p, patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y, w->region, w->tile)) {
        w->counts.void_tiles++;
        clear(patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y);
        return;
    }
    for (int j = j0; j < j0 + SHEETS_TILE_Y && j < patch->height; j += SHEETS_SIDE)
        for (int i = i0; i < i0 + SHEETS_TILE_X && i < patch->width; i += SHEETS_SIDE) {
            if (from && cts_sheets_is_void(from, i, j)) {
                clear(patch, i, j, SHEETS_SIDE, SHEETS_SIDE);
            } else if (from && cts_sheets_interpolate(patch, from, i, j, p->job)) {
                *may_show_at(patch, i, j) = patch->grid != &p->job->grid[0];
            } else {
                if (!found)
                    find_visible(p, patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y, w->region, w->tile);
                found = true;
                march_group(p, w, patch, i, j, w->tile);
            }
        }
}

static void run_region(const Picturing *p, SheetsWorker *w, int grid, int i0, int j0)
{
    SheetsPatch patch = p->patch[grid];
    const SheetsPatch *const from = grid < p->job->n_lattices ? &p->patch[grid + 1] : NULL;
    const int i1 = cts_smaller_int(i0 + SHEETS_REGION, patch.width),
              j1 = cts_smaller_int(j0 + SHEETS_REGION, patch.height);
    find_visible(p, &patch, i0, j0, SHEETS_REGION, SHEETS_REGION, NULL, w->region);
    for (int j = j0; j < j1; j += SHEETS_TILE_Y)
        for (int i = i0; i < i1; i += SHEETS_TILE_X)
            run_tile(p, w, &patch, from, i, j);
}

static int regions_along(int n)
{
    return (n + SHEETS_REGION - 1) / SHEETS_REGION;
}

static size_t n_regions(const SheetsPatch *patch)
{
    return (size_t)regions_along(patch->width) * (size_t)regions_along(patch->height);
}

/* Adds the contrast of a region's last row, or of the others, once the regions that these lie beside are rendered,
 * while they are in the cache. Strip by strip, so that no band depends on another's pixels. */
static void finish_rows(const Picturing *p, int i, int j, bool last)
{
    const SheetsPatch *const to = &p->patch[0];
    const int across = regions_along(to->width), x0 = i * SHEETS_REGION, y0 = j * SHEETS_REGION,
              end = cts_smaller_int(y0 + SHEETS_REGION, to->height), rows = cts_strip_rows(to->width),
              first = y0 / rows * rows, strip[2] = {first, cts_smaller_int(first + rows, to->height)};
    if (i >= 0 && i < across && j >= 0 && y0 < to->height &&
        atomic_fetch_sub(&p->regions_left[2 * (j * across + i) + last], 1) == 1)
        cts_sheets_add_contrast(to, x0, cts_smaller_int(x0 + SHEETS_REGION, to->width), last ? end - 1 : y0,
                                last ? end : end - 1, strip);
}

static void run_some(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    const size_t across = (size_t)regions_along(p->patch[p->current].width), before = p->n_done[p->current];
    for (size_t region = before + first; region < before + end && !cts_scene_stopped(p->job->scene); region++) {
        const int i = (int)(region % across), j = (int)(region / across);
        run_region(p, &p->workers[worker], p->current, i * SHEETS_REGION, j * SHEETS_REGION);
        for (int beside = i - 1; p->current == 0 && beside <= i + 1; beside++) {
            finish_rows(p, beside, j, false);
            finish_rows(p, beside, j + 1, false);
            finish_rows(p, beside, j - 1, true);
            finish_rows(p, beside, j, true);
        }
    }
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

/* Renders the pixels' rows of regions before row `end`, after the points that they lie between. */
static void run_until(Picturing *p, int n_threads, size_t end)
{
    size_t ends[SHEETS_GRIDS] = {end};
    /* A region of points lies under two of pixels each way, and the next one's first points under their last. */
    for (int i = 1; i <= p->job->n_lattices; i++)
        ends[i] = ends[i - 1] / 2 + 1;
    for (p->current = p->job->n_lattices; p->current >= 0; p->current--) {
        const SheetsPatch *const patch = &p->patch[p->current];
        size_t *const done = &p->n_done[p->current];
        const size_t last = cts_smaller_size(ends[p->current] * (size_t)regions_along(patch->width), n_regions(patch));
        if (last > *done)
            cts_parallel(n_threads, last - *done, 1, run_some, p);
        *done = last;
    }
}

/* Renders a patch whose depths, if it has any, are infinite. lattices: job->n_lattices, as cts_sheets_lattice_init()
 * takes them. */
static CtsStatus run_patch(const SheetsJob *job, const SheetsPatch *pixels, SheetsPatch lattices[], int n_threads,
                           SheetsCounts *total, CtsError *err)
{
    Picturing p = {.job = job, .patch = {*pixels}};
    const size_t n = n_regions(pixels), across = (size_t)regions_along(pixels->width), down = n / across;
    /* So many rows of regions at a time: the points between which they lie are in the cache still. More threads take
     * more. */
    const size_t rows = job->n_lattices ? 2 * ((size_t)n_threads / 4 + 1) : down;
    CtsStatus st;
    if ((st = start_workers(&p.workers, job, n_threads, err)) || (st = cts_alloc_array(&p.regions_left, 2 * n, err)) ||
        (st = cts_alloc_zeroed(&p.patch[0].may_show,
                               (size_t)sheets_groups_along(pixels->width) * (size_t)sheets_groups_along(pixels->height),
                               err)))
        goto end;
    for (int i = 0; i < job->n_lattices; i++) {
        if ((st = cts_sheets_lattice_init(&lattices[i], &p.patch[i], err)))
            goto end;
        p.patch[i + 1] = lattices[i];
    }
    for (size_t i = 0; i < n; i++) {
        const int columns = 1 + (i % across > 0) + (i % across < across - 1);
        atomic_init(&p.regions_left[2 * i], columns * (1 + (i >= across)));
        atomic_init(&p.regions_left[2 * i + 1], columns * (1 + (i + across < n)));
    }
    for (size_t row = rows; row < down + rows; row += rows)
        run_until(&p, n_threads, row);
    for (size_t i = 0; pixels->depth_mm && i < (size_t)pixels->width * (size_t)pixels->height; i++)
        pixels->depth_mm[i] = (float)(job->camera_mm + (double)pixels->depth_mm[i]);
    st = cts_scene_stopped(job->scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
end:
    cts_free(&p.regions_left);
    cts_free(&p.patch[0].may_show);
    end_workers(&p.workers, n_threads, total);
    return st;
}

CtsStatus cts_sheets_run(const SheetsJob *job, CtsPicture *picture, float *indicator, SheetsPatch lattices[],
                         SheetsCounts *total, CtsError *err)
{
    const SheetsPatch pixels = {.grid = &job->grid[0],
                                .y0 = picture->first_row,
                                .width = picture->width,
                                .height = picture->height,
                                .rgba = picture->pixels,
                                .indicator = indicator,
                                .depth_mm = picture->depth_mm};
    return run_patch(job, &pixels, lattices, job->scene->settings->n_threads, total, err);
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
        SheetsPatch lattices[SHEETS_GRIDS - 1] = {{0}};
        /* Neighbours outside the tile are not rendered: at its border contrast may be larger in the picture. */
        const SheetsPatch pixels = {.grid = &p->job->grid[0],
                                    .x0 = p->corner[tile][0],
                                    .y0 = p->corner[tile][1],
                                    .width = SHEETS_TILE_X,
                                    .height = SHEETS_TILE_Y,
                                    .rgba = p->rgba[tile * TILE],
                                    .indicator = p->indicator + tile * TILE};
        const CtsStatus st = run_patch(p->job, &pixels, lattices, 1, &counts, NULL);
        for (int i = 0; i < SHEETS_GRIDS - 1; i++)
            cts_sheets_lattice_free(&lattices[i]);
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
