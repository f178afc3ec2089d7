/* The rays of a tile are marched as one list; those of a preview in two: every fourth pixel in each direction and one
 * random pixel between each four of them, then every second or all, where the first ones show that interpolation is not
 * accurate enough. The randomly sampled pixels estimate the error of interpolated ones. */
#include "engine/tiled/tiles.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/random.h"
#include <math.h>

enum { TILE = 32, BLOCK = 4, BLOCKS = TILE / BLOCK, PART = TILE / 4, OTHERS = BLOCK * BLOCK - 1 };
/* Pixel blocks with an interpolation error above this multiple of the tolerance are marched completely. */
#define HALF_FROM 3.0f
_Static_assert(TILE *TILE == TILED_RAYS, "a tile is a list of rays");
_Static_assert(CTS_BAND_ROWS % TILE == 0, "a band of rows is whole tiles, or the picture would depend on it");

typedef struct Tiles {
    const TiledJob *job;
    cts_tiled_march_fn march;
    const CtsScene *scene;
    CtsPicture *picture;
    CtsErrorMap *errors;   /* NULL: not wanted */
    TiledScratch *scratch; /* of each worker */
    int across;
} Tiles;

/* n: width and height in pixels, less at the picture's edges. */
typedef struct Tile {
    const Tiles *tiles;
    TiledScratch *scratch;
    int x0, y0, n[2];
    uint8_t known[TILE][TILE];
    double reach_mm[TILE / PART][TILE / PART]; /* of its parts: distance at which their rays may begin */
} Tile;

static size_t index_of_pixel(const Tile *t, int x, int y)
{
    return (size_t)(t->y0 + y) * (size_t)t->tiles->picture->width + (size_t)(t->x0 + x);
}

static void list_pixel(Tile *t, int x, int y)
{
    if (t->known[y][x])
        return;
    t->known[y][x] = true;
    cts_tiled_add_ray(t->tiles->job, &t->scratch->rays, t->x0 + x, t->tiles->picture->first_row + t->y0 + y,
                      t->reach_mm[y / PART][x / PART]);
}

static void march_listed(Tile *t)
{
    CtsPicture *const p = t->tiles->picture;
    TiledRays *const rays = &t->scratch->rays;
    t->tiles->march(t->tiles->job, rays, &t->scratch->counts);
    for (int i = 0; i < rays->n; i++) {
        const size_t at = (size_t)(rays->y[i] - p->first_row) * (size_t)p->width + rays->x[i];
        for (int c = 0; c < 4; c++)
            p->pixels[4 * at + (size_t)c] = rays->rgba[i][c];
        if (t->tiles->errors)
            t->tiles->errors->indicator[at] = rays->bound[i];
        if (p->depth_mm)
            p->depth_mm[at] = rays->depth_mm[i];
    }
    rays->n = 0;
}

/* First all of them together. */
static void find_reach(Tile *t)
{
    const TiledJob *const job = t->tiles->job;
    const int first_row = t->tiles->picture->first_row + t->y0;
    const double all = cts_tiled_reach_mm(job, (const int[]){t->x0, t->x0 + TILE - 1},
                                          (const int[]){first_row, first_row + TILE - 1}, -INFINITY);
    for (int j = 0; j < TILE / PART; j++)
        for (int i = 0; i < TILE / PART; i++) {
            const int x = t->x0 + i * PART, y = first_row + j * PART;
            t->reach_mm[j][i] =
                cts_tiled_reach_mm(job, (const int[]){x, x + PART - 1}, (const int[]){y, y + PART - 1}, all);
        }
}

/* Pixels of a pixel block that have rays: its vertices and the random one, every second of every second row, or all. */
typedef enum BlockRays { FEW, HALF, ALL } BlockRays;

/* A pixel block of BLOCK x BLOCK pixels; it shares its vertices with its neighbours; the last pixels of a tile end
 * its last blocks. */
typedef struct PixelBlock {
    int x[2], y[2];
    int sample[2]; /* a random one of its other pixels, since thin regular structures may lie between all vertices */
    bool empty, empty_vertices;
    float plane_error, off; /* estimated interpolation error: by the vertices, and including the random pixel */
    BlockRays rays, rays_without_sample; /* rays_without_sample: those without the random pixel's information */
} PixelBlock;

static int corner(int square, int n)
{
    return square * BLOCK < n ? square * BLOCK : n - 1;
}

static PixelBlock block_of(const Tile *t, int number)
{
    const int i = number % BLOCKS, j = number / BLOCKS;
    PixelBlock s = {.x = {corner(i, t->n[0]), corner(i + 1, t->n[0])},
                    .y = {corner(j, t->n[1]), corner(j + 1, t->n[1])}};
    const uint64_t bits =
        cts_random_bits((uint64_t)(t->tiles->picture->first_row + t->y0 + s.y[0]) << 32 | (uint64_t)(t->x0 + s.x[0]));
    const int sample = 1 + (int)((bits >> 32) * OTHERS >> 32);
    s.sample[0] = cts_smaller_int(s.x[0] + sample % BLOCK, s.x[1]);
    s.sample[1] = cts_smaller_int(s.y[0] + sample / BLOCK, s.y[1]);
    return s;
}

static float part_of(int at, const int ends[2])
{
    return ends[1] > ends[0] ? (float)(at - ends[0]) / (float)(ends[1] - ends[0]) : 0;
}

/* The vertices of a rectangle of pixels, for interpolation between them. */
typedef struct BlockCorners {
    const float *at[4];
    int x[2], y[2];
} BlockCorners;

static BlockCorners corners_of(const Tile *t, const int x[2], const int y[2])
{
    BlockCorners k = {.x = {x[0], x[1]}, .y = {y[0], y[1]}};
    for (int i = 0; i < 4; i++)
        k.at[i] = t->tiles->picture->pixels + 4 * index_of_pixel(t, x[i & 1], y[i >> 1]);
    return k;
}

static float interpolate_pixel(const BlockCorners *k, int x, int y, size_t c)
{
    const float u = part_of(x, k->x), v = part_of(y, k->y);
    const float ab = k->at[0][c] + u * (k->at[1][c] - k->at[0][c]), de = k->at[2][c] + u * (k->at[3][c] - k->at[2][c]);
    return ab + v * (de - ab);
}

static const float *random_pixel(const Tile *t, const PixelBlock *b)
{
    return t->tiles->picture->pixels + 4 * index_of_pixel(t, b->sample[0], b->sample[1]);
}

/* Estimates the interpolation error by the random pixel, and by the distance of the vertices from one plane. */
static void measure_block(const Tile *t, PixelBlock *b)
{
    const BlockCorners k = corners_of(t, b->x, b->y);
    const float *const sample = random_pixel(t, b);
    float off = 0, largest = 0, corner = 0;
    for (size_t c = 0; c < 4; c++) {
        const float plane_error = (k.at[0][c] - k.at[1][c]) - (k.at[2][c] - k.at[3][c]);
        b->plane_error = fmaxf(b->plane_error, fabsf(plane_error) / 4);
        off = fmaxf(off, fabsf(sample[c] - interpolate_pixel(&k, b->sample[0], b->sample[1], c)));
        largest = fmaxf(largest, sample[c]);
        for (int i = 0; i < 4; i++)
            corner = fmaxf(corner, k.at[i][c]);
    }
    b->off = fmaxf(b->plane_error, off);
    b->empty_vertices = !(corner > 0);
    b->empty = b->empty_vertices && !(largest > 0);
}

static float worst_beside(const PixelBlock *blocks, int number)
{
    const int x = number % BLOCKS, y = number / BLOCKS;
    float worst = 0;
    for (int side = 0; side < 4; side++) {
        const int bx = x + (side == 0) - (side == 1), by = y + (side == 2) - (side == 3);
        if (bx >= 0 && bx < BLOCKS && by >= 0 && by < BLOCKS)
            worst = fmaxf(worst, blocks[by * BLOCKS + bx].off);
    }
    return worst;
}

/* Empty blocks are marched completely: isolated thin structures would be most visible there, and rays through empty
 * space are cheap. */
static BlockRays rays_of(const Tile *t, bool empty, float off)
{
    const float alike = t->tiles->job->interpolation_tolerance;
    return empty || off > HALF_FROM * alike ? ALL : off > alike ? HALF : FEW;
}

/* Neighbouring blocks have similar errors. And where the mean error of a tile is more than half of the tolerance,
 * smaller ones are probably random. */
static void choose_rays(const Tile *t, PixelBlock *blocks)
{
    float sum = 0;
    int n_filled = 0;
    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        sum += blocks[i].off;
        n_filled += !blocks[i].empty;
    }
    const float random_share = n_filled > 0 ? 2 / (float)n_filled : 0;
    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        PixelBlock *const b = &blocks[i];
        const float beside = worst_beside(blocks, i), without_sample = sum - b->off + b->plane_error;
        b->rays = rays_of(t, b->empty, fmaxf(fmaxf(b->off, beside), random_share * sum));
        b->rays_without_sample =
            rays_of(t, b->empty_vertices, fmaxf(fmaxf(b->plane_error, beside), random_share * without_sample));
    }
}

static int middle_of_ends(const int ends[2])
{
    return (ends[0] + ends[1] + 1) / 2;
}

static void queue_half_resolution(Tile *t, const PixelBlock *b)
{
    const int x[3] = {b->x[0], middle_of_ends(b->x), b->x[1]}, y[3] = {b->y[0], middle_of_ends(b->y), b->y[1]};
    for (int i = 0; i < 9; i++)
        list_pixel(t, x[i % 3], y[i / 3]);
}

/* Bilinear; if a vertex has no surface, the nearest vertex's depth. */
static float interpolate_depth(const Tile *t, const BlockCorners *k, int x, int y)
{
    const float u = part_of(x, k->x), v = part_of(y, k->y);
    float mm[4];
    bool all = true;
    for (int i = 0; i < 4; i++) {
        mm[i] = t->tiles->picture->depth_mm[index_of_pixel(t, k->x[i & 1], k->y[i >> 1])];
        all = all && isfinite(mm[i]);
    }
    const float ab = mm[0] + u * (mm[1] - mm[0]), de = mm[2] + u * (mm[3] - mm[2]);
    return all ? ab + v * (de - ab) : mm[(u > 0.5F) + 2 * (v > 0.5F)];
}

/* Interpolates the pixels that were not marched bilinearly from the vertices. */
static void interpolate_block(Tile *t, const int x[2], const int y[2])
{
    CtsPicture *const p = t->tiles->picture;
    CtsErrorMap *const errors = t->tiles->errors;
    const BlockCorners k = corners_of(t, x, y);
    for (int j = y[0]; j <= y[1]; j++)
        for (int i = x[0]; i <= x[1]; i++) {
            if (t->known[j][i])
                continue;
            const size_t at = index_of_pixel(t, i, j);
            for (size_t c = 0; c < 4; c++)
                p->pixels[4 * at + c] = interpolate_pixel(&k, i, j, c);
            errors->origin[at] = CTS_PIXEL_INTERPOLATED;
            errors->indicator[at] = HALF_FROM * t->tiles->job->interpolation_tolerance;
            if (p->depth_mm)
                p->depth_mm[at] = interpolate_depth(t, &k, i, j);
            t->known[j][i] = true;
            t->scratch->counts.interpolated++;
        }
}

static void half_of(const int ends[2], bool second, int half[2])
{
    half[0] = second ? middle_of_ends(ends) : ends[0];
    half[1] = second ? ends[1] : middle_of_ends(ends);
}

static void interpolate_half_resolution(Tile *t, const PixelBlock *b)
{
    for (int i = 0; i < 4; i++) {
        int x[2], y[2];
        half_of(b->x, i & 1, x);
        half_of(b->y, i >> 1, y);
        interpolate_block(t, x, y);
    }
}

/* The choice of the random pixel is independent of the rays its block would have without it. So its error, where it
 * would have been interpolated, is a sample of the interpolation error; its probability is 1 in OTHERS, and it is
 * weighted accordingly. */
static void estimate_interpolation_error(const Tile *t, const PixelBlock *b)
{
    if (b->rays_without_sample == ALL)
        return;
    int x[2] = {b->x[0], b->x[1]}, y[2] = {b->y[0], b->y[1]};
    if (b->rays_without_sample == HALF) {
        half_of(b->x, b->sample[0] > middle_of_ends(b->x), x);
        half_of(b->y, b->sample[1] > middle_of_ends(b->y), y);
    }
    const BlockCorners k = corners_of(t, x, y);
    float interpolated[4];
    for (size_t c = 0; c < 4; c++)
        interpolated[c] = interpolate_pixel(&k, b->sample[0], b->sample[1], c);
    const double square = cts_scene_square_of_error(t->tiles->scene, random_pixel(t, b), interpolated);
    const double term = (OTHERS - 1) * fmin(square, 1);
    const uint64_t weighted = (uint64_t)ceil(ldexp(term, 32));
    TiledCounts *const counts = &t->scratch->counts;
    counts->error_sum += weighted;
    counts->error_squares += (uint64_t)ceil(ldexp(term * term, 32));
    counts->largest_error = weighted > counts->largest_error ? weighted : counts->largest_error;
}

static void list_block(Tile *t, const PixelBlock *b)
{
    for (int y = b->y[0]; y <= b->y[1]; y++)
        for (int x = b->x[0]; x <= b->x[1]; x++)
            list_pixel(t, x, y);
}

/* All pixels at once, by pixel blocks, as neighbouring rays traverse the same cells. */
static void run_whole(Tile *t)
{
    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        const PixelBlock s = block_of(t, i);
        list_block(t, &s);
    }
    march_listed(t);
}

static void run_preview(Tile *t)
{
    PixelBlock blocks[BLOCKS * BLOCKS];
    for (int i = 0; i < BLOCKS * BLOCKS; i++) {
        const PixelBlock *const b = &blocks[i];
        blocks[i] = block_of(t, i);
        for (int k = 0; k < 4; k++)
            list_pixel(t, b->x[k & 1], b->y[k >> 1]);
        list_pixel(t, b->sample[0], b->sample[1]);
    }
    march_listed(t);
    for (int i = 0; i < BLOCKS * BLOCKS; i++)
        measure_block(t, &blocks[i]);
    choose_rays(t, blocks);
    for (int i = 0; i < BLOCKS * BLOCKS; i++)
        if (blocks[i].rays == ALL)
            list_block(t, &blocks[i]);
        else if (blocks[i].rays == HALF)
            queue_half_resolution(t, &blocks[i]);
    march_listed(t);
    for (int i = 0; i < BLOCKS * BLOCKS; i++)
        estimate_interpolation_error(t, &blocks[i]);
    for (int i = 0; i < BLOCKS * BLOCKS; i++)
        if (blocks[i].rays == HALF)
            interpolate_half_resolution(t, &blocks[i]);
        else if (blocks[i].rays == FEW)
            interpolate_block(t, blocks[i].x, blocks[i].y);
}

static void run_some_tiles(void *context, int worker, size_t first, size_t end)
{
    const Tiles *const tiles = context;
    const CtsPicture *const p = tiles->picture;
    const bool preview = tiles->job->interpolation_tolerance > 0 && tiles->errors;
    for (size_t tile = first; tile < end && !cts_scene_stopped(tiles->scene); tile++) {
        const int x0 = (int)tile % tiles->across * TILE, y0 = (int)tile / tiles->across * TILE;
        Tile t = {tiles,
                  &tiles->scratch[worker],
                  x0,
                  y0,
                  {cts_smaller_int(p->width - x0, TILE), cts_smaller_int(p->height - y0, TILE)},
                  {{false}},
                  {{0}}};
        find_reach(&t);
        t.scratch->rays.n = 0;
        (preview ? run_preview : run_whole)(&t);
    }
}

CtsStatus cts_tiled_run(const TiledJob *job, cts_tiled_march_fn march, const CtsScene *scene, CtsPicture *picture,
                        CtsErrorMap *errors, TiledCounts *total, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    CtsStatus st;
    Tiles t = {job, march, scene, picture, errors, NULL, (picture->width + TILE - 1) / TILE};
    if ((st = cts_alloc_zeroed(&t.scratch, (size_t)n_threads, err)))
        return st;
    const int down = (picture->height + TILE - 1) / TILE;
    cts_parallel(n_threads, (size_t)t.across * (size_t)down, 1, run_some_tiles, &t);
    for (int w = 0; w < n_threads; w++) {
        const TiledCounts *const c = &t.scratch[w].counts;
        total->skips += c->skips;
        total->segments += c->segments;
        total->queues += c->queues;
        total->interpolated += c->interpolated;
        total->error_sum += c->error_sum;
        total->error_squares += c->error_squares;
        total->largest_error = c->largest_error > total->largest_error ? c->largest_error : total->largest_error;
        total->ticks += c->ticks;
        total->shade_ticks += c->shade_ticks;
    }
    if (errors)
        errors->interpolation =
            (CtsTerms){ldexp((double)total->error_sum, -32), ldexp((double)total->error_squares, -32),
                       ldexp((double)total->largest_error, -32)};
    cts_free(&t.scratch);
    return cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}
