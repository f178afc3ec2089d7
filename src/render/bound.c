#include "render/bound.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SHARE_ASKED = 32, SHARE_BY_DEFAULT = 512 };

/* A pixel's bound and its place in the band as one number: the larger, the worse; of equals the upper left one. The
 * bits of floats that are not negative have the order of the floats. */
typedef uint64_t Pixel;

static size_t limit_of(const CtsScene *scene, size_t n_pixels)
{
    return n_pixels / (scene->plan.max_error > 0 ? SHARE_ASKED : SHARE_BY_DEFAULT);
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

/* What came of CTS_BAND_ROWS rows. */
typedef struct Strip {
    size_t n_cast;
    double square, most; /* of the bounds that are left */
} Strip;

typedef struct Keeping {
    const CtsScene *scene;
    CtsPicture *band;
    size_t n_pixels, strip_pixels, n_strips;
    size_t limit; /* of pixels that a strip may have cast */
    Strip *strips;
    Pixel *cast;    /* room for limit of each strip */
    Pixel *scratch; /* of each worker, room for a strip */
    const CtsRaycaster *caster;
} Keeping;

/* Pixels of the strip that are to be cast. */
static size_t choose(const Keeping *k, const float *bound, size_t first, size_t n, Pixel *bad, Pixel *cast)
{
    const double asked = cts_scene_error_asked(k->scene), most = asked * asked * (double)n;
    double square = 0;
    size_t n_bad = 0, n_cast = 0;
    for (size_t i = first; i < first + n; i++) {
        square += (double)bound[i] * (double)bound[i];
        if ((double)bound[i] > asked)
            bad[n_bad++] = pixel_of(bound[i], i);
    }
    if (square <= most)
        return 0;
    const size_t limit = limit_of(k->scene, n);
    select_worst(bad, n_bad, limit);
    n_bad = n_bad < limit ? n_bad : limit;
    qsort(bad, n_bad, sizeof *bad, worst_first);
    while (n_cast < n_bad && square > most) {
        const double largest = (double)bound[place_of(bad[n_cast])];
        square -= largest * largest;
        cast[n_cast] = bad[n_cast];
        n_cast++;
    }
    return n_cast;
}

static size_t strip_end(const Keeping *k, size_t strip)
{
    const size_t end = (strip + 1) * k->strip_pixels;
    return end < k->n_pixels ? end : k->n_pixels;
}

static void choose_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    Pixel *const scratch = k->scratch + (size_t)worker * k->strip_pixels;
    for (size_t strip = first; strip < end; strip++) {
        const size_t at = strip * k->strip_pixels;
        k->strips[strip].n_cast =
            choose(k, k->band->bound, at, strip_end(k, strip) - at, scratch, k->cast + strip * k->limit);
    }
}

static void cast_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(k->scene); i++) {
        const uint32_t at = place_of(k->cast[i]), width = (uint32_t)k->band->width;
        double rgba[4];
        cts_raycast_ray(k->caster, at % width, (double)(at / width) + k->band->first_row, rgba, NULL);
        for (int c = 0; c < 4 && !CTS_MUTATED(UNCAST); c++)
            k->band->pixels[4 * (size_t)at + (size_t)c] = (float)rgba[c];
        k->band->bound[at] = 1e-6f; /* what the ray caster and single precision leave */
    }
}

static void sum_some(void *context, int worker, size_t first, size_t end)
{
    const Keeping *const k = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &k->strips[strip];
        for (size_t i = strip * k->strip_pixels; i < strip_end(k, strip); i++) {
            const double bound = (double)k->band->bound[i];
            s->square += bound * bound;
            s->most = bound > s->most ? bound : s->most;
        }
    }
}

/* The strips' pixels one behind the other. */
static size_t gather(const Keeping *k)
{
    size_t n = 0;
    for (size_t strip = 0; strip < k->n_strips; strip++) {
        memmove(k->cast + n, k->cast + strip * k->limit, k->strips[strip].n_cast * sizeof *k->cast);
        n += k->strips[strip].n_cast;
    }
    return n;
}

CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsScene *scene, CtsPicture *band, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const int n_threads = scene->settings->n_threads;
    const size_t strip_pixels = (size_t)band->width * CTS_BAND_ROWS, n_pixels = (size_t)band->width * band->height;
    Keeping k = {.scene = scene,
                 .band = band,
                 .n_pixels = n_pixels,
                 .strip_pixels = strip_pixels,
                 .n_strips = (n_pixels + strip_pixels - 1) / strip_pixels,
                 .limit = limit_of(scene, strip_pixels)};
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&k.strips, k.n_strips, err)) ||
        (st = cts_alloc_array(&k.cast, k.n_strips * k.limit, err)) ||
        (st = cts_alloc_array(&k.scratch, (size_t)n_threads * strip_pixels, err)))
        goto end;
    cts_parallel(n_threads, k.n_strips, 1, choose_some, &k);
    const size_t n_cast = gather(&k);
    if (n_cast > 0 && !bound->caster && (st = cts_raycaster_new(&bound->caster, scene, NULL, SIZE_MAX, err)))
        goto end;
    k.caster = bound->caster;
    cts_parallel(n_threads, n_cast, 16, cast_some, &k);
    if (cts_scene_stopped(scene)) {
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
        goto end;
    }
    cts_parallel(n_threads, k.n_strips, 1, sum_some, &k);
    for (size_t strip = 0; strip < k.n_strips; strip++) {
        bound->square += k.strips[strip].square;
        bound->most = fmax(bound->most, k.strips[strip].most);
    }
    bound->pixels += n_pixels;
    bound->cast += n_cast;
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
end:
    cts_free(&k.strips);
    cts_free(&k.cast);
    cts_free(&k.scratch);
    return st;
}

void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report)
{
    if (!report || bound->pixels == 0)
        return;
    const double rmse = sqrt(bound->square / (double)bound->pixels) * (CTS_MUTATED(BOUND_LOW) ? 0.25 : 1);
    CtsErrorBound *told = &report->bound;
    /* Of a rotation the worst frame stands for all. */
    told->known = true;
    told->rmse = fmax(told->rmse, rmse);
    told->max = fmax(told->max, fmin(bound->most * sqrt(3), 1));
    told->cast += bound->cast;
    cts_report_stage(report, CTS_STAGE_COMPOSITE, bound->wall_ms, bound->cpu_ms, bound->cast, 0);
    if (bound->cast > 0)
        cts_report_plan(report, "%llu of %llu rays cast again one by one, whose error might be large",
                        (unsigned long long)bound->cast, (unsigned long long)bound->pixels);
    /* Asked for, an error is kept or warned of. The default is what plans aim at, and a bound lies up to four times
     * above the error it bounds: up to there it is a note. */
    const double asked = cts_scene_error_asked(scene);
    const bool kept = rmse <= 1.005 * asked, by_default = !(scene->plan.max_error > 0);
    if (!kept || !by_default)
        cts_report_finding(report, kept ? "max_error" : "error_bound",
                           kept || (by_default && rmse <= 4 * asked) ? CTS_NOTE : CTS_WARNING,
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
