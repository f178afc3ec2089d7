/* The rays of a tile are marched as one list; those of a draft in two, for where a few pixels are alike they stand for
 * all between them. */
#include "engine/tiled/tiles.h"

#include "base/chance.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

enum { TILE = 32, SQUARE = 4, SQUARES = TILE / SQUARE, PART = TILE / 4 };
_Static_assert(TILE *TILE == TILED_RAYS, "a tile is a list of rays");
_Static_assert(CTS_BAND_ROWS % TILE == 0, "a band of rows is whole tiles, or the picture would depend on it");

typedef struct Tiles {
    const TiledJob *job;
    cts_tiled_march_fn march;
    const CtsScene *scene;
    CtsPicture *picture;
    TiledScratch *scratch; /* of each worker */
    int across;
} Tiles;

/* n: its pixels each way, fewer at the picture's edges. */
typedef struct Tile {
    const Tiles *tiles;
    TiledScratch *scratch;
    int x0, y0, n[2];
    uint8_t known[TILE][TILE];
    double reach_mm[TILE / PART][TILE / PART]; /* of parts of it: where their rays may begin */
} Tile;

static int at_most(int n, int most)
{
    return n < most ? n : most;
}

static size_t place_of(const Tile *t, int x, int y)
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
        if (p->bound)
            p->bound[at] = rays->bound[i];
        if (p->depth_mm)
            p->depth_mm[at] = rays->depth_mm[i];
    }
    rays->n = 0;
}

static void find_reach(Tile *t)
{
    const int first_row = t->tiles->picture->first_row;
    for (int j = 0; j < TILE / PART; j++)
        for (int i = 0; i < TILE / PART; i++) {
            const int x = t->x0 + i * PART, y = first_row + t->y0 + j * PART;
            t->reach_mm[j][i] =
                cts_tiled_reach_mm(t->tiles->job, (const int[]){x, x + PART - 1}, (const int[]){y, y + PART - 1});
        }
}

/* A square's corners belong to its neighbours too; the last pixels of a tile end its last squares. */
typedef struct Square {
    int x[2], y[2];
    int within[2]; /* a pixel inside, anywhere, as what is thin and regular may miss all of a pattern's */
    bool alike, differs;
} Square;

static int corner(int square, int n)
{
    return square * SQUARE < n ? square * SQUARE : n - 1;
}

static Square square_of(const Tile *t, int number)
{
    const int i = number % SQUARES, j = number / SQUARES;
    Square s = {.x = {corner(i, t->n[0]), corner(i + 1, t->n[0])}, .y = {corner(j, t->n[1]), corner(j + 1, t->n[1])}};
    const uint64_t chance =
        cts_chance_bits((uint64_t)(t->tiles->picture->first_row + t->y0 + s.y[0]) << 32 | (uint64_t)(t->x0 + s.x[0]));
    s.within[0] = at_most(s.x[0] + 1 + (int)(chance >> 62) % 3, s.x[1]);
    s.within[1] = at_most(s.y[0] + 1 + (int)(chance >> 60 & 3) % 3, s.y[1]);
    return s;
}

/* Its corners and the pixel within, in this order. */
static void five_of(const Tile *t, const Square *s, size_t five[5])
{
    for (int i = 0; i < 4; i++)
        five[i] = place_of(t, s->x[i & 1], s->y[i >> 1]);
    five[4] = place_of(t, s->within[0], s->within[1]);
}

/* Where all are empty, what is thin would be lost that stands out most, and rays through nothing take no time: such a
 * square is neither alike nor different. */
static void compare_five(const Tile *t, Square *s)
{
    const float *const pixels = t->tiles->picture->pixels;
    size_t five[5];
    float off = 0, largest = 0;
    five_of(t, s, five);
    for (size_t c = 0; c < 4; c++) {
        float least = pixels[4 * five[0] + c], most = least;
        for (int i = 1; i < 5; i++) {
            const float v = pixels[4 * five[i] + c];
            least = v < least ? v : least;
            most = v > most ? v : most;
        }
        off = most - least > off ? most - least : off;
        largest = most;
    }
    s->differs = off > t->tiles->job->alike;
    s->alike = !s->differs && largest > 0;
}

/* What differs goes on next to it, often: its neighbours stand for nobody. And where most of a tile differs, what does
 * not is alike by chance. */
static void mind_others(Square *squares)
{
    int n_alike = 0, n_not = 0;
    for (int i = 0; i < SQUARES * SQUARES; i++) {
        const int x = i % SQUARES;
        const bool beside = squares[i].differs || (x > 0 && squares[i - 1].differs) ||
                            (x + 1 < SQUARES && squares[i + 1].differs) ||
                            (i >= SQUARES && squares[i - SQUARES].differs) ||
                            (i + SQUARES < SQUARES * SQUARES && squares[i + SQUARES].differs);
        squares[i].alike = squares[i].alike && !beside;
        n_alike += squares[i].alike;
        n_not += beside;
    }
    for (int i = 0; i < SQUARES * SQUARES; i++)
        squares[i].alike = squares[i].alike && n_alike > n_not;
}

static float part_of(int at, const int ends[2])
{
    return ends[1] > ends[0] ? (float)(at - ends[0]) / (float)(ends[1] - ends[0]) : 0;
}

/* What nobody marched lies between the corners; half of what they may differ by stands for what it may err by. */
static void fill(Tile *t, const Square *s)
{
    CtsPicture *const p = t->tiles->picture;
    size_t five[5];
    five_of(t, s, five);
    for (int y = s->y[0]; y <= s->y[1]; y++)
        for (int x = s->x[0]; x <= s->x[1]; x++) {
            if (t->known[y][x])
                continue;
            const float u = part_of(x, s->x), v = part_of(y, s->y);
            const size_t at = place_of(t, x, y);
            for (size_t c = 0; c < 4; c++) {
                const float a = p->pixels[4 * five[0] + c], b = p->pixels[4 * five[1] + c];
                const float d = p->pixels[4 * five[2] + c], e = p->pixels[4 * five[3] + c];
                const float ab = a + u * (b - a), de = d + u * (e - d);
                p->pixels[4 * at + c] = ab + v * (de - ab);
            }
            p->bound[at] = t->tiles->job->alike / 2;
            t->known[y][x] = true;
            t->scratch->counts.between++;
        }
}

static void list_square(Tile *t, const Square *s)
{
    for (int y = s->y[0]; y <= s->y[1]; y++)
        for (int x = s->x[0]; x <= s->x[1]; x++)
            list_pixel(t, x, y);
}

/* All at once: by squares, as what is side by side meets the same cells. */
static void run_whole(Tile *t)
{
    for (int i = 0; i < SQUARES * SQUARES; i++) {
        const Square s = square_of(t, i);
        list_square(t, &s);
    }
    march_listed(t);
}

static void run_draft(Tile *t)
{
    Square squares[SQUARES * SQUARES];
    for (int i = 0; i < SQUARES * SQUARES; i++) {
        const Square *const s = &squares[i];
        squares[i] = square_of(t, i);
        for (int k = 0; k < 4; k++)
            list_pixel(t, s->x[k & 1], s->y[k >> 1]);
        list_pixel(t, s->within[0], s->within[1]);
    }
    march_listed(t);
    for (int i = 0; i < SQUARES * SQUARES; i++)
        compare_five(t, &squares[i]);
    mind_others(squares);
    for (int i = 0; i < SQUARES * SQUARES; i++)
        if (!squares[i].alike)
            list_square(t, &squares[i]);
    march_listed(t);
    for (int i = 0; i < SQUARES * SQUARES; i++)
        if (squares[i].alike)
            fill(t, &squares[i]);
}

static void run_some_tiles(void *context, int worker, size_t first, size_t end)
{
    const Tiles *const tiles = context;
    const CtsPicture *const p = tiles->picture;
    const bool draft = tiles->job->alike > 0 && p->bound && !p->depth_mm;
    for (size_t tile = first; tile < end && !cts_scene_stopped(tiles->scene); tile++) {
        const int x0 = (int)tile % tiles->across * TILE, y0 = (int)tile / tiles->across * TILE;
        Tile t = {
            tiles,    &tiles->scratch[worker], x0, y0, {at_most(p->width - x0, TILE), at_most(p->height - y0, TILE)},
            {{false}}, {{0}}};
        find_reach(&t);
        t.scratch->rays.n = 0;
        (draft ? run_draft : run_whole)(&t);
    }
}

CtsStatus cts_tiled_run(const TiledJob *job, cts_tiled_march_fn march, const CtsScene *scene, CtsPicture *picture,
                        TiledCounts *total, CtsError *err)
{
    const int n_threads = scene->settings->n_threads;
    CtsStatus st;
    Tiles t = {job, march, scene, picture, NULL, (picture->width + TILE - 1) / TILE};
    if ((st = cts_alloc_zeroed(&t.scratch, (size_t)n_threads, err)))
        return st;
    const int down = (picture->height + TILE - 1) / TILE;
    cts_parallel(n_threads, (size_t)t.across * (size_t)down, 1, run_some_tiles, &t);
    for (int w = 0; w < n_threads; w++) {
        const TiledCounts *const c = &t.scratch[w].counts;
        total->skips += c->skips;
        total->pieces += c->pieces;
        total->lit += c->lit;
        total->between += c->between;
        total->ticks += c->ticks;
        total->shade_ticks += c->shade_ticks;
    }
    cts_free(&t.scratch);
    return cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}
