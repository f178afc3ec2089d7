/* Openness (core/scene/openness.h) in front of an opaque wall: of an open plane, in a slit, at the bottom of a bowl. In
 * each of 26 directions the first wall is found by geometry, and light counts by how far that is. */
#include "lab/check/suite.h"

#include <math.h>
#include <stdlib.h>

/* Voxels of 1 mm, hence blocks of three; walls begin and end with blocks. Light is all ambient, so that a pixel is as
 * bright as its place is open. */
enum { BLOCK = 3, WIDE = 9, DEEP = 15, BACK = 10, FRONT = 4, MARGIN = 2, HALF = 2 };
#define REACH_MM 35.0

typedef struct OpennessCase {
    bool (*is_wall)(const int block[3]);
    bool slab; /* crop at the back wall: everything in front of it is left out */
    double occlusion;
    double bound[CHECK_N_FAMILIES];
} OpennessCase;

static bool is_plane(const int block[3])
{
    return block[1] >= BACK;
}

static bool is_slit(const int block[3])
{
    return block[1] >= BACK || block[1] <= FRONT;
}

static bool is_bowl(const int block[3])
{
    const int x = abs(block[0] - WIDE / 2), z = abs(block[2] - WIDE / 2);
    return block[1] >= BACK || (block[1] >= MARGIN && (x > HALF || z > HALF));
}

static double wall_hu(const double vox[3], const void *data)
{
    const OpennessCase *const c = data;
    const int block[3] = {(int)vox[0] / BLOCK, (int)vox[1] / BLOCK, (int)vox[2] / BLOCK};
    return c->is_wall(block) ? 1000 : -1000;
}

/* Mean over the directions of the share of the way that is free. */
static double openness_of(const OpennessCase *c, int y)
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
            if (inside && c->is_wall(at))
                break;
        }
        sum += (double)free / all;
    }
    return sum / 26;
}

static CtsStatus run_openness(CtsCheckRun *run, const void *data, CtsError *err)
{
    static const CtsCheckPoint step[] = {{0, 0, {1, 0.5, 0.25}}, {0, 1, {1, 0.5, 0.25}}};
    const OpennessCase *const c = data;
    const int dims[3] = {BLOCK * WIDE, BLOCK * DEEP, BLOCK * WIDE};
    const double spacing_mm[3] = {1, 1, 1};
    CtsPreset preset = cts_check_preset(step, 2);
    CtsRenderSettings s;
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    cts_render_defaults(&s);
    s.engine = run->engine;
    s.n_threads = 1;
    s.width = s.height = 3;
    s.mm_per_pixel = 0.1;
    s.slab_mm = c->slab ? 10 : 0;
    s.slab_at_mm = c->slab ? -4 : 0; /* from within the slit to behind the back wall's face */
    preset.shade = true;
    preset.ambient = 1;
    preset.power = 1;
    preset.occlusion = c->occlusion;
    CtsStatus st = cts_check_volume(&volume, dims, spacing_mm, 1, wall_hu, c, err);
    if (!st)
        st = cts_check_render(run, &(CtsModel){.volume = volume}, &preset, &s, &picture, err);
    if (!st) {
        /* HU pass the step halfway between voxels, there between two blocks; light ends 1/50 mm behind on average. */
        const double before = openness_of(c, BACK - 1), behind = openness_of(c, BACK);
        const double open = before + (behind - before) * (0.5 + 1 / CTS_MAX_EXTINCTION_PER_MM / BLOCK);
        const CtsCheckFamily family = cts_check_family(run->engine);
        const double bound = CHECK_OF_SHEETS >> run->engine & 1 ? CHECK_SHEETS_PIXEL : c->bound[family];
        cts_check_value(run, 1 - c->occlusion * (1 - open), (double)picture->pixels[4 * 4], bound);
    }
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    return st;
}

/* The field is in steps of 1/255; the paper's engines see the wall's first layer, half a voxel behind its face. */
#define STEPS .bound = {0.08, 4e-3, 2e-3}

static const CtsCheckCase cases[] = {
    CHECK_ROW("openness: a plane", CHECK_OF_ALL, run_openness, OpennessCase, is_plane, .occlusion = 1, STEPS),
    CHECK_ROW("openness: a plane, occlusion 0.3", CHECK_OF_ALL, run_openness, OpennessCase, is_plane, .occlusion = 0.3,
              STEPS),
    CHECK_ROW("openness: a slit", CHECK_OF_FIELDS | CHECK_OF_SHEETS, run_openness, OpennessCase, is_slit, .slab = true,
              .occlusion = 1, STEPS),
    CHECK_ROW("openness: a bowl", CHECK_OF_ALL, run_openness, OpennessCase, is_bowl, .occlusion = 1, STEPS),
};

const CtsCheckTable cts_check_openness = {cases, sizeof cases / sizeof *cases};
