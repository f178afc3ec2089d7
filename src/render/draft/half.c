#include "render/draft/half.h"

#include "base/chance.h"
#include "base/clock.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "render/draft/draft.h"
#include "core/volume/halve.h"
#include <math.h>

/* From this error on, in 1/255 rms: on real CT half the resolution errs by 1 to 5. */
enum { FROM_ERROR = 5 };

/* So many rays may tell of so much of the error asked for, since some views err more than others. */
enum { TRIED = 256 };
#define TRIAL_SHARE 0.9

bool cts_half_serves(const CtsHalf *half, const CtsEngine *engine, const CtsScene *scene)
{
    return !half->given_up && engine->bounds_error && scene->settings->rotation_frames > 1 &&
           scene->preset->mode == CTS_MODE_COMPOSITE && cts_scene_drafts(scene) && scene->plan.max_error >= FROM_ERROR;
}

/* Of a picture, so many rays judge it at a time, and up to so many times where they show too little. */
enum { RAYS = 128, LEAST_RAYS = 8 /* of a strip */, ROUNDS = 8 };

/* Of the error asked for: what a pixel may err by that no ray has met. */
#define UNSEEN 2

/* Half of the rays are drawn evenly, the others by how much the picture changes within blocks of so many pixels each
 * way: a small object's edge has all of the error, and would hardly be met. */
enum { BLOCK = 8, STRIP_BLOCKS = (CTS_BAND_ROWS + BLOCK - 1) / BLOCK };

typedef struct Rays {
    const CtsScene *scene;
    const CtsRaycaster *caster;
    const CtsPicture *band;
    int whole_rows;      /* of a whole strip */
    size_t strip_blocks; /* likewise */
    double *changes;     /* of each block of each strip by its pixels, summed up so far in the strip */
    const int *strip;    /* those that are judged */
    int n;               /* rays of each */
    int round;
    double *square; /* of each ray: e^2 over how likely it was, times the strip's rows by a whole strip's */
} Rays;

typedef struct Block {
    int x, y, end_x, end_y; /* in the band */
} Block;

/* Numbers 0 to 2^32 - 1. */
static uint32_t drawn(uint64_t number)
{
    return (uint32_t)(cts_chance_bits(number) >> 32);
}

static int drawn_between(uint64_t h, int first, int end)
{
    return first + (int)((uint64_t)drawn(h) * (uint64_t)(end - first) >> 32);
}

static int first_row(int strip)
{
    return strip * CTS_BAND_ROWS;
}

static int end_row(const CtsPicture *band, int strip)
{
    const int end = first_row(strip) + CTS_BAND_ROWS;
    return end < band->height ? end : band->height;
}

static int n_strips(const CtsPicture *band)
{
    return (band->height + CTS_BAND_ROWS - 1) / CTS_BAND_ROWS;
}

static int lower(int a, int b)
{
    return a < b ? a : b;
}

static Block block_at(const CtsPicture *band, int strip, size_t i)
{
    const size_t columns = ((size_t)band->width + BLOCK - 1) / BLOCK;
    Block b = {.x = (int)(i % columns) * BLOCK, .y = first_row(strip) + (int)(i / columns) * BLOCK};
    b.end_x = lower(b.x + BLOCK, band->width);
    b.end_y = lower(b.y + BLOCK, end_row(band, strip));
    return b;
}

static int area_of(const Block *b)
{
    return b->end_y > b->y ? (b->end_x - b->x) * (b->end_y - b->y) : 0;
}

/* How far pixels in and around the block differ; of its rows every second is looked at. */
static double change_in(const CtsPicture *band, int strip, const Block *b)
{
    float least[4] = {INFINITY, INFINITY, INFINITY, INFINITY}, most[4] = {0}, change = 0;
    const int top = first_row(strip), left = b->x > 0 ? b->x - 1 : 0, right = lower(b->end_x + 1, band->width);
    for (int y = b->y > top ? b->y - 1 : top; y < lower(b->end_y + 1, end_row(band, strip)); y += 2) {
        const float *at = band->pixels + 4 * ((size_t)y * (size_t)band->width + (size_t)left);
        for (int x = left; x < right; x++, at += 4)
            for (int c = 0; c < 4; c++) {
                least[c] = at[c] < least[c] ? at[c] : least[c];
                most[c] = at[c] > most[c] ? at[c] : most[c];
            }
    }
    for (int c = 0; c < 4; c++)
        change = most[c] - least[c] > change ? most[c] - least[c] : change;
    return (double)change;
}

static void look_at_some(void *context, int worker, size_t first, size_t end)
{
    const Rays *const r = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        double sum = 0;
        for (size_t i = 0; i < r->strip_blocks; i++) {
            const Block b = block_at(r->band, (int)strip, i);
            if (area_of(&b) > 0)
                sum += change_in(r->band, (int)strip, &b) * area_of(&b);
            r->changes[strip * r->strip_blocks + i] = sum;
        }
    }
}

/* The block where the sum first exceeds at; i: that of a pixel drawn evenly. */
static size_t find_block(const double *changes, size_t n, double at)
{
    size_t first = 0, last = n - 1;
    while (first < last) {
        const size_t middle = first + (last - first) / 2;
        if (changes[middle] > at)
            last = middle;
        else
            first = middle + 1;
    }
    return first;
}

/* Draws a pixel of the strip; how much more likely it is than one drawn evenly. */
static double draw_pixel(const Rays *r, int strip, uint64_t number, int xy[2])
{
    const double *const changes = r->changes + (size_t)strip * r->strip_blocks;
    const double all = changes[r->strip_blocks - 1];
    const int width = r->band->width, first = first_row(strip), end = end_row(r->band, strip);
    const double draw = ldexp(drawn(number), -31); /* 0 to 2 */
    Block b = {0, first, width, end};
    if (draw < 1 && all > 0)
        b = block_at(r->band, strip, find_block(changes, r->strip_blocks, draw * all));
    xy[0] = drawn_between(number + 1, b.x, b.end_x);
    xy[1] = drawn_between(number + 2, b.y, b.end_y);
    if (!(all > 0))
        return 1;
    const size_t columns = ((size_t)width + BLOCK - 1) / BLOCK;
    const size_t i = (size_t)((xy[1] - first) / BLOCK) * columns + (size_t)(xy[0] / BLOCK);
    b = block_at(r->band, strip, i);
    const double change = (changes[i] - (i > 0 ? changes[i - 1] : 0)) / area_of(&b);
    return 0.5 + 0.5 * change / all * (double)width * (end - first);
}

static void cast_some(void *context, int worker, size_t first, size_t end)
{
    const Rays *const r = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(r->scene); i++) {
        const int strip = r->strip[i / (size_t)r->n], row = r->band->first_row + first_row(strip);
        const uint64_t number = ((uint64_t)row * RAYS * ROUNDS + (uint64_t)r->round * RAYS + i % (size_t)r->n + 1) * 4;
        int xy[2];
        const double likely = draw_pixel(r, strip, number, xy);
        double rgba[4];
        cts_raycast_ray(r->caster, xy[0], r->band->first_row + xy[1], rgba, NULL);
        const size_t at = (size_t)xy[1] * (size_t)r->band->width + (size_t)xy[0];
        r->square[i] = cts_square_of_error(r->scene->preset, r->band->pixels + 4 * at, rgba) / likely *
                       (end_row(r->band, strip) - first_row(strip)) / r->whole_rows;
    }
}

static double sum_of(const Rays *r, int i, double *most)
{
    double sum = 0;
    for (int k = 0; k < r->n; k++) {
        const double square = r->square[(size_t)i * (size_t)r->n + (size_t)k];
        sum += square;
        *most = fmax(*most, square);
    }
    return sum;
}

/* Room for a picture's rays, and where they are to go. */
static CtsStatus begin(Rays *r, int height, CtsError *err)
{
    const size_t strips = (size_t)n_strips(r->band);
    CtsStatus st;
    r->whole_rows = lower(height, CTS_BAND_ROWS);
    const int even = (int)ceil((double)RAYS * r->whole_rows / height);
    r->n = even > LEAST_RAYS ? lower(even, RAYS) : LEAST_RAYS;
    r->strip_blocks = ((size_t)r->band->width + BLOCK - 1) / BLOCK * STRIP_BLOCKS;
    if ((st = cts_alloc_array(&r->square, strips * (size_t)r->n, err)) ||
        (st = cts_alloc_array(&r->changes, strips * r->strip_blocks, err)))
        return st;
    cts_parallel(r->scene->settings->n_threads, strips, 1, look_at_some, r);
    return CTS_OK;
}

static void end(Rays *r)
{
    cts_free(&r->square);
    cts_free(&r->changes);
}

/* Of how many rays evenly over whole strips these are worth. */
static double worth_of(const Rays *r, int strip)
{
    return (double)r->n * (end_row(r->band, strip) - first_row(strip)) / r->whole_rows;
}

/* Casts this round's rays through n strips. */
static CtsStatus cast(Rays *r, const int *strip, int n, CtsFrameBound *bound, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const size_t n_rays = (size_t)n * (size_t)r->n;
    r->strip = strip;
    cts_parallel(r->scene->settings->n_threads, n_rays, 4, cast_some, r);
    r->round++;
    bound->cast += n_rays;
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
    return cts_scene_stopped(r->scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}

/* A strip as a draft of all voxels, judged as such. */
static CtsStatus make_anew(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                           int strip, CtsError *err)
{
    const int first = first_row(strip), end = end_row(band, strip);
    const CtsStatus st = cts_draft_redraw(engine, scene, band, first, end, err);
    if (st)
        return st;
    CtsPicture rows = *band;
    rows.first_row += first;
    rows.height = end - first;
    rows.pixels += 4 * (size_t)first * (size_t)band->width;
    if (rows.depth_mm)
        rows.depth_mm += (size_t)first * (size_t)band->width;
    return cts_draft_keep(bound, engine, scene, &rows, err);
}

/* Whether the rays through a strip, number i of those cast, show that it errs too much. */
static bool fails(const Rays *r, int i)
{
    const double asked = cts_scene_error_asked(r->scene);
    double most = 0;
    return sum_of(r, i, &most) > asked * asked * worth_of(r, r->strip[i]);
}

/* Lists the strips that stay, and behind them those that fail, twice by rays of their own. */
static CtsStatus choose(Rays *r, int *strip, int n, int *n_kept, CtsFrameBound *bound, CtsError *err)
{
    int kept = 0, end = n;
    CtsStatus st;
    int *const again = strip + n; /* room for as many */
    for (int i = 0; i < n; i++)
        strip[i] = i;
    if ((st = cast(r, strip, n, bound, err)))
        return st;
    int n_again = 0;
    for (int i = 0; i < n; i++)
        if (fails(r, i))
            again[n_again++] = i;
        else
            strip[kept++] = i;
    if (n_again > 0 && (st = cast(r, again, n_again, bound, err)))
        return st;
    for (int i = 0; i < n_again; i++)
        if (fails(r, i))
            strip[--end] = again[i];
        else
            strip[kept++] = again[i];
    *n_kept = kept;
    return CTS_OK;
}

/* Judges strips by rays of their own, more and more of them where they show too little: those that told which strips
 * to make anew would speak too well of the others. */
static CtsStatus judge(Rays *r, const int *strip, int n, CtsFrameBound *bound, CtsError *err)
{
    const double asked = cts_scene_error_asked(r->scene);
    double sum = 0, most = UNSEEN * asked * UNSEEN * asked, worth = 0;
    CtsStatus st;
    if (n == 0)
        return CTS_OK;
    while (r->round < ROUNDS && (!(worth > 0) || sqrt(cts_mean_limit(sum, most, worth)) > asked)) {
        if ((st = cast(r, strip, n, bound, err)))
            return st;
        for (int i = 0; i < n; i++) {
            sum += sum_of(r, i, &most);
            worth += worth_of(r, strip[i]);
        }
    }
    bound->half_rays += worth;
    bound->half_squares += sum;
    bound->half_most = fmax(bound->half_most, most);
    return CTS_OK;
}

CtsStatus cts_half_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                        CtsError *err)
{
    const int n = n_strips(band);
    Rays r = {.scene = scene, .band = band};
    int *strip = NULL, kept = 0;
    CtsStatus st;
    if ((st = cts_alloc_array(&strip, 2 * (size_t)n, err)) || (st = begin(&r, scene->view.height, err)) ||
        (st = cts_bound_caster(bound, scene, &r.caster, err)) || (st = choose(&r, strip, n, &kept, bound, err)) ||
        (st = judge(&r, strip, kept, bound, err)))
        goto end;
    for (int i = 0; i < kept; i++) {
        const uint64_t pixels = (uint64_t)(end_row(band, strip[i]) - first_row(strip[i])) * (uint64_t)band->width;
        bound->at_half += pixels;
        bound->pixels += pixels;
    }
    for (int i = kept; i < n && !st; i++)
        st = make_anew(bound, engine, scene, band, strip[i], err);
end:
    cts_free(&strip);
    end(&r);
    return st;
}

/* scene with another volume, of which `kept` is what the engine keeps. */
static CtsStatus init_store(CtsSceneStore *store, const CtsScene *scene, const CtsVolume *volume, void **kept,
                            CtsError *err)
{
    const CtsStatus st = cts_scene_init(store, volume, scene->preset, scene->settings, err);
    store->scene.plan = scene->plan;
    store->scene.lut = scene->lut;
    store->scene.extinction_scale = scene->extinction_scale; /* whose unit may be a voxel */
    store->scene.kept = kept;
    store->scene.frame = scene->frame;
    return st;
}

/* Rays through both volumes. */
typedef struct Trial {
    const CtsScene *scene;
    const CtsRaycaster *whole, *half;
    double *square;
} Trial;

static void try_some(void *context, int worker, size_t first, size_t end)
{
    const Trial *const t = context;
    const CtsView *view = &t->scene->view;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(t->scene); i++) {
        double whole[4], half[4];
        const int x = (int)((uint64_t)drawn(2 * i + 1) * (uint64_t)view->width >> 32);
        const int y = (int)((uint64_t)drawn(2 * i + 2) * (uint64_t)view->height >> 32);
        cts_raycast_ray(t->whole, x, y, whole, NULL);
        cts_raycast_ray(t->half, x, y, half, NULL);
        const float pixel[4] = {(float)half[0], (float)half[1], (float)half[2], (float)half[3]};
        t->square[i] = cts_square_of_error(t->scene->preset, pixel, whole);
    }
}

/* What half the resolution errs by at most, rms, as some rays tell. */
static CtsStatus try_half(CtsHalf *half, const CtsScene *scene, double *rmse, CtsError *err)
{
    CtsSceneStore store;
    CtsFrameBound bounds[2] = {{0}};
    Trial trial = {.scene = scene};
    double sum = 0, most = 0;
    CtsStatus st;
    if ((st = init_store(&store, scene, half->volume, &half->kept, err)) ||
        (st = cts_alloc_zeroed(&trial.square, TRIED, err)) ||
        (st = cts_bound_caster(&bounds[0], scene, &trial.whole, err)) ||
        (st = cts_bound_caster(&bounds[1], &store.scene, &trial.half, err)))
        goto end;
    cts_parallel(scene->settings->n_threads, TRIED, 4, try_some, &trial);
    for (int i = 0; i < TRIED; i++) {
        sum += trial.square[i];
        most = fmax(most, trial.square[i]);
    }
    *rmse = sqrt(cts_mean_limit(sum, most, TRIED));
    if (cts_scene_stopped(scene))
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
end:
    cts_free(&trial.square);
    cts_bound_free(&bounds[0]);
    cts_bound_free(&bounds[1]);
    return st;
}

static CtsStatus make(CtsHalf *half, const CtsEngine *engine, const CtsScene *scene, CtsReport *report, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    double rmse;
    CtsStatus st = cts_volume_halve(scene->volume, scene->settings->n_threads, &half->volume, err);
    if (st == CTS_ERR_MEMORY) {
        half->given_up = true;
        cts_report_skip(report, "half the resolution", "no memory for it");
        return CTS_OK;
    }
    if (st || (st = cts_volume_prepare(half->volume, scene->settings->n_threads, err)) ||
        (st = try_half(half, scene, &rmse, err)))
        return st;
    cts_report_stage(report, CTS_STAGE_GREY, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                     cts_volume_n_voxels(half->volume), 2 * cts_volume_n_voxels(scene->volume));
    if (rmse <= TRIAL_SHARE * cts_scene_error_asked(scene))
        return CTS_OK;
    cts_half_free(half, engine);
    half->given_up = true;
    cts_report_skip(report, "half the resolution", "may err by %.2g/255 rms, as %d trial rays tell", 255 * rmse, TRIED);
    return CTS_OK;
}

CtsStatus cts_half_init(CtsHalf *half, const CtsEngine *engine, const CtsScene *scene, CtsSceneStore *store,
                        CtsReport *report, CtsError *err)
{
    CtsStatus st;
    if (!half->volume && (st = make(half, engine, scene, report, err)))
        return st;
    if (half->given_up)
        return CTS_OK;
    const int *const n = half->volume->dims;
    cts_report_plan(report, "draft: of a copy at half the resolution, %d x %d x %d voxels", n[0], n[1], n[2]);
    return init_store(store, scene, half->volume, &half->kept, err);
}

void cts_half_end(CtsHalf *half, const CtsEngine *engine, const CtsScene *scene, const CtsFrameBound *bound,
                  CtsReport *report)
{
    const double rmse = cts_bound_rmse(bound);
    if (rmse <= cts_scene_error_asked(scene))
        return;
    cts_half_free(half, engine);
    half->given_up = true;
    cts_report_skip(report, "half the resolution", "may err by %.2g/255 rms: later frames are made from all voxels",
                    255 * rmse);
}

void cts_half_free(CtsHalf *half, const CtsEngine *engine)
{
    if (half->kept && engine->forget)
        engine->forget(half->kept);
    half->kept = NULL;
    cts_volume_free(&half->volume);
}
