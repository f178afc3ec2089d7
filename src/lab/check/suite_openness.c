/* Openness (core/scene/openness.h) in front of an opaque wall: of an open plane, in a slit, at the bottom of a bowl. In
 * each of 26 directions the first wall is found by geometry, and light counts by how far that is. */
#include "lab/check/suite.h"

#include <math.h>
#include <stdlib.h>

/* Voxels of 1 mm, hence blocks of three; walls begin and end with blocks. Light is all ambient, so that a pixel is as
 * bright as its place is open. */
enum { BLOCK = 3, WIDE = 9, DEEP = 15, BACK = 10, FRONT = 4, MARGIN = 2, HALF = 2 };
#define REACH_MM 35.0

/* hu[0] of a scene; in front of the slit's back wall a crop leaves out everything. hu[1]: the occlusion. */
enum { PLANE, SLIT, BOWL };

static bool is_wall(int kind, const int block[3])
{
    const int x = abs(block[0] - WIDE / 2), z = abs(block[2] - WIDE / 2);
    return block[1] >= BACK || (kind == SLIT && block[1] <= FRONT) ||
           (kind == BOWL && block[1] >= MARGIN && (x > HALF || z > HALF));
}

static double wall_hu(const double vox[3], const void *data)
{
    const double *const hu = data;
    const int block[3] = {(int)vox[0] / BLOCK, (int)vox[1] / BLOCK, (int)vox[2] / BLOCK};
    return is_wall((int)hu[0], block) ? 1000 : -1000;
}

/* Mean over the directions of the share of the way that is free. */
static double openness_of(int wall, int y)
{
    double sum = 0;
    for (int code = 0; code < 27; code++) {
        const int way[3] = {code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1};
        const double step_mm = BLOCK * sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
        if (step_mm == 0)
            continue;
        const int all = (int)floor(REACH_MM / step_mm + 0.5);
        int free = 1;
        for (; free < all; free++) {
            const int at[3] = {WIDE / 2 + free * way[0], y + free * way[1], WIDE / 2 + free * way[2]};
            const bool inside = at[0] >= 0 && at[0] < WIDE && at[1] >= 0 && at[1] < DEEP && at[2] >= 0 && at[2] < WIDE;
            if (inside && is_wall(wall, at))
                break;
        }
        sum += (double)free / all;
    }
    return sum / 26;
}

static CtsStatus run_openness(CtsCheckRun *run, const void *data, CtsError *err)
{
    const CtsFormulaScene *const c = data;
    const int wall = (int)c->hu[0];
    CtsRenderedScene m;
    CtsPicture *picture = NULL;
    CtsStatus st = cts_check_make(run, c, &m, err);
    m.settings.slab_mm = wall == SLIT ? 10 : 0;
    m.settings.slab_at_mm = wall == SLIT ? -4 : 0; /* from within the slit to behind the back wall's face */
    m.preset.ambient = 1;
    m.preset.diffuse = m.preset.specular = 0;
    m.preset.occlusion = c->hu[1];
    if (!st)
        st = cts_check_render(run, &m.model, &m.preset, &m.settings, &picture, err);
    if (!st) {
        /* HU pass the step halfway between voxels, there between two blocks; light ends 1/50 mm behind on average. */
        const double before = openness_of(wall, BACK - 1), behind = openness_of(wall, BACK);
        const double open = before + (behind - before) * (0.5 + 1 / CTS_MAX_EXTINCTION_PER_MM / BLOCK);
        cts_check_value(run, 1 - c->hu[1] * (1 - open), (double)picture->pixels[4 * 4], cts_check_bound(run, c));
    }
    cts_picture_free(&picture);
    cts_model_free(&m.model);
    return st;
}

static const CtsCheckPoint step[] = {{0, 0, {1, 0.5, 0.25}}, {0, 1, {1, 0.5, 0.25}}};

/* The field is in steps of 1/255; the paper's engines see the wall's first layer, half a voxel behind its face. */
#define WALL(NAME, ENGINES, KIND, OCCLUSION)                                                                           \
    SCENE(NAME, ENGINES, run_openness, .dims = {BLOCK * WIDE, BLOCK * DEEP, BLOCK * WIDE}, .formula = wall_hu,         \
          .hu = {KIND, OCCLUSION}, POINTS(step), .lit = true, PIXELS(3, 3), .mm_per_pixel = 0.1,                       \
          .bound = {0.08, 4e-3, 2e-3})

static const CtsCheckCase cases[] = {
    WALL("openness: a plane", CHECK_OF_ALL, PLANE, 1),
    WALL("openness: a plane, occlusion 0.3", CHECK_OF_ALL, PLANE, 0.3),
    WALL("openness: a slit", CHECK_OF_FIELDS | CHECK_OF_SHEETS, SLIT, 1),
    WALL("openness: a bowl", CHECK_OF_ALL, BOWL, 1),
};

const CtsCheckTable cts_check_openness = {cases, sizeof cases / sizeof *cases};
