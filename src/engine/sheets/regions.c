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
    float *extremes;         /* of rows of pixels: SheetsExtremes */
} Worker;

/* A rectangle of pixels, or of every second one each way, whose first is pixel (x0, y0) of the view; rows from the top,
 * one after the other. */
typedef struct Patch {
    const SheetsGrid *grid;
    int x0, y0, width, height;
    float *rgba;      /* premultiplied, zeroed before */
    float *indicator; /* zeroed before */
    float *depth_mm; /* from the plane through the view's centre, FAR_AWAY where nothing is visible; NULL: not wanted */
} Patch;
#define FAR_AWAY 1e30F

typedef struct Picturing {
    const SheetsJob *job;
    const SheetsKernels *kernels;
    const CtsScene *scene;
    Worker *workers;
    Patch pixels, lattice;
} Picturing;

static int at_most(int n, int most)
{
    return n < most ? n : most;
}

/* Points of a group that lie in the patch. */
static void store_group(Patch *to, const SheetsPixels *g, int x0, int y0)
{
    for (int l = 0; l < SHEETS_LANES; l++) {
        const int x = x0 + l % SHEETS_SIDE, y = y0 + l / SHEETS_SIDE;
        if (x >= to->width || y >= to->height)
            continue;
        const size_t at = (size_t)y * (size_t)to->width + (size_t)x;
        for (int c = 0; c < 4; c++)
            to->rgba[4 * at + (size_t)c] = g->rgba[c][l];
        to->indicator[at] = g->indicator[l];
        if (to->depth_mm)
            to->depth_mm[at] = g->depth_mm[l];
    }
}

static void march_group(const Picturing *p, Worker *w, Patch *patch, int i, int j, const uint64_t *visible)
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

static bool find_visible(const Picturing *p, const Patch *patch, int i, int j, int across, int down, const uint64_t *of,
                         uint64_t *bits)
{
    int x[2], y[2];
    pixels_of(patch->x0, patch->grid->pitch, i, across, x);
    pixels_of(patch->y0, patch->grid->pitch, j, down, y);
    return cts_sheets_visible(p->job, x, y, of, bits);
}

static void run_tile(const Picturing *p, Worker *w, Patch *patch, int i0, int j0)
{
    w->counts.tiles++;
    if (!find_visible(p, patch, i0, j0, SHEETS_TILE_X, SHEETS_TILE_Y, w->region, w->tile)) {
        w->counts.void_tiles++;
        return;
    }
    for (int j = j0; j < j0 + SHEETS_TILE_Y && j < patch->height; j += SHEETS_SIDE)
        for (int i = i0; i < i0 + SHEETS_TILE_X && i < patch->width; i += SHEETS_SIDE)
            march_group(p, w, patch, i, j, w->tile);
}

static void run_region(const Picturing *p, Worker *w, Patch *patch, int i0, int j0)
{
    const int i1 = at_most(i0 + SHEETS_REGION, patch->width), j1 = at_most(j0 + SHEETS_REGION, patch->height);
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

static size_t n_regions(const Patch *patch)
{
    return (size_t)regions_along(patch->width) * (size_t)regions_along(patch->height);
}

static void run_patch(const Picturing *p, int worker, const Patch *patch, size_t first, size_t end)
{
    Patch to = *patch;
    const size_t across = (size_t)regions_along(patch->width);
    for (size_t i = first; i < end && !cts_scene_stopped(p->scene); i++)
        run_region(p, &p->workers[worker], &to, (int)(i % across) * SHEETS_REGION, (int)(i / across) * SHEETS_REGION);
}

static void run_pixels(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    run_patch(p, worker, &p->pixels, first, end);
}

static void run_lattice(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    run_patch(p, worker, &p->lattice, first, end);
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

/* Largest difference of each pixel of row y to one of its eight neighbours, over channels. extremes: room for 12
 * (width + 2) numbers. */
static void add_row_contrast(const Patch *p, int y, int first, int end, float *extremes, float *indicator)
{
    const size_t n = 4 * (size_t)p->width;
    const float *const here = p->rgba + n * (size_t)y;
    const float *const above = y > first ? here - n : here, *const below = y + 1 < end ? here + n : here;
    float *const low = extremes + 4, *const high = extremes + n + 12, *const spread = extremes + 2 * n + 16;
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
    for (size_t i = 0; i < n; i++) {
        const float up = larger(larger((high - 4)[i], high[i + 4]), high[i]) - here[i];
        const float down = here[i] - smaller(smaller((low - 4)[i], low[i + 4]), low[i]);
        spread[i] = larger(up, down);
    }
    for (size_t x = 0; x < (size_t)p->width; x++) {
        const float *const s = spread + 4 * x;
        indicator[x] += CONTRAST_SHARE * larger(larger(s[0], s[1]), larger(s[2], s[3]));
    }
}

/* Strip by strip, so that no band sees another's pixels. */
static void add_contrast(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    const Patch *const to = &p->pixels;
    for (size_t strip = first; strip < end; strip++) {
        const int y0 = (int)strip * SHEETS_REGION, y1 = at_most(y0 + SHEETS_REGION, to->height);
        for (int y = y0; y < y1; y++)
            add_row_contrast(to, y, y0, y1, p->workers[worker].extremes, to->indicator + (size_t)y * (size_t)to->width);
    }
}

static CtsStatus start_workers(Worker **workers, const SheetsJob *job, int width, int n_threads, CtsError *err)
{
    const size_t words = (size_t)cts_sheets_words(job->blocks->n_layers);
    CtsStatus st = cts_alloc_zeroed(workers, (size_t)n_threads, err);
    for (int i = 0; i < n_threads && !st; i++) {
        Worker *const w = &(*workers)[i];
        if (!(st = cts_alloc_array(&w->region, words, err)) && !(st = cts_alloc_array(&w->tile, words, err)))
            st = cts_alloc_array(&w->extremes, 12 * ((size_t)width + 2), err);
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

/* The lattice: every second pixel each way is marched. Between four marched ones the others are interpolated, unless
 * these differ by so much that the group of pixels is marched. */

/* Points of a lattice that hold n pixels between them, with one point beyond the last pixel. */
static int lattice_points(int n)
{
    return n / 2 + 1;
}

/* Difference of neighbours, in requested errors, from which the pixels between them are marched: bilinear interpolation
 * is off by an eighth of the change of slope, so that a difference of eight requested errors is off by about one; such
 * pixels are few. And the least such difference: below it as many groups are marched as without a lattice (measured on
 * heads and a chest). */
#define REFINED_FROM 8.0
#define MIN_REFINED (24.0 / 255)
/* Error of an interpolated pixel as a share of the difference of the marched ones around it. */
#define INTERPOLATED_SHARE 0.25F

static float range_of(const float *const corner[], int n)
{
    float most = 0;
    for (int c = 0; c < 4; c++) {
        float low = corner[0][c], high = corner[0][c];
        for (int i = 1; i < n; i++) {
            low = smaller(low, corner[i][c]);
            high = larger(high, corner[i][c]);
        }
        most = larger(most, high - low);
    }
    return most;
}

/* Pixel of a patch as the mean of n (1, 2 or 4) marched ones. Where these see nothing, or lie far apart in depth, the
 * first one's depth stands for them. */
static void interpolate(Patch *to, size_t at, const Patch *from, const size_t corner[], int n)
{
    const float *rgba[4];
    const float share = 1 / (float)n;
    float indicator = 0, depth_mm = 0;
    for (int i = 0; i < n; i++) {
        rgba[i] = from->rgba + 4 * corner[i];
        indicator += from->indicator[corner[i]] * share;
    }
    for (int c = 0; c < 4; c++) {
        float sum = 0;
        for (int i = 0; i < n; i++)
            sum += rgba[i][c];
        to->rgba[4 * at + (size_t)c] = sum * share;
    }
    to->indicator[at] = indicator + INTERPOLATED_SHARE * range_of(rgba, n);
    if (!to->depth_mm)
        return;
    for (int i = 0; i < n; i++)
        depth_mm += from->depth_mm[corner[i]] * share;
    to->depth_mm[at] = depth_mm < FAR_AWAY / 8 ? depth_mm : from->depth_mm[corner[0]];
}

/* The 4 x 4 pixels of a group between 3 x 3 points of the lattice. */
static void interpolate_group(Patch *to, const Patch *from, int x0, int y0)
{
    const size_t across = (size_t)from->width;
    for (int j = 0; j < SHEETS_SIDE && y0 + j < to->height; j++)
        for (int i = 0; i < SHEETS_SIDE && x0 + i < to->width; i++) {
            const size_t at = (size_t)((y0 + j) / 2) * across + (size_t)((x0 + i) / 2);
            const size_t corner[3][4] = {{at, at + 1}, {at, at + across}, {at, at + 1, at + across, at + across + 1}};
            const bool right = i & 1, below = j & 1;
            interpolate(to, (size_t)(y0 + j) * (size_t)to->width + (size_t)(x0 + i), from,
                        corner[right && below ? 2 : below],
                        right && below   ? 4
                        : right || below ? 2
                                         : 1);
        }
}

/* True if depth bends by more than half a slab between 3 x 3 points of the lattice, of those that have a depth. */
static bool bends(const Patch *from, size_t at, double slab_mm)
{
    const size_t across = (size_t)from->width;
    for (int i = 0; i < 3; i++)
        for (int down = 0; down < 2; down++) {
            const size_t step = down ? across : 1;
            const float *const d = from->depth_mm + at + (size_t)i * (down ? 1 : across);
            const double bend = (double)d[0] - 2 * (double)d[step] + (double)d[2 * step];
            if (fabs(bend) > slab_mm / 2 && fabs(bend) < (double)FAR_AWAY / 8)
                return true;
        }
    return false;
}

static void refine_group(const Picturing *p, Worker *w, Patch *to, int x0, int y0, float refined_from)
{
    const Patch *const from = &p->lattice;
    const float *corner[9];
    bool any = false;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) {
            const int x = at_most(x0 / 2 + i, from->width - 1), y = at_most(y0 / 2 + j, from->height - 1);
            const size_t at = (size_t)y * (size_t)from->width + (size_t)x;
            corner[3 * j + i] = from->rgba + 4 * at;
            any |= from->rgba[4 * at + 3] > 0 || from->indicator[at] > 0;
        }
    const size_t at = (size_t)(y0 / 2) * (size_t)from->width + (size_t)(x0 / 2);
    const bool has_nine = x0 / 2 + 2 < from->width && y0 / 2 + 2 < from->height;
    if (any && range_of(corner, 9) <= refined_from &&
        !(from->depth_mm && has_nine && bends(from, at, p->job->view.slab_mm)))
        interpolate_group(to, from, x0, y0);
    else if (any && find_visible(p, to, x0, y0, SHEETS_SIDE, SHEETS_SIDE, NULL, w->tile))
        march_group(p, w, to, x0, y0, w->tile);
}

static float refined_from(const CtsScene *scene)
{
    return (float)fmax(REFINED_FROM * cts_scene_requested_error(scene), MIN_REFINED);
}

/* Rows of groups of the pixels. */
static void refine_rows(void *context, int worker, size_t first, size_t end)
{
    const Picturing *const p = context;
    Patch to = p->pixels;
    for (size_t row = first; row < end && !cts_scene_stopped(p->scene); row++)
        for (int x0 = 0; x0 < to.width; x0 += SHEETS_SIDE)
            refine_group(p, &p->workers[worker], &to, x0, (int)row * SHEETS_SIDE, refined_from(p->scene));
}

static void end_lattice(Patch *l)
{
    cts_free(&l->rgba);
    cts_free(&l->indicator);
    cts_free(&l->depth_mm);
}

/* The lattice of a patch; its points are functions of their place alone, so that no band or tile sees its borders. */
static CtsStatus begin_lattice(Patch *l, const SheetsJob *job, const Patch *pixels, CtsError *err)
{
    CtsStatus st;
    *l = (Patch){.grid = &job->grid[1],
                 .x0 = pixels->x0,
                 .y0 = pixels->y0,
                 .width = lattice_points(pixels->width),
                 .height = lattice_points(pixels->height)};
    const size_t n = (size_t)l->width * (size_t)l->height;
    if ((st = cts_alloc_zeroed(&l->rgba, 4 * n, err)) || (st = cts_alloc_zeroed(&l->indicator, n, err)) ||
        (pixels->depth_mm && (st = cts_alloc_array(&l->depth_mm, n, err))))
        return st;
    for (size_t i = 0; l->depth_mm && i < n; i++)
        l->depth_mm[i] = FAR_AWAY;
    return CTS_OK;
}

static void finish_depth(const Patch *p, double camera_mm)
{
    for (size_t i = 0; p->depth_mm && i < (size_t)p->width * (size_t)p->height; i++)
        p->depth_mm[i] = p->depth_mm[i] < FAR_AWAY / 8 ? (float)(camera_mm + (double)p->depth_mm[i]) : INFINITY;
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
    const size_t down = (size_t)regions_along(picture->height);
    const size_t rows = ((size_t)picture->height + SHEETS_SIDE - 1) / SHEETS_SIDE;
    CtsStatus st = start_workers(&p.workers, job, picture->width, n_threads, err);
    for (size_t i = 0; picture->depth_mm && i < (size_t)picture->width * (size_t)picture->height; i++)
        picture->depth_mm[i] = FAR_AWAY;
    if (!st && job->lattice && !(st = begin_lattice(&p.lattice, job, &p.pixels, err))) {
        cts_parallel(n_threads, n_regions(&p.lattice), 1, run_lattice, &p);
        cts_parallel(n_threads, rows, 4, refine_rows, &p);
    } else if (!st) {
        cts_parallel(n_threads, n_regions(&p.pixels), 1, run_pixels, &p);
    }
    if (!st) {
        cts_parallel(n_threads, down, 1, add_contrast, &p);
        finish_depth(&p.pixels, job->camera_mm);
        st = cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
    }
    end_lattice(&p.lattice);
    end_workers(&p.workers, n_threads, total);
    return st;
}

/* Tiles of their own. A group looks at the blocks that it sees itself, whatever tile or region it is part of. */
typedef struct Probing {
    Picturing picturing;
    const int (*corner)[2];
    float (*rgba)[4], *indicator;
    CtsStatus *status;
    CtsError *err;
} Probing;

static CtsStatus probe_tile(const Probing *probing, int worker, size_t tile, CtsError *err)
{
    Picturing p = probing->picturing;
    Worker *const w = &p.workers[worker];
    const size_t first = tile * SHEETS_TILE_X * SHEETS_TILE_Y;
    CtsStatus st = CTS_OK;
    p.pixels = (Patch){.grid = &p.job->grid[0],
                       .x0 = probing->corner[tile][0],
                       .y0 = probing->corner[tile][1],
                       .width = SHEETS_TILE_X,
                       .height = SHEETS_TILE_Y,
                       .rgba = probing->rgba[first],
                       .indicator = probing->indicator + first};
    memset(p.pixels.rgba, 0, SHEETS_TILE_X * SHEETS_TILE_Y * sizeof *probing->rgba);
    memset(p.pixels.indicator, 0, SHEETS_TILE_X * SHEETS_TILE_Y * sizeof *probing->indicator);
    if (!p.job->lattice) {
        run_region(&p, w, &p.pixels, 0, 0);
    } else if (!(st = begin_lattice(&p.lattice, p.job, &p.pixels, err))) {
        run_region(&p, w, &p.lattice, 0, 0);
        for (int y = 0; y < SHEETS_TILE_Y; y += SHEETS_SIDE)
            for (int x = 0; x < SHEETS_TILE_X; x += SHEETS_SIDE)
                refine_group(&p, w, &p.pixels, x, y, refined_from(p.scene));
    }
    end_lattice(&p.lattice);
    /* Neighbours outside the tile are not rendered; a picture's contrast is as large or larger at the tile's border. */
    for (int y = 0; y < SHEETS_TILE_Y && !st; y++)
        add_row_contrast(&p.pixels, y, 0, SHEETS_TILE_Y, w->extremes, p.pixels.indicator + y * SHEETS_TILE_X);
    return st;
}

static void probe_some(void *context, int worker, size_t first, size_t end)
{
    const Probing *const p = context;
    for (size_t tile = first; tile < end && !cts_scene_stopped(p->picturing.scene); tile++)
        if (!p->status[worker])
            p->status[worker] = probe_tile(p, worker, tile, &p->err[worker]);
}

CtsStatus cts_sheets_probe(const SheetsJob *job, const SheetsKernels *kernels, const CtsScene *scene,
                           const int (*corner)[2], size_t n, float (*rgba)[4], float *indicator, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    Probing p = {.picturing = {.job = job, .kernels = kernels, .scene = scene},
                 .corner = corner,
                 .rgba = rgba,
                 .indicator = indicator};
    SheetsCounts counts = {0};
    CtsStatus st = start_workers(&p.picturing.workers, job, SHEETS_TILE_X, n_threads, err);
    if (!st && !(st = cts_alloc_zeroed(&p.status, (size_t)n_threads, err)) &&
        !(st = cts_alloc_zeroed(&p.err, (size_t)n_threads, err)))
        cts_parallel(n_threads, n, 1, probe_some, &p);
    for (int i = 0; i < n_threads && !st; i++)
        if ((st = p.status[i]))
            *err = p.err[i];
    cts_free(&p.status);
    cts_free(&p.err);
    end_workers(&p.picturing.workers, n_threads, &counts);
    return st ? st : cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}
