#include "render/frames/level_choice.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/random.h"
#include "render/error/error_control.h"
#include "render/error/marched_groups.h"
#include <math.h>

enum {
    PROBES = 8, /* tiles in each direction, half as many in a preview's height, fewer in a small picture's: */
    PIXELS_PER_ROW =
        32768, /* of so many pixels one row of tiles, whose rendering then takes a thirty-second of theirs */
    SIDE = 4,  /* of SIDE x SIDE pixels of a tile one is compared */
    TILE = CTS_PROBE_X * CTS_PROBE_Y,
    IN_TILE = TILE / (SIDE * SIDE),
    ACROSS = CTS_PROBE_X / CTS_GROUP_SIDE,            /* groups of a tile in one row, */
    GROUPS = ACROSS * (CTS_PROBE_Y / CTS_GROUP_SIDE), /* and in all */
    /* Of so many visible groups level hybrid may march one: half-sheets take a quarter of the march's time, and marched
     * groups 1.3 times their share of it (measured on heads and a chest), so that more than half do not pay. */
    MARCHED_ONE_IN = 2,
};
/* Requested error, in 1/255, below which no level is tried: from 0.1 on they would take 0.8 to 0.9 of the march's time
 * in sum, but a speck that no sample sees, wrong by 8/255 in one pixel, is more than a limit then (engine/TRIED.md). */
#define MIN_REQUESTED 0.25
/* Requested error, in 1/255, below which level lattice is not tried: more than half of the groups of a head would be
 * marched and not interpolated, and it would cost more than sheets. A coarse lattice has points twice as far apart,
 * which differ by twice as much. */
#define MIN_LATTICE 3.0
#define MIN_COARSE_LATTICE (2 * MIN_LATTICE)
/* Voxels per pixel up to which there is a coarse one: no voxel lies between its points then, and windows of its groups
 * are hardly larger than 8 voxels. With coarser pixels rotations take 0.84 to 1.15 of the time with it. */
#define COARSE_LATTICE_VOXELS 0.5

/* Shares of the requested error up to which a probe's limit is trusted: a level that then misses costs the march of
 * many groups, up to 3 times a picture's time, the next one half as much again. Of 160 pictures of four series sheets
 * had a limit between 0.7 and 0.9 in 16, and missed in 12: with 0.7 all take 0.97 of the time. Of 72 at 8/255 lattices
 * had one between 0.5 and 0.7 in 11 and missed in one, between 0.7 and 0.9 in four and missed in two. */
#define SUFFICIENT 0.7
#define SUFFICIENT_HALF_SHEETS 0.9

/* Number of pixels below which tables, blocks and probes of a level (14 to 20 ms) cost more than it saves: the march of
 * 96 x 96 pixels takes 0.7 to 0.95 of the time, that of 160 x 160 as much (measured on heads and a chest). */
#define MIN_PIXELS 10000.0
/* Requested error from which a picture is a preview, whose pixels the march interpolates (INTERPOLATED_FROM,
 * engine/tiled/tiled.c), and voxels per pixel from which previews are marched: the windows of a level's groups exceed 8
 * voxels there and are gathered. The march takes 0.63 to 1.03 of the time at 2 voxels and more, 0.7 to 1.15 at 1.5, 0.9
 * to 1.4 at 1 (measured on the same, bone and skin). */
#define MIN_PREVIEW (4.0 / 255)
#define COARSE_VOXELS 1.5

typedef struct Probe {
    const CtsScene *scene;
    size_t n_tiles, n;
    int corner[PROBES * PROBES][2];
    int strip[PROBES * PROBES * IN_TILE];      /* whose error the pixel stands for */
    uint32_t at[PROBES * PROBES * IN_TILE];    /* place of a pixel within the tiles */
    uint32_t place[PROBES * PROBES * IN_TILE]; /* and within the picture */
    float (*truth)[4], *off, (*rgba)[4], *indicator;
    float group[PROBES * PROBES * GROUPS]; /* largest indicator of each group */
    size_t n_visible;
} Probe;

static int random_below(uint64_t number, int n)
{
    return (int)((cts_random_bits(number) >> 32) * (uint64_t)n >> 32);
}

static void add_tile(Probe *p, int strip, int x0, int y0)
{
    const CtsView *const v = &p->scene->view;
    for (int group = 0; group < IN_TILE; group++) {
        const uint64_t number = (uint64_t)(y0 + 1) << 40 | (uint64_t)(x0 + 1) << 16 | (uint64_t)(group + 1);
        const int pixel = random_below(number, SIDE * SIDE);
        const int i = group * SIDE % CTS_PROBE_X + pixel % SIDE, j = group * SIDE / CTS_PROBE_X * SIDE + pixel / SIDE;
        if (x0 + i >= v->width || y0 + j >= v->height)
            continue;
        p->strip[p->n] = strip;
        p->at[p->n] = (uint32_t)(p->n_tiles * TILE + (size_t)(j * CTS_PROBE_X + i));
        p->place[p->n++] = (uint32_t)(y0 + j) * (uint32_t)v->width + (uint32_t)(x0 + i);
    }
    p->corner[p->n_tiles][0] = x0;
    p->corner[p->n_tiles++][1] = y0;
}

static void place_probe(Probe *p)
{
    const CtsView *const v = &p->scene->view;
    const int across = (v->width + CTS_PROBE_X - 1) / CTS_PROBE_X, down = (v->height + CTS_PROBE_Y - 1) / CTS_PROBE_Y;
    const int64_t pixels = (int64_t)v->width * v->height, wanted = pixels / PIXELS_PER_ROW;
    const int most = cts_scene_requested_error(p->scene) < MIN_PREVIEW ? PROBES : PROBES / 2;
    const int rows = wanted < 1 ? 1 : wanted > most ? most : (int)wanted;
    for (int cell = 0; cell < PROBES * rows; cell++) {
        const int i = cell % PROBES, j = cell / PROBES;
        const int x0 = i * across / PROBES, nx = (i + 1) * across / PROBES - x0;
        const int y0 = j * down / rows, ny = (j + 1) * down / rows - y0;
        if (nx > 0 && ny > 0)
            add_tile(p, y0 * CTS_PROBE_Y / cts_strip_rows(v->width),
                     (x0 + random_below((uint64_t)cell * 2 + 1, nx)) * CTS_PROBE_X,
                     (y0 + random_below((uint64_t)cell * 2 + 2, ny)) * CTS_PROBE_Y);
    }
}

/* Number of the group that a pixel of the tiles lies in. */
static size_t group_of_pixel(size_t at)
{
    const size_t tile = at / TILE, x = at % CTS_PROBE_X, y = at % TILE / CTS_PROBE_X;
    return tile * GROUPS + y / CTS_GROUP_SIDE * ACROSS + x / CTS_GROUP_SIDE;
}

/* Largest indicator of each group, and the number of groups that see anything. */
static void find_groups(Probe *p)
{
    p->n_visible = 0;
    for (size_t i = 0; i < p->n_tiles * GROUPS; i++) {
        const float *const tile = p->indicator + i / GROUPS * TILE;
        const int x = (int)(i % ACROSS) * CTS_GROUP_SIDE, y = (int)(i % GROUPS / ACROSS) * CTS_GROUP_SIDE;
        p->group[i] = cts_group_indicator(tile, NULL, CTS_PROBE_X, CTS_PROBE_Y, x, y);
        p->n_visible += p->group[i] > 0;
    }
}

/* Predicts strip by strip, since error control meets the requested error in each. *limit: the largest of them. For
 * level hybrid, *n_marched: groups of the probe that have to be marched to meet the request. */
static CtsStatus predict(const Probe *p, bool hybrid, double *limit, size_t *n_marched, CtsError *err)
{
    float indicator[PROBES * PROBES * IN_TILE], group[PROBES * PROBES * IN_TILE];
    double square[PROBES * PROBES * IN_TILE];
    *limit = 0;
    *n_marched = 0;
    for (size_t first = 0, n; first < p->n; first += n) {
        for (n = 0; first + n < p->n && p->strip[first + n] == p->strip[first]; n++) {
            const uint32_t at = p->at[first + n];
            indicator[n] = p->indicator[at];
            group[n] = p->group[group_of_pixel(at)];
            square[n] = cts_scene_square_of_error(p->scene, p->rgba[at], p->truth[first + n]);
        }
        CtsErrorPrediction strip = {.n = n, .indicator = indicator, .group = hybrid ? group : NULL, .square = square};
        const CtsStatus st = cts_error_control_predict(p->scene, &strip, err);
        if (st)
            return st;
        *limit = fmax(*limit, strip.limit);
        const size_t first_tile = p->at[first] / TILE, last_tile = p->at[first + n - 1] / TILE;
        for (size_t i = first_tile * GROUPS; i < (last_tile + 1) * GROUPS; i++)
            *n_marched += p->group[i] > strip.marched_from;
    }
    return CTS_OK;
}

/* The tries, the cheapest first. */
static const struct Try {
    CtsEngineLevel level;
    bool coarse_lattice;
    double least;      /* requested error, in 1/255 */
    double sufficient; /* share of it up to which the limit is trusted */
} tries[] = {{CTS_LEVEL_LATTICE, true, MIN_COARSE_LATTICE, SUFFICIENT},
             {CTS_LEVEL_LATTICE, false, MIN_LATTICE, SUFFICIENT},
             {CTS_LEVEL_SHEETS, false, 0, SUFFICIENT},
             {CTS_LEVEL_HALF_SHEETS, false, 0, SUFFICIENT_HALF_SHEETS},
             {CTS_LEVEL_HYBRID, false, 0, 0}};
enum { N_TRIES = sizeof tries / sizeof *tries };

static CtsStatus try_levels(Probe *p, CtsLevelChoice *choice, const CtsEngine *engine, CtsError *err)
{
    const double requested = cts_scene_requested_error(p->scene);
    CtsScene scene = *p->scene;
    for (const struct Try *try = tries; try < tries + N_TRIES; try++) {
        CtsStatus st = CTS_OK;
        size_t n_marched = 0;
        const bool hybrid = try->level == CTS_LEVEL_HYBRID; /* its tiles are those of half-sheets */
        if (!(engine->levels >> try->level & 1) || 255 * requested < try->least ||
            (try->coarse_lattice && cts_scene_voxels_per_pixel(p->scene) > COARSE_LATTICE_VOXELS))
            continue;
        scene.plan.level = try->level;
        scene.plan.coarse_lattice = try->coarse_lattice;
        if (!hybrid)
            st = engine->render_tiles(&scene, (const int(*)[2])p->corner, p->n_tiles, p->rgba, p->indicator, err);
        if (st)
            return st;
        find_groups(p);
        choice->n_tried++;
        if ((st = predict(p, hybrid, &choice->limit, &n_marched, err)))
            return st;
        if (hybrid ? n_marched * MARCHED_ONE_IN <= p->n_visible : choice->limit <= try->sufficient * requested) {
            choice->level = try->level;
            choice->coarse_lattice = try->coarse_lattice;
            return CTS_OK;
        }
    }
    return CTS_OK;
}

/* Tells whether the march misses the error that the probe asked of it, by some pixels at reference precision: light
 * that it samples too coarsely is wrong everywhere alike, and error control, which takes the march for true up to that
 * error, would not find it. Twice that error counts, as few pixels are compared: of 80 pictures of six CT and an MR
 * series it errs by 0.01 to 1.2 times that error, on metal that occlusion darkens by 4.8 times. */
static CtsStatus check_march(const Probe *p, const CtsEngine *march, const CtsScene *scene, const CtsPicture *whole,
                             double error, CtsLevelChoice *choice, CtsError *err)
{
    enum { CHECKED = 32 };
    const double allowed = 2 * error;
    uint32_t place[CHECKED];
    float rgba[CHECKED][4], off[CHECKED];
    double sum = 0;
    const size_t n = p->n < CHECKED ? p->n : CHECKED;
    for (size_t i = 0; i < n; i++)
        place[i] = p->place[i * p->n / n];
    const CtsStatus st = march->render_pixels(scene, whole, place, n, 0, rgba, off, err);
    for (size_t i = 0; i < n && !st; i++)
        sum += cts_scene_square_of_error(scene, rgba[i], p->truth[i * p->n / n]);
    choice->march_misses = sum > (double)n * allowed * allowed;
    choice->march_error = n > 0 ? sqrt(sum / (double)n) : 0;
    return st;
}

static bool march_pays(const CtsScene *scene)
{
    return (double)scene->view.width * scene->view.height < MIN_PIXELS ||
           (cts_scene_requested_error(scene) >= MIN_PREVIEW && cts_scene_voxels_per_pixel(scene) > COARSE_VOXELS);
}

CtsStatus cts_level_choose(CtsLevelChoice *choice, const CtsEngine *engine, const CtsScene *scene,
                           const CtsEngine *march, const CtsScene *march_scene, bool may_march, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms(), requested = cts_scene_requested_error(scene);
    const CtsPicture whole = {
        .width = scene->view.width, .height = scene->view.height, .whole_height = scene->view.height};
    CtsScene sampled = *march_scene;
    CtsStatus st = CTS_OK;
    Probe *p = NULL;
    *choice = (CtsLevelChoice){.level = CTS_LEVEL_AUTO};
    if (255 * requested < MIN_REQUESTED || cts_scene_voxels_per_pixel(scene) > CTS_SCENE_COARSEST_PIXEL ||
        (may_march && march_pays(scene)))
        return CTS_OK;
    if ((st = cts_alloc_zeroed(&p, 1, err)))
        return st;
    sampled.plan.few_rays = true;
    p->scene = scene;
    place_probe(p);
    if ((st = cts_alloc_array(&p->truth, p->n, err)) || (st = cts_alloc_array(&p->off, p->n, err)) ||
        (st = cts_alloc_array(&p->rgba, p->n_tiles * TILE, err)) ||
        (st = cts_alloc_array(&p->indicator, p->n_tiles * TILE, err)) ||
        (st = march->render_pixels(&sampled, &whole, p->place, p->n, requested / 8, p->truth, p->off, err)))
        goto end;
    if (!(st = check_march(p, march, &sampled, &whole, requested / 8, choice, err)) && !choice->march_misses)
        st = try_levels(p, choice, engine, err);
    choice->n_pixels = p->n;
end:
    cts_free(&p->truth);
    cts_free(&p->off);
    cts_free(&p->rgba);
    cts_free(&p->indicator);
    cts_free(&p);
    choice->wall_ms = cts_wall_ms() - wall;
    choice->cpu_ms = cts_cpu_ms() - cpu;
    return st;
}
