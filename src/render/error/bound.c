#include "render/error/bound.h"

#include "base/chance.h"
#include "base/clock.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SHARE_ASKED = 32, SHARE_BY_DEFAULT = 512 };

/* What tables and weights of 14 bits leave, rms, where nothing else errs. */
#define ROUNDED 5e-5

/* Of the error asked for, a ray that is cast may be off by this. */
#define CAST_WITHIN 0.02

/* A pixel's bound and its place in the band as one number: the larger, the worse; of equals the upper left one. The
 * bits of floats that are not negative have the order of the floats. */
typedef uint64_t Pixel;

static size_t limit_of(const CtsScene *scene, size_t n_pixels)
{
    return n_pixels / (scene->plan.max_error > 0 ? SHARE_ASKED : SHARE_BY_DEFAULT);
}

double cts_square_of_error(const CtsPreset *preset, const float *pixel, const double rgba[4])
{
    double square = 0;
    for (int c = 0; c < 3; c++) {
        const double behind = preset->background_none ? 0 : preset->background[c];
        const double off = (double)pixel[c] - rgba[c] + (rgba[3] - (double)pixel[3]) * behind;
        square += off * off / 3;
    }
    return square;
}

static Pixel pixel_of(float bound, size_t at)
{
    uint32_t bits;
    memcpy(&bits, &bound, sizeof bits);
    return (uint64_t)bits << 32 | (uint32_t)~at;
}

static uint32_t place_of(Pixel pixel)
{
    return ~(uint32_t)pixel;
}

static int worst_first(const void *a, const void *b)
{
    const Pixel p = *(const Pixel *)a, q = *(const Pixel *)b;
    return (p < q) - (p > q);
}

/* The k worst come first, in any order (Hoare's selection). */
static void select_worst(Pixel *p, size_t n, size_t k)
{
    size_t first = 0, last = n;
    while (k > first && k < last) {
        const Pixel middle = p[first + (last - first - 1) / 2];
        size_t i = first, j = last;
        for (;;) {
            while (p[i] > middle)
                i++;
            while (p[--j] < middle)
                ;
            if (i >= j)
                break;
            const Pixel swap = p[i];
            p[i++] = p[j];
            p[j] = swap;
        }
        /* None up to j is better than the middle one, none behind worse. */
        if (k <= j + 1)
            last = j + 1;
        else
            first = j + 1;
    }
}

/* What came of CTS_BAND_ROWS rows, or of those of their pixels that are judged. */
typedef struct Strip {
    size_t first, end; /* its pixels */
    bool judged;       /* in this round */
    double chance;     /* of a pixel to be cast is this times b^2 + f^2 */
    double square;     /* of the bounds, floor included */
    size_t first_ray, n_rays;
    double found;  /* sum of e^2 / p of the rays that judge */
    double beyond; /* the largest e^2 / (b^2 + f^2) */
    size_t n_bad;  /* pixels to be cast in any case */
    double most;   /* the largest bound that is left */
} Strip;

typedef struct Ray {
    size_t at;     /* among the pixels */
    double square; /* of the error that it shows, rms over the channels */
    double limit;  /* of that, by the engine's bound and the floor */
} Ray;

typedef struct Keeping {
    const CtsScene *scene;
    CtsBoundPixels of;
    double n_rays, n_pixels; /* of the whole view, those that are to judge and those that are judged */
    double floor;            /* f^2 */
    size_t n_strips, strip_pixels;
    Strip *strips;
    int round;
    Ray *rays;      /* that judge in this round, strip by strip */
    Pixel *scratch; /* of each worker, room for a strip */
    Pixel *bad;     /* room for limit_of() of each strip */
    size_t bad_room;
    const CtsRaycaster *caster;
} Keeping;

static size_t place_in_view(const Keeping *k, size_t at)
{
    return k->of.first + (k->of.place ? k->of.place[at] : at);
}

/* Even over 0..1, and its own for each pixel of the view and each round. */
static double chance_of(const Keeping *k, size_t at)
{
    const uint64_t number = (uint64_t)place_in_view(k, at) + ((uint64_t)k->round << 62) + 1;
    return (double)(cts_chance_bits(number) >> 11) * 0x1p-53;
}

static double square_at(const Keeping *k, size_t at)
{
    const double bound = (double)k->of.bound[at];
    return bound * bound + k->floor;
}

static bool judges(const Keeping *k, const Strip *s, size_t at)
{
    return chance_of(k, at) < s->chance * square_at(k, at);
}

/* How many rays judge each strip. */
static void count_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    const double pixels = k->n_pixels, aimed = cts_scene_bound_aimed(k->scene), rays = k->n_rays;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        s->square = 0;
        s->n_rays = 0;
        if (!s->judged)
            continue;
        for (size_t i = s->first; i < s->end; i++)
            s->square += square_at(k, i);
        /* Where bounds are far above what is aimed at, more rays would tell little more. */
        const double even = rays * (double)(s->end - s->first) / pixels, most = 4 * even;
        s->chance = rays / (pixels * aimed * aimed);
        if (s->chance * s->square > most)
            s->chance = most / s->square;
        for (size_t i = s->first; i < s->end; i++)
            s->n_rays += judges(k, s, i);
    }
}

static void list_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        const Strip *const s = &k->strips[strip];
        Ray *ray = k->rays + s->first_ray;
        for (size_t i = s->first; i < s->end && s->n_rays > 0; i++)
            if (judges(k, s, i))
                *ray++ = (Ray){.at = i, .limit = square_at(k, i)};
    }
}

static void cast_pixel(const Keeping *k, size_t at, double rgba[4])
{
    const size_t width = (size_t)k->scene->view.width, place = place_in_view(k, at);
    cts_raycast_ray(k->caster, (double)(place % width), (double)(place / width), rgba, NULL);
}

static void cast_judging(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(k->scene); i++) {
        double rgba[4];
        const size_t at = k->rays[i].at;
        cast_pixel(k, at, rgba);
        k->rays[i].square = cts_square_of_error(k->scene->preset, k->of.pixels + 4 * at, rgba);
    }
}

/* What the strips' rays show. */
static void judge_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        if (!s->judged)
            continue;
        s->found = 0; /* beyond stays: what a ray has shown of the bounds, mending others does not undo */
        for (size_t i = s->first_ray; i < s->first_ray + s->n_rays; i++) {
            const Ray *const ray = &k->rays[i];
            s->found += ray->square / fmin(s->chance * ray->limit, 1);
            s->beyond = fmax(s->beyond, ray->square / ray->limit);
        }
    }
}

/* The worst pixels of strips whose rays say that they err too much, in proportion to their bounds; where an error was
 * asked for, also of those whose bounds are too large for so few rays to show that it is kept. */
static void choose_bad(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    const double asked = 0.5 * cts_scene_error_asked(k->scene);
    Pixel *const scratch = k->scratch + (size_t)worker * k->strip_pixels;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        const double n_pixels = (double)(s->end - s->first), aimed = cts_scene_bound_aimed(k->scene);
        const double by_rays = s->found > 0 ? asked * asked * n_pixels * s->square / s->found : INFINITY;
        const double by_bounds = k->scene->plan.max_error > 0 ? (aimed * aimed + k->floor) * n_pixels : INFINITY;
        const double most = fmin(by_rays, by_bounds);
        const size_t limit = limit_of(k->scene, s->end - s->first);
        if (s->square <= most)
            continue;
        size_t n = 0;
        for (size_t i = s->first; i < s->end; i++)
            if ((double)k->of.bound[i] > asked)
                scratch[n++] = pixel_of(k->of.bound[i], i);
        select_worst(scratch, n, limit);
        n = n < limit ? n : limit;
        qsort(scratch, n, sizeof *scratch, worst_first);
        double rest = s->square;
        for (size_t i = 0; i < n && rest > most; i++) {
            rest -= square_at(k, place_of(scratch[i])) - k->floor;
            k->bad[strip * k->bad_room + s->n_bad++] = scratch[i];
        }
    }
}

static void cast_bad(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(k->scene); i++) {
        double rgba[4];
        const size_t at = place_of(k->bad[i]);
        cast_pixel(k, at, rgba);
        for (int c = 0; c < 4 && !CTS_MUTATED(UNCAST); c++)
            k->of.pixels[4 * at + (size_t)c] = (float)rgba[c];
        k->of.bound[at] = (float)(cts_scene_error_asked(k->scene) * CAST_WITHIN);
    }
}

static void find_some_largest(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        for (size_t i = s->first; i < s->end; i++) {
            const double bound = (double)k->of.bound[i];
            s->most = bound > s->most ? bound : s->most;
        }
    }
}

CtsStatus cts_bound_caster(CtsFrameBound *bound, const CtsScene *scene, const CtsRaycaster **caster, CtsError *err)
{
    CtsStatus st;
    if (!bound->caster) {
        if ((st = cts_raycaster_new(&bound->caster, scene, NULL, SIZE_MAX, err)))
            return st;
        cts_raycaster_loosen(bound->caster, cts_scene_error_asked(scene) * CAST_WITHIN);
    }
    *caster = bound->caster;
    return CTS_OK;
}

static CtsStatus cast(Keeping *k, CtsFrameBound *bound, size_t n, cts_work_fn work, CtsError *err)
{
    CtsStatus st;
    if (n == 0)
        return CTS_OK;
    if ((st = cts_bound_caster(bound, k->scene, &k->caster, err)))
        return st;
    cts_parallel(k->scene->settings->n_threads, n, 16, work, k);
    bound->cast += n;
    return cts_scene_stopped(k->scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}

/* Casts rays that judge the strips marked so. */
static CtsStatus judge(Keeping *k, CtsFrameBound *bound, CtsError *err)
{
    const int n_threads = k->scene->settings->n_threads;
    CtsStatus st;
    size_t n = 0;
    cts_parallel(n_threads, k->n_strips, 1, count_some, k);
    for (size_t strip = 0; strip < k->n_strips; strip++) {
        k->strips[strip].first_ray = n;
        n += k->strips[strip].n_rays;
    }
    cts_free(&k->rays);
    if ((st = cts_alloc_array(&k->rays, n, err)))
        return st;
    cts_parallel(n_threads, k->n_strips, 1, list_some, k);
    if ((st = cast(k, bound, n, cast_judging, err)))
        return st;
    cts_parallel(n_threads, k->n_strips, 1, judge_some, k);
    return CTS_OK;
}

/* Casts the worst pixels of strips that need it, which are then to be judged anew by rays of their own: those that told
 * which pixels to cast would speak too well of the rest. */
static CtsStatus mend(Keeping *k, CtsFrameBound *bound, CtsError *err)
{
    const int n_threads = k->scene->settings->n_threads;
    size_t n_bad = 0;
    cts_parallel(n_threads, k->n_strips, 1, choose_bad, k);
    for (size_t strip = 0; strip < k->n_strips; strip++) {
        Strip *const s = &k->strips[strip];
        memmove(k->bad + n_bad, k->bad + strip * k->bad_room, s->n_bad * sizeof *k->bad);
        n_bad += s->n_bad;
        s->judged = s->n_bad > 0;
    }
    return cast(k, bound, n_bad, cast_bad, err);
}

static void add_strips(CtsFrameBound *bound, const Keeping *k)
{
    for (size_t strip = 0; strip < k->n_strips; strip++) {
        const Strip *const s = &k->strips[strip];
        bound->most = fmax(bound->most, s->most);
        bound->found += s->found;
        bound->weight = fmax(bound->weight, 1 / s->chance);
        bound->beyond = fmax(bound->beyond, s->beyond);
    }
}

/* Strips end where strip_end says. */
static CtsStatus begin(Keeping *k, const size_t *strip_end, size_t n_strips, CtsError *err)
{
    const double floor = 0.5 * cts_scene_bound_aimed(k->scene);
    CtsStatus st;
    k->floor = floor * floor;
    k->n_strips = n_strips;
    if ((st = cts_alloc_zeroed(&k->strips, n_strips, err)))
        return st;
    for (size_t i = 0; i < n_strips; i++)
        k->strips[i] = (Strip){.first = i > 0 ? strip_end[i - 1] : 0, .end = strip_end[i], .judged = true};
    return CTS_OK;
}

static void end(Keeping *k, CtsFrameBound *bound, double wall, double cpu)
{
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
    cts_free(&k->strips);
    cts_free(&k->rays);
    cts_free(&k->scratch);
    cts_free(&k->bad);
}

static void add_judged(CtsFrameBound *bound, Keeping *k)
{
    cts_parallel(k->scene->settings->n_threads, k->n_strips, 1, find_some_largest, k);
    add_strips(bound, k);
}

CtsStatus cts_bound_judge(CtsFrameBound *bound, const CtsScene *scene, const CtsBoundSample *sample, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    Keeping k = {.scene = scene, .of = sample->of, .n_rays = sample->n_rays, .n_pixels = sample->n_pixels};
    CtsStatus st;
    if ((st = begin(&k, sample->strip_end, sample->n_strips, err)) || (st = judge(&k, bound, err)))
        goto end;
    add_judged(bound, &k);
    bound->judged += sample->n_strips > 0 ? sample->strip_end[sample->n_strips - 1] : 0;
end:
    end(&k, bound, wall, cpu);
    return st;
}

CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsScene *scene, CtsPicture *band, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const size_t width = (size_t)band->width, n_pixels = width * (size_t)band->height;
    const size_t strip_pixels = width * CTS_BAND_ROWS, n_strips = (n_pixels + strip_pixels - 1) / strip_pixels;
    Keeping k = {.scene = scene,
                 .of = {.first = (size_t)band->first_row * width, .pixels = band->pixels, .bound = band->bound},
                 .n_rays = cts_scene_rays_judged(scene),
                 .n_pixels = (double)scene->view.width * scene->view.height,
                 .strip_pixels = strip_pixels,
                 .bad_room = limit_of(scene, strip_pixels)};
    size_t *strip_end = NULL;
    CtsStatus st;
    if ((st = cts_alloc_array(&strip_end, n_strips, err)))
        return st;
    for (size_t i = 0; i < n_strips; i++)
        strip_end[i] = i + 1 < n_strips ? (i + 1) * strip_pixels : n_pixels;
    if ((st = begin(&k, strip_end, n_strips, err)) ||
        (st = cts_alloc_array(&k.scratch, (size_t)scene->settings->n_threads * strip_pixels, err)) ||
        (st = cts_alloc_array(&k.bad, n_strips * k.bad_room, err)) || (st = judge(&k, bound, err)) ||
        (st = mend(&k, bound, err)))
        goto end;
    k.round = 1;
    if ((st = judge(&k, bound, err)))
        goto end;
    add_judged(bound, &k);
    bound->pixels += n_pixels;
    bound->judged += n_pixels;
end:
    end(&k, bound, wall, cpu);
    cts_free(&strip_end);
    return st;
}

/* By the rays that were cast and, of a draft, by its pieces, which the rays have judged. */
double cts_bound_rmse(const CtsFrameBound *bound)
{
    const double judged =
        sqrt(cts_mean_limit(bound->found, bound->weight * fmax(bound->beyond, 1), (double)bound->judged));
    const double pieces = sqrt(cts_mean_limit(bound->piece_squares, bound->piece_most, (double)bound->pieces));
    const double half = cts_mean_limit(bound->half_squares, bound->half_most, bound->half_rays);
    const double at_half = (double)bound->at_half / (double)bound->pixels, rest = judged + pieces;
    return ROUNDED + sqrt(at_half * half + (1 - at_half) * rest * rest);
}

void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report)
{
    if (!report || bound->pixels == 0)
        return;
    const double rmse = cts_bound_rmse(bound) * (CTS_MUTATED(BOUND_LOW) ? 0.05 : 1),
                 asked = cts_scene_error_asked(scene);
    CtsErrorBound *told = &report->bound;
    /* Of a rotation the worst frame stands for all. */
    told->known = true;
    told->rmse = fmax(told->rmse, rmse);
    /* Bounds are worth what rays have shown, floor included. One channel may have all of a pixel's error, and stretches
     * whose errors add up as if by chance stray: the largest of so many pixels by so much. */
    const double floor = 0.5 * cts_scene_bound_aimed(scene);
    const double largest = sqrt(fmax(bound->beyond, 1) * (bound->most * bound->most + floor * floor));
    const double most = largest * sqrt(3 * 2 * log(fmax((double)bound->pixels, 2)));
    told->max =
        fmax(told->max, cts_scene_drafts(scene) ? 1 : fmin(most, 1)); /* a draft knows nothing of single pixels */
    told->cast += bound->cast;
    cts_report_stage(report, CTS_STAGE_COMPOSITE, bound->wall_ms, bound->cpu_ms, bound->cast, 0);
    if (bound->cast > 0)
        cts_report_plan(report, "%llu of %llu rays cast one by one, to judge the others and in place of the worst",
                        (unsigned long long)bound->cast, (unsigned long long)bound->pixels);
    if (bound->refined > 0)
        cts_report_plan(report, "%llu of %llu pixels of the draft rendered anew, where pieces of it erred too much",
                        (unsigned long long)bound->refined, (unsigned long long)bound->pixels);
    if (bound->half_rays > 0)
        cts_report_plan(report,
                        "%llu of %llu pixels of the draft at half the resolution, where %.0f rays show that it will do",
                        (unsigned long long)bound->at_half, (unsigned long long)bound->pixels, bound->half_rays);
    const bool kept = rmse <= 1.005 * asked, by_default = !(scene->plan.max_error > 0);
    /* What ctsplat aims at by itself, and misses by less than a step of eight bits, nobody sees. */
    const bool is_note = kept || (by_default && 255 * rmse <= 1);
    if (!kept || !by_default)
        cts_report_finding(report, kept ? "max_error" : "error_bound", is_note ? CTS_NOTE : CTS_WARNING,
                           "the picture's error is at most about %.2g/255 rms, %s %.2g%s", 255 * rmse,
                           by_default ? "aimed at" : "asked for", 255 * asked,
                           kept         ? ""
                           : by_default ? " (a smaller `max_error` takes longer)"
                                        : " (engine raycast is exact)");
}

void cts_bound_free(CtsFrameBound *bound)
{
    cts_raycaster_free(&bound->caster);
}
