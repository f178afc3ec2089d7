#include "render/error/bound.h"

#include "base/chance.h"
#include "base/clock.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

/* What single precision leaves, rms, where nothing else errs. */
#define ROUNDED 1e-5

/* Errors lie so far below an engine's bounds, hardly less, that pixels are worth this share of them. */
#define WORTH 0.5
/* The floor f, and what a strip may err by, as shares of the error asked for. */
#define FLOOR 0.25
#define AIMED 1.0

/* One pixel in so many is made again to judge the others, more of a small picture, and hardly more than one in FIRST;
 * of a strip that errs too much MORE times as many, round by round, up to one in MOST. A small picture's are all. */
enum { ONE_IN = 512, FIRST = 256, MOST = 12, MORE = 6, ROUNDS = 4, SMALL = 1024 };

/* What came of CTS_BAND_ROWS rows. */
typedef struct Strip {
    size_t first, end; /* its pixels */
    bool open;         /* judged in this round */
    double chance;     /* of a pixel to be made again is this times b^2 + f^2 */
    size_t first_again, n_again, n_made, n_between;
    double share; /* for each pixel that had a ray so many err as it does: what lies between errs as they do, besides */
    double found, beyond, most;
} Strip;

typedef struct Keeping {
    const CtsScene *scene;
    CtsPicture *band;
    double floor;  /* f^2 */
    double small;  /* of a small picture this share may be made again in any case */
    double one_in; /* of so many pixels one is made again, where their bounds are worth the error asked for */
    Strip *strips;
    size_t n_strips, n_again;
    int round;
    uint32_t *place; /* pixels of the band that are made again in this round, strip by strip */
    float (*rgba)[4], *off;
} Keeping;

/* A pixel that is known exactly has no bound any more. Nor are those judged whose bounds are negative: of them the
 * engine tells. */
#define KNOWN -INFINITY

/* What ctsplat aims at by itself, and misses by less than a step of eight bits, nobody sees. */
static double warned_from(const CtsScene *scene)
{
    const double asked = cts_scene_error_asked(scene);
    return scene->plan.max_error > 0 ? 1.005 * asked : fmax(asked, 1.0 / 255);
}

static double square_at(const Keeping *k, size_t at)
{
    const double bound = WORTH * (double)k->band->bound[at];
    return bound < 0 ? 0 : bound * bound + k->floor;
}

static double chance_at(const Keeping *k, const Strip *s, size_t at)
{
    return fmin(s->chance * square_at(k, at), 1);
}

/* By a number that is even over 0..1, and its own for each pixel of the view and each round. */
static bool is_drawn(const Keeping *k, const Strip *s, size_t at)
{
    const uint64_t place = (uint64_t)k->band->first_row * (uint64_t)k->band->width + at;
    const uint64_t number = place + ((uint64_t)k->round << 60) + 1;
    return (double)(cts_chance_bits(number) >> 11) * 0x1p-53 < chance_at(k, s, at);
}

static double share_of(const Keeping *k, Strip *s)
{
    size_t n_seen = 0;
    for (size_t i = s->first; i < s->end; i++) {
        const bool between = k->band->bound[i] < 0;
        s->n_between += between;
        n_seen += !between && k->band->pixels[4 * i + 3] > 0;
    }
    return n_seen > 0 ? 1 + (double)s->n_between / (double)n_seen : 1;
}

/* How many pixels of each strip are made again: so many as are worth the error asked for, few where the strip is good
 * and where it is so bad that more would tell no more. */
static void count_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    const double asked = cts_scene_error_asked(k->scene);
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        s->n_again = 0;
        if (!s->open)
            continue;
        const double most = (double)(s->end - s->first) * fmin(k->small + 1.0 / (k->round == 0 ? FIRST : MOST), 1);
        s->share = k->round == 0 ? share_of(k, s) : s->share;
        s->chance = k->round == 0 ? 1 / (k->one_in * asked * asked) : MORE * s->chance;
        double expected = 0;
        for (size_t i = s->first; i < s->end; i++)
            expected += chance_at(k, s, i);
        if (expected > most)
            s->chance *= most / expected;
        for (size_t i = s->first; i < s->end; i++)
            s->n_again += is_drawn(k, s, i);
    }
}

static void list_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        const Strip *const s = &k->strips[strip];
        uint32_t *place = k->place + s->first_again;
        for (size_t i = s->first; i < s->end && s->n_again > 0; i++)
            if (is_drawn(k, s, i))
                *place++ = (uint32_t)i;
    }
}

/* Nor is what was made again exact: what it is off by at most comes on top. */
static double error_again(const Keeping *k, size_t i)
{
    return WORTH * (double)k->off[i];
}

/* What all of a picture like this strip would be told to err by, squared. */
static double told_square(const Keeping *k, const Strip *s)
{
    const double pixels = (double)k->scene->view.width * k->scene->view.height, n = (double)(s->end - s->first);
    return cts_mean_limit(s->found * pixels / n, s->share / s->chance * fmax(s->beyond, 1), pixels);
}

/* Whether a strip is to be judged by more of its pixels: it errs too much, or, as far as those tell that were made
 * again, may err so much that a warning would be due. */
static bool needs_more(const Keeping *k, const Strip *s)
{
    const double n = (double)(s->end - s->first), asked = cts_scene_error_asked(k->scene);
    const double aimed = AIMED * asked, warned = warned_from(k->scene);
    return (double)s->n_made < n * fmin(k->small + 1.0 / MOST, 1) &&
           (s->found > n * aimed * aimed || told_square(k, s) > warned * warned);
}

/* What the pixels show that were made again, which are then put right. */
static void judge_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        s->found = s->open ? 0 : s->found;
        for (size_t i = s->first_again; i < s->first_again + s->n_again; i++) {
            const size_t at = k->place[i];
            float *const pixel = k->band->pixels + 4 * at;
            const double off = error_again(k, i), p = chance_at(k, s, at),
                         error = sqrt(cts_scene_square_of_error(k->scene, pixel, k->rgba[i])) + off,
                         square = error * error;
            s->found += s->share * square * (1 - p) / p + off * off;
            if (p < 1)
                s->beyond = fmax(s->beyond, square / square_at(k, at));
            if (!CTS_MUTATED(UNCAST))
                memcpy(pixel, k->rgba[i], sizeof k->rgba[i]);
        }
        for (size_t i = s->first_again; i < s->first_again + s->n_again; i++)
            k->band->bound[k->place[i]] = KNOWN;
        s->n_made += s->n_again;
        s->open = s->open && needs_more(k, s);
    }
}

static CtsStatus run_round(Keeping *k, const CtsEngine *engine, CtsError *err)
{
    const int n_threads = k->scene->settings->n_threads;
    CtsStatus st;
    cts_parallel(n_threads, k->n_strips, 1, count_some, k);
    k->n_again = 0;
    for (size_t i = 0; i < k->n_strips; i++) {
        k->strips[i].first_again = k->n_again;
        k->n_again += k->strips[i].n_again;
    }
    cts_free(&k->place);
    cts_free(&k->rgba);
    cts_free(&k->off);
    if ((st = cts_alloc_array(&k->place, k->n_again, err)) || (st = cts_alloc_array(&k->rgba, k->n_again, err)) ||
        (st = cts_alloc_array(&k->off, k->n_again, err)))
        return st;
    cts_parallel(n_threads, k->n_strips, 1, list_some, k);
    if (k->n_again > 0 && (st = engine->again(k->scene, k->band, k->place, k->n_again, k->rgba, k->off, err)))
        return st;
    cts_parallel(n_threads, k->n_strips, 1, judge_some, k);
    return CTS_OK;
}

static void find_some_largest(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        for (size_t i = s->first; i < s->end; i++) {
            float *const bound = &k->band->bound[i];
            s->most = fmax(s->most, WORTH * (double)*bound);
            *bound = isfinite(*bound) ? fabsf(*bound) : 0;
        }
    }
}

static bool any_open(const Keeping *k)
{
    for (size_t i = 0; i < k->n_strips; i++)
        if (k->strips[i].open)
            return true;
    return false;
}

CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                         CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms(), floor = FLOOR * cts_scene_error_asked(scene);
    const double pixels = (double)scene->view.width * scene->view.height;
    const size_t n = (size_t)band->width * (size_t)band->height, strip = (size_t)band->width * CTS_BAND_ROWS;
    Keeping k = {.scene = scene,
                 .band = band,
                 .floor = floor * floor,
                 .n_strips = (n + strip - 1) / strip,
                 .small = SMALL / pixels,
                 .one_in = fmax(fmin(pixels / ONE_IN, ONE_IN), 1)};
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&k.strips, k.n_strips, err)))
        return st;
    for (size_t i = 0; i < k.n_strips; i++)
        k.strips[i] = (Strip){.first = i * strip, .end = i + 1 < k.n_strips ? (i + 1) * strip : n, .open = true};
    for (; k.round < ROUNDS && any_open(&k); k.round++)
        if ((st = run_round(&k, engine, err)))
            goto end;
    cts_parallel(scene->settings->n_threads, k.n_strips, 1, find_some_largest, &k);
    for (size_t i = 0; i < k.n_strips; i++) {
        const Strip *const s = &k.strips[i];
        bound->found += s->found;
        bound->weight = fmax(bound->weight, s->share / s->chance);
        bound->beyond = fmax(bound->beyond, s->beyond);
        bound->most = fmax(bound->most, s->most);
        bound->again += s->n_made;
        bound->between += s->n_between;
    }
    bound->missed += band->missed;
    bound->missed_most = fmax(bound->missed_most, band->missed_most);
    bound->pixels += n;
end:
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
    cts_free(&k.strips);
    cts_free(&k.place);
    cts_free(&k.rgba);
    cts_free(&k.off);
    return st;
}

double cts_bound_rmse(const CtsFrameBound *bound)
{
    const double weight = bound->weight * fmax(bound->beyond, 1), n = (double)bound->pixels;
    return ROUNDED +
           sqrt(cts_mean_limit(bound->found, weight, n) + cts_mean_limit(bound->missed, bound->missed_most, n));
}

void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report)
{
    if (!report || bound->pixels == 0)
        return;
    const double rmse = cts_bound_rmse(bound) * (CTS_MUTATED(BOUND_LOW) ? 0.05 : 1),
                 asked = cts_scene_error_asked(scene), floor = FLOOR * asked;
    CtsErrorBound *told = &report->bound;
    /* Of a rotation the worst frame stands for all. Bounds are worth what pixels have shown, floor included; one
     * channel may have all of a pixel's error; and of the pixels that nobody looked at one may err twice as much, or be
     * anything where there was no ray. */
    const double largest = 2 * sqrt(3 * fmax(bound->beyond, 1) * (bound->most * bound->most + floor * floor));
    told->known = true;
    told->rmse = fmax(told->rmse, rmse);
    told->max = fmax(told->max, bound->between > 0 ? 1 : fmin(largest / WORTH, 1));
    told->cast += bound->again;
    cts_report_stage(report, CTS_STAGE_COMPOSITE, bound->wall_ms, bound->cpu_ms, bound->again, 0);
    cts_report_plan(report,
                    "%llu of %llu pixels made again in double precision, to judge the others and to mend the worst",
                    (unsigned long long)bound->again, (unsigned long long)bound->pixels);
    const bool kept = rmse <= 1.005 * asked, by_default = !(scene->plan.max_error > 0);
    const bool is_note = kept || rmse <= warned_from(scene);
    if (!kept || !by_default)
        cts_report_finding(report, kept ? "max_error" : "error_bound", is_note ? CTS_NOTE : CTS_WARNING,
                           "the picture's error is at most about %.2g/255 rms, %s %.2g%s", 255 * rmse,
                           by_default ? "aimed at" : "asked for", 255 * asked,
                           kept ? "" : " (engine raycast is exact)");
}
