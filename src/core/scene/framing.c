#include "core/scene/framing.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "core/scene/view.h"
#include "core/volume/body_mask.h"
#include "core/volume/macrocells.h"
#include "core/volume/owners.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The share of the picture's tighter side that what is visible fills. */
#define FILLED 0.9
/* Parts of what is shown that have less than this share of it are specks. */
#define SPECK 0.001
/* Shown is what takes away 1/16 of the light: less is haze. Where nothing does, what 8 bits hold is shown; and in minip
 * and average, where no ray as a whole is brighter than black, what by itself is. */
static const double LEAST_OPACITY[] = {1.0 / 16, 1.0 / 255};
enum { N_LEAST = sizeof LEAST_OPACITY / sizeof *LEAST_OPACITY };
/* Rays of a look, along rows and columns. Their ends are half a ray's distance off, below 1 % where what is shown goes
 * over LEAST_FOUND of them; where it does not, there is a closer look. */
enum { LOOK = 128, LEAST_FOUND = LOOK / 2, MOST_LOOKS = 6 };
/* A part of so many rays, which tell little of its area, is looked at by so many for each, along rows and columns. */
enum { SURE = 16, FINER = 4 };
/* Every so many rays come first; between four that show something all do, as holes change no frame. */
enum { SPARSE = 4 };
/* Views of a rotation that are looked at: nothing reaches 1 % further in those between, 7.5 degrees off at most. */
enum { MOST_VIEWS = 24 };

/* Macro-cells are passed by GROUP of them each way where none of these shows anything, or in minip and average is
 * looked at. What a macro-cell shows: nothing of its own, or maybe something. */
enum { GROUP = 4, SHOWS_NOTHING = 1, SHOWS = 2 };

struct CtsVisible {
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    CtsMacrocells *own;              /* where the volume has none */
    const CtsOwners *owners;         /* NULL: all look alike */
    size_t n_functions;              /* of different opacity: the preset's, and those of looks */
    uint8_t function[CTS_MAX_LOOKS]; /* of each look */
    float *extinction; /* per mm, by function and grey level; in modes without opacity enough where a level shows */
    uint32_t *below;   /* prefix sums: levels below g that show, g up to n_levels, by function too */
    size_t n_levels;
    CtsMode mode;
    const CtsBodyMask *body; /* what minip and average look at; NULL: all */
    uint8_t *shows;          /* of each macro-cell; 0: nothing in its whole group */
    bool any;
};

static float extinction_of(const CtsPreset *p, const CtsVolume *volume, uint16_t grey)
{
    const double hu = cts_volume_hu(volume, grey);
    if (p->mode == CTS_MODE_COMPOSITE)
        return (float)cts_preset_extinction_per_mm(p, hu);
    return grey > 0 && hu > p->window_low_hu + (p->window_high_hu - p->window_low_hu) / 255 ? 1e9F : 0;
}

static void fill_levels(CtsVisible *v, size_t function, const CtsPreset *preset)
{
    float *const extinction = v->extinction + function * v->n_levels;
    uint32_t *const below = v->below + function * (v->n_levels + 1);
    below[0] = 0;
    for (size_t g = 0; g < v->n_levels; g++) {
        extinction[g] = extinction_of(preset, v->volume, (uint16_t)g);
        below[g + 1] = below[g] + (extinction[g] > 0);
    }
}

/* The first function is the preset's, which looks that change colour alone have too; the second one shows nothing. */
static CtsStatus list_levels(CtsVisible *v, const CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    const int n_looks = v->owners ? v->owners->n_looks : 0;
    v->n_functions = v->owners ? 2 : 1;
    v->function[CTS_LOOK_HIDDEN] = 1;
    for (int l = CTS_LOOK_OWN; l < n_looks; l++)
        v->function[l] = v->owners->looks[l].preset || v->owners->looks[l].opacity >= 0 ? (uint8_t)v->n_functions++ : 0;
    v->n_levels = (size_t)v->macrocells->all.high + 1;
    if ((st = cts_alloc_array(&v->extinction, v->n_functions * v->n_levels, err)) ||
        (st = cts_alloc_array(&v->below, v->n_functions * (v->n_levels + 1), err)))
        return st;
    fill_levels(v, 0, preset);
    if (v->owners)
        fill_levels(v, 1, &(CtsPreset){.mode = CTS_MODE_COMPOSITE, .unit_distance_mm = 1});
    for (int l = CTS_LOOK_OWN; l < n_looks; l++)
        if (v->function[l]) {
            CtsPreset own;
            cts_owner_preset(&v->owners->looks[l], preset, &own);
            own.mode = preset->mode;
            fill_levels(v, v->function[l], &own);
        }
    return CTS_OK;
}

/* Minip and average show what is brighter than black by the whole of a ray, in the body. */
static bool shows_whole_rays(const CtsVisible *v)
{
    return v->mode == CTS_MODE_MINIP || v->mode == CTS_MODE_AVERAGE;
}

static bool function_shows(const CtsVisible *v, size_t function, CtsRange range)
{
    const uint32_t *const below = v->below + function * (v->n_levels + 1);
    return below[(size_t)range.high + 1] > below[range.low];
}

/* Whether a macro-cell shows something by the looks of the fine ones in it. */
static bool looks_show(const CtsVisible *v, const int at[3], CtsRange range)
{
    enum { TIMES = CTS_MACROCELL / CTS_FINE_MACROCELL };
    const int *const n = v->owners->n_block;
    bool shows = false;
    for (int i = 0; i < TIMES * TIMES * TIMES && !shows; i++) {
        const int b[3] = {TIMES * at[0] + i % TIMES, TIMES * at[1] + i / TIMES % TIMES,
                          TIMES * at[2] + i / TIMES / TIMES};
        if (b[0] >= n[0] || b[1] >= n[1] || b[2] >= n[2])
            continue;
        const int look = v->owners->block[((size_t)b[2] * (size_t)n[1] + (size_t)b[1]) * (size_t)n[0] + (size_t)b[0]];
        const bool differ = look == CTS_LOOKS_DIFFER;
        for (size_t f = differ ? 0 : v->function[look]; f <= (differ ? v->n_functions - 1 : v->function[look]); f++)
            shows |= function_shows(v, f, range);
    }
    return shows;
}

/* Layers of macro-cells. */
static void list_some_cells(void *context, int worker, size_t first, size_t end)
{
    CtsVisible *const v = context;
    const size_t row = (size_t)v->macrocells->n[0], layer = row * (size_t)v->macrocells->n[1];
    (void)worker;
    for (size_t n = first * layer; n < end * layer; n++) {
        const int at[3] = {(int)(n % row), (int)(n % layer / row), (int)(n / layer)};
        const CtsRange range = v->macrocells->range[n];
        v->shows[n] = (v->owners ? looks_show(v, at, range) : function_shows(v, 0, range)) ? SHOWS : SHOWS_NOTHING;
    }
}

static void list_seen_cells(CtsVisible *v)
{
    const int *const n = v->macrocells->n;
    for (size_t i = 0; i < (size_t)n[0] * (size_t)n[1] * (size_t)n[2]; i++) {
        const int at[3] = {(int)(i % (size_t)n[0]), (int)(i / (size_t)n[0] % (size_t)n[1]),
                           (int)(i / (size_t)n[0] / (size_t)n[1])};
        int low[3], high[3];
        for (int a = 0; a < 3; a++) {
            low[a] = at[a] * CTS_MACROCELL;
            high[a] = low[a] + CTS_MACROCELL;
        }
        v->shows[i] = !v->body || cts_body_mask_sees(v->body, low, high) != CTS_SEES_NONE ? SHOWS : SHOWS_NOTHING;
    }
}

enum { IN_GROUP = GROUP * GROUP * GROUP };

/* The i-th macro-cell of a group that begins there; NULL where the volume ends before. */
static uint8_t *cell_of_group(const CtsVisible *v, const int first[3], int i)
{
    const int *const n = v->macrocells->n;
    const int x = first[0] + i % GROUP, y = first[1] + i / GROUP % GROUP, z = first[2] + i / GROUP / GROUP;
    return x < n[0] && y < n[1] && z < n[2]
               ? &v->shows[((size_t)z * (size_t)n[1] + (size_t)y) * (size_t)n[0] + (size_t)x]
               : NULL;
}

static void list_groups(const CtsVisible *v)
{
    const int *const n = v->macrocells->n;
    int at[3];
    for (at[2] = 0; at[2] < n[2]; at[2] += GROUP)
        for (at[1] = 0; at[1] < n[1]; at[1] += GROUP)
            for (at[0] = 0; at[0] < n[0]; at[0] += GROUP) {
                bool shows = false;
                for (int i = 0; i < IN_GROUP && !shows; i++) {
                    const uint8_t *const cell = cell_of_group(v, at, i);
                    shows = cell && *cell == SHOWS;
                }
                for (int i = 0; i < IN_GROUP && !shows; i++) {
                    uint8_t *const cell = cell_of_group(v, at, i);
                    if (cell)
                        *cell = 0;
                }
            }
}

static CtsStatus list_cells(CtsVisible *v, int n_threads, CtsError *err)
{
    const int *n = v->macrocells->n;
    const CtsStatus st = cts_alloc_array(&v->shows, (size_t)n[0] * (size_t)n[1] * (size_t)n[2], err);
    if (st)
        return st;
    cts_parallel(cts_threads(n_threads), (size_t)n[2], 0, list_some_cells, v);
    v->any = memchr(v->shows, SHOWS, (size_t)n[0] * (size_t)n[1] * (size_t)n[2]) != NULL;
    if (shows_whole_rays(v))
        list_seen_cells(v);
    list_groups(v);
    return CTS_OK;
}

CtsStatus cts_visible_new(CtsVisible **visible, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                          CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(visible, 1, err);
    if (st)
        return st;
    CtsVisible *const v = *visible;
    v->owners = volume->owners;
    v->mode = preset->mode;
    v->body = shows_whole_rays(v) ? volume->body : NULL;
    v->volume = volume = v->owners && v->owners->shown ? v->owners->shown : volume;
    if (!volume->macrocells)
        st = cts_macrocells_new(&v->own, volume, n_threads, err);
    v->macrocells = volume->macrocells ? volume->macrocells : v->own;
    if (st || (st = list_levels(v, preset, err)) || (st = list_cells(v, n_threads, err)))
        cts_visible_free(visible);
    return st;
}

void cts_visible_free(CtsVisible **visible)
{
    CtsVisible *const v = *visible;
    if (!v)
        return;
    cts_free(&v->extinction);
    cts_free(&v->below);
    cts_free(&v->shows);
    cts_macrocells_free(&v->own);
    cts_free(visible);
}

bool cts_visible_any(const CtsVisible *visible)
{
    return visible->any;
}

/* A small picture of what is shown, ray by ray. */
typedef struct Look {
    const CtsVisible *visible;
    CtsView view;
    float least_depth;
    bool whole_rays; /* mean or smallest value of a ray count */
    uint8_t shown[LOOK][LOOK];
} Look;

/* Samples of a ray from one end to the other, a layer of voxels apart; each stands for as much of it. */
typedef struct Ray {
    float start[3], step[3], per_voxel[3]; /* per_voxel: samples */
    float sample_mm;
    int n, ahead[3]; /* 1: a macro-cell ends where the next one begins, 0: where it does */
} Ray;

static bool ray_of(const CtsView *view, double x, double y, Ray *ray)
{
    double start[3], near_mm = view->near_mm, far_mm = view->far_mm;
    cts_view_ray(view, x, y, start);
    for (int axis = 0; axis < 3; axis++) {
        const double last = view->dims[axis] - 1, along = view->forward_vox[axis];
        if (along == 0 && (start[axis] < 0 || start[axis] > last))
            return false;
        if (along == 0)
            continue;
        const double a = -start[axis] / along, b = (last - start[axis]) / along;
        near_mm = fmax(near_mm, fmin(a, b));
        far_mm = fmin(far_mm, fmax(a, b));
    }
    if (!(far_mm >= near_mm))
        return false;
    const int n_steps = (int)fmax(ceil((far_mm - near_mm) / view->layer_mm), 1);
    const double step_mm = (far_mm - near_mm) / n_steps;
    ray->n = n_steps + 1;
    ray->sample_mm = (float)((far_mm - near_mm) / ray->n);
    for (int axis = 0; axis < 3; axis++) {
        ray->step[axis] = (float)(view->forward_vox[axis] * step_mm);
        ray->start[axis] = (float)(start[axis] + near_mm * view->forward_vox[axis]);
        ray->per_voxel[axis] = ray->step[axis] != 0 ? 1 / ray->step[axis] : 0;
        ray->ahead[axis] = ray->step[axis] > 0;
    }
    return true;
}

static float grey_at(const CtsVolume *v, const float at[3], const int cell[3])
{
    const int *n = v->dims;
    const size_t over[3] = {n[0] > 1, n[1] > 1 ? (size_t)n[0] : 0, n[2] > 1 ? (size_t)n[0] * (size_t)n[1] : 0};
    const uint16_t *g = v->grey + ((size_t)cell[2] * (size_t)n[1] + (size_t)cell[1]) * (size_t)n[0] + (size_t)cell[0];
    const float x = at[0] - (float)cell[0], y = at[1] - (float)cell[1], z = at[2] - (float)cell[2];
    float plane[2];
    for (int i = 0; i < 2; i++, g += over[2]) {
        const float a = g[0], b = g[over[0]], c = g[over[1]], d = g[over[0] + over[1]];
        const float ab = a + x * (b - a), cd = c + x * (d - c);
        plane[i] = ab + y * (cd - ab);
    }
    return plane[0] + z * (plane[1] - plane[0]);
}

/* Extinctions by grey level, of who owns the voxel nearest to a place. */
static const float *extinction_at(const CtsVisible *v, const float at[3])
{
    int voxel[3];
    if (!v->owners)
        return v->extinction;
    for (int a = 0; a < 3; a++) {
        const int nearest = (int)(at[a] + 0.5F);
        voxel[a] = nearest < v->volume->dims[a] ? nearest : v->volume->dims[a] - 1;
    }
    return v->extinction + v->function[cts_look_of_voxel(v->owners, voxel[0], voxel[1], voxel[2])] * v->n_levels;
}

/* How many samples lie between here and the end of so many macro-cells each way, along the axis that gets there first.
 */
static int samples_to_end(const Ray *ray, const float at[3], const int block[3], int cells)
{
    float least = (float)ray->n;
    for (int axis = 0; axis < 3; axis++) {
        const int end = (block[axis] / cells + ray->ahead[axis]) * cells * CTS_MACROCELL;
        const float n = ((float)end - at[axis]) * ray->per_voxel[axis];
        least = ray->step[axis] != 0 && n < least ? n : least;
    }
    return least > 0 ? (int)least : 0;
}

/* What a ray has met. */
typedef struct Met {
    float depth, sum, least; /* grey levels' sum, and the smallest */
    int n;
} Met;

static bool shows_enough(const CtsVisible *v, const Met *met)
{
    const float grey = v->mode == CTS_MODE_AVERAGE ? met->sum / (float)met->n : met->least;
    return met->n > 0 && v->extinction[(int)(grey + 0.5F)] > 0;
}

static bool ray_shows(const Look *l, const Ray *ray)
{
    const CtsVisible *const v = l->visible;
    const int *n = v->macrocells->n;
    Met met = {.least = INFINITY};
    for (int i = 0; i < ray->n && met.depth < l->least_depth; i++) {
        float at[3];
        int cell[3], last;
        for (int axis = 0; axis < 3; axis++) {
            at[axis] = ray->start[axis] + (float)i * ray->step[axis];
            cell[axis] = (int)at[axis];
            last = v->volume->dims[axis] - 2;
            cell[axis] = cell[axis] > last ? last : cell[axis];
            cell[axis] = cell[axis] < 0 ? 0 : cell[axis];
        }
        const int block[3] = {cell[0] / CTS_MACROCELL, cell[1] / CTS_MACROCELL, cell[2] / CTS_MACROCELL};
        const int shows =
            v->shows[((size_t)block[2] * (size_t)n[1] + (size_t)block[1]) * (size_t)n[0] + (size_t)block[0]];
        if (shows != SHOWS) {
            i += samples_to_end(ray, at, block, shows == SHOWS_NOTHING ? 1 : GROUP);
            continue;
        }
        const float grey = grey_at(v->volume, at, cell), *const extinction = extinction_at(v, at);
        const bool hidden = v->owners && extinction == v->extinction + v->n_levels;
        if (!l->whole_rays) {
            met.depth += ray->sample_mm * extinction[(int)(grey + 0.5F)];
        } else if (!hidden &&
                   (!v->body || cts_body_mask_at(v->body, (double[]){at[0], at[1], at[2]}) > CTS_BODY_LEVEL)) {
            met.sum += grey;
            met.least = fminf(met.least, grey);
            met.n++;
        }
    }
    return l->whole_rays ? shows_enough(v, &met) : met.depth >= l->least_depth;
}

static bool look_along(const Look *l, double x, double y)
{
    Ray ray;
    return ray_of(&l->view, x, y, &ray) && ray_shows(l, &ray);
}

/* Rows of sparse rays. */
static void look_here_and_there(void *context, int worker, size_t first, size_t end)
{
    Look *const l = context;
    (void)worker;
    for (int y = (int)first * SPARSE; y < (int)end * SPARSE; y += SPARSE)
        for (int x = 0; x < LOOK; x += SPARSE)
            l->shown[y][x] = look_along(l, x, y);
}

/* Rows of the others. */
static void look_between(void *context, int worker, size_t first, size_t end)
{
    Look *const l = context;
    (void)worker;
    for (int y = (int)first; y < (int)end; y++)
        for (int x = 0; x < LOOK; x++) {
            const int i = x / SPARSE * SPARSE, j = y / SPARSE * SPARSE, far_i = i + SPARSE, far_j = j + SPARSE;
            if (x == i && y == j)
                continue;
            const bool amid = far_i < LOOK && far_j < LOOK && l->shown[j][i] && l->shown[j][far_i] &&
                              l->shown[far_j][i] && l->shown[far_j][far_i];
            l->shown[y][x] = amid || look_along(l, x, y);
        }
}

/* Rays of a look: from low to high, high included. */
typedef struct Box {
    int low[2], high[2];
} Box;

static void widen(Box *box, const Box *by)
{
    for (int i = 0; i < 2; i++) {
        box->low[i] = by->low[i] < box->low[i] ? by->low[i] : box->low[i];
        box->high[i] = by->high[i] > box->high[i] ? by->high[i] : box->high[i];
    }
}

/* Takes what hangs together with a ray that shows something, corners too, out of the look. */
static int take_part(Look *l, int x, int y, Box *box)
{
    uint16_t open[LOOK * LOOK];
    int n_open = 0, n = 0;
    open[n_open++] = (uint16_t)(y * LOOK + x);
    l->shown[y][x] = 0;
    *box = (Box){{x, y}, {x, y}};
    while (n_open > 0) {
        const int at = open[--n_open];
        const int px = at % LOOK, py = at / LOOK;
        widen(box, &(Box){{px, py}, {px, py}});
        n++;
        for (int j = py > 0 ? py - 1 : 0; j <= py + 1 && j < LOOK; j++)
            for (int i = px > 0 ? px - 1 : 0; i <= px + 1 && i < LOOK; i++)
                if (l->shown[j][i]) {
                    l->shown[j][i] = 0;
                    open[n_open++] = (uint16_t)(j * LOOK + i);
                }
    }
    return n;
}

static bool reaches_past(const Box *part, const Box *box)
{
    return part->low[0] < box->low[0] || part->low[1] < box->low[1] || part->high[0] > box->high[0] ||
           part->high[1] > box->high[1];
}

/* The largest part of what lies in a box and a ray around it, in rays. */
static double closer_area(const Look *l, const Box *box)
{
    const int n[2] = {(box->high[0] - box->low[0] + 3) * FINER, (box->high[1] - box->low[1] + 3) * FINER};
    const double from[2] = {box->low[0] - 1.5 + 0.5 / FINER, box->low[1] - 1.5 + 0.5 / FINER};
    Look closer = {.visible = l->visible};
    Box part;
    int most = 0;
    for (int y = 0; y < n[1]; y++)
        for (int x = 0; x < n[0]; x++)
            closer.shown[y][x] = look_along(l, from[0] + (double)x / FINER, from[1] + (double)y / FINER);
    for (int y = 0; y < n[1]; y++)
        for (int x = 0; x < n[0]; x++) {
            const int area = closer.shown[y][x] ? take_part(&closer, x, y, &part) : 0;
            most = area > most ? area : most;
        }
    return (double)most / (FINER * FINER);
}

/* The box of what is shown but for specks; false where nothing is. */
static bool take_box(Look *l, Box *box)
{
    Box unsure[LOOK * LOOK / 4]; /* parts lie a ray apart */
    int n_shown = 0, n_unsure = 0;
    *box = (Box){{LOOK, LOOK}, {-1, -1}};
    for (int y = 0; y < LOOK; y++)
        for (int x = 0; x < LOOK; x++)
            n_shown += l->shown[y][x];
    for (int y = 0; y < LOOK; y++)
        for (int x = 0; x < LOOK; x++) {
            Box part;
            const int area = l->shown[y][x] ? take_part(l, x, y, &part) : 0;
            if (area >= SURE && area >= SPECK * n_shown)
                widen(box, &part);
            else if (area > 0 && area >= SPECK * n_shown)
                unsure[n_unsure++] = part;
        }
    for (int i = 0; i < n_unsure; i++)
        if (reaches_past(&unsure[i], box) && closer_area(l, &unsure[i]) >= SPECK * n_shown)
            widen(box, &unsure[i]);
    return box->high[0] >= 0;
}

/* What is visible between its ends along a direction, dot products with points in patient coordinates. */
typedef struct Span {
    double low_mm, high_mm;
} Span;

static double middle(Span span)
{
    return 0.5 * (span.low_mm + span.high_mm);
}

/* The ends of the volume's box, which no order of its voxels changes. */
static Span span_of_box(const CtsVolume *volume, const double direction_lps[3])
{
    const double origin = cts_dot3(volume->origin_lps, direction_lps);
    Span span = {origin, origin};
    for (int axis = 0; axis < 3; axis++) {
        const double along = cts_dot3(volume->step_lps[axis], direction_lps) * (volume->dims[axis] - 1);
        *(along > 0 ? &span.high_mm : &span.low_mm) += along;
    }
    return span;
}

/* What of a span lies in the volume, which may be thinner than a ray is wide. */
static Span within(Span span, Span volume)
{
    return (Span){fmax(span.low_mm, volume.low_mm), fmin(span.high_mm, volume.high_mm)};
}

static double ray_mm(Span span)
{
    return (span.high_mm - span.low_mm) / (LOOK - 2);
}

/* Looks at what lies between the spans to the right and up, each with rays of its own, so that none passes a thin
 * volume by; one to spare lies behind either end. */
static bool look(Look *l, const CtsRenderSettings *s, const Span span[2], Box *box)
{
    const CtsVolume *volume = l->visible->volume;
    CtsRenderSettings small = *s;
    CtsViewAxes axes;
    double centre_lps[3];
    small.width = small.height = LOOK;
    small.mm_per_pixel = 1;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int c = 0; c < 3; c++)
        centre_lps[c] = middle(span[0]) * axes.right_lps[c] + middle(span[1]) * axes.up_lps[c];
    if (cts_view_init(&l->view, volume, &small, NULL))
        return false;
    cts_view_aim(&l->view, centre_lps);
    if (s->slab_mm > 0)
        cts_view_set_slab(&l->view, volume, s->slab_mm, s->slab_at_mm);
    for (int a = 0; a < 3; a++) {
        l->view.right_vox[a] *= ray_mm(span[0]);
        l->view.up_vox[a] *= ray_mm(span[1]);
    }
    cts_parallel(cts_threads(s->n_threads), LOOK / SPARSE, 0, look_here_and_there, l);
    cts_parallel(cts_threads(s->n_threads), LOOK, 0, look_between, l);
    return take_box(l, box);
}

/* To what was found between low and high, and so many rays more on either side. */
static Span narrowed(Span span, int low, int high, double more)
{
    const double mm = ray_mm(span), first_mm = middle(span) - mm * LOOK / 2;
    return (Span){first_mm + mm * (low - more), first_mm + mm * (high + 1 + more)};
}

/* To the right and up, in the settings' view. */
static bool find_spans(const CtsVisible *v, const CtsRenderSettings *s, Span span[2])
{
    Look l = {.visible = v};
    CtsViewAxes axes;
    Box box = {{0, 0}, {0, 0}};
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int least = 0; least < N_LEAST; least++) {
        const Span whole[2] = {span_of_box(v->volume, axes.right_lps), span_of_box(v->volume, axes.up_lps)};
        l.least_depth = (float)-log1p(-LEAST_OPACITY[least]);
        l.whole_rays = least == 0 && shows_whole_rays(v);
        memcpy(span, whole, sizeof whole);
        for (int n = 1; look(&l, s, span, &box); n++) {
            const int n_found[2] = {box.high[0] - box.low[0], box.high[1] - box.low[1]};
            const bool up = n_found[1] * ray_mm(span[1]) > n_found[0] * ray_mm(span[0]);
            const bool last = n == MOST_LOOKS || n_found[up] >= LEAST_FOUND;
            /* A closer look begins at the rays that show nothing. */
            span[0] = within(narrowed(span[0], box.low[0], box.high[0], last ? 0 : 0.5), whole[0]);
            span[1] =
                within(narrowed(span[1], LOOK - 1 - box.high[1], LOOK - 1 - box.low[1], last ? 0 : 0.5), whole[1]);
            if (last)
                return true;
        }
    }
    return false;
}

/* half[0] and half[1] become no less than how far what is visible in this view reaches from the settings' centre. */
static bool reach_from_centre(const CtsVisible *v, const CtsRenderSettings *s, double half[2])
{
    Span span[2];
    CtsViewAxes axes;
    if (!find_spans(v, s, span))
        return false;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int i = 0; i < 2; i++) {
        const double from_mm = cts_dot3(s->centre_lps, i ? axes.up_lps : axes.right_lps);
        half[i] = fmax(half[i], fmax(span[i].high_mm - from_mm, from_mm - span[i].low_mm));
    }
    return true;
}

/* The centre of a rotation lies on the head-foot axis through the middle of what is visible from the front and from the
 * left. */
static bool frame_rotation(const CtsVisible *v, CtsRenderSettings *s, double half[2])
{
    CtsRenderSettings view = *s;
    Span front[2], left[2];
    bool found = false;
    view.slab_mm = view.elevation_deg = view.azimuth_deg = 0;
    if (!find_spans(v, &view, front))
        return false;
    view.azimuth_deg = 90;
    if (!find_spans(v, &view, left))
        return false;
    s->centre_lps[0] = middle(front[0]);
    s->centre_lps[1] = middle(left[0]);
    s->centre_lps[2] = middle(front[1]);
    view = *s;
    const int n = s->rotation_frames < MOST_VIEWS ? s->rotation_frames : MOST_VIEWS;
    for (int i = 0; i < n; i++) {
        view.azimuth_deg = s->azimuth_deg + 360.0 * i / n;
        found |= reach_from_centre(v, &view, half);
    }
    return found;
}

static bool frame_view(const CtsVisible *v, CtsRenderSettings *s, double half[2])
{
    CtsViewAxes axes;
    Span span[2];
    if (!find_spans(v, s, span))
        return false;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int c = 0; c < 3; c++)
        s->centre_lps[c] = middle(span[0]) * axes.right_lps[c] + middle(span[1]) * axes.up_lps[c];
    for (int i = 0; i < 2; i++)
        half[i] = 0.5 * (span[i].high_mm - span[i].low_mm);
    return true;
}

void cts_framing_find(const CtsVisible *v, CtsRenderSettings *settings)
{
    double half[2] = {0, 0};
    CtsRenderSettings s = *settings;
    if (!v->any || !(s.rotation_frames > 1 ? frame_rotation : frame_view)(v, &s, half))
        return;
    s.mm_per_pixel = fmax(2 * half[0] / (FILLED * s.width), 2 * half[1] / (FILLED * s.height));
    s.centre_given = true;
    if (s.mm_per_pixel > 0 && isfinite(s.mm_per_pixel))
        *settings = s;
}

CtsStatus cts_framing_settle(const CtsVolume *volume, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err)
{
    CtsVisible *visible = NULL;
    CtsPreset p = *preset;
    if (settings->fit != CTS_FIT_VISIBLE || settings->mm_per_pixel != 0)
        return CTS_OK;
    if (settings->mode >= 0)
        p.mode = (CtsMode)settings->mode;
    const CtsStatus st = cts_visible_new(&visible, volume, &p, settings->n_threads, err);
    if (!st)
        cts_framing_find(visible, settings);
    cts_visible_free(&visible);
    return st;
}
