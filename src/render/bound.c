#include "render/bound.h"

#include "base/clock.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <stdlib.h>

enum { SHARE_ASKED = 32, SHARE_BY_DEFAULT = 512 };

typedef struct Pixel {
    float bound;
    uint32_t at; /* in the band */
} Pixel;

/* The worst first; of equals the upper left one. */
static int by_bound(const void *a, const void *b)
{
    const Pixel *p = a, *q = b;
    return p->bound != q->bound ? (p->bound < q->bound) - (p->bound > q->bound) : (p->at > q->at) - (p->at < q->at);
}

/* Pixels of the strip from `first` on that are to be cast, into worst, which has room for all. */
static size_t choose(const CtsScene *scene, const float *bound, size_t first, size_t n, Pixel *worst)
{
    const double asked = cts_scene_error_asked(scene), most = asked * asked * (double)n;
    double square = 0;
    size_t n_bad = 0, n_cast = 0;
    for (size_t i = first; i < first + n; i++) {
        square += (double)bound[i] * (double)bound[i];
        if ((double)bound[i] > asked)
            worst[n_bad++] = (Pixel){bound[i], (uint32_t)i};
    }
    if (square <= most)
        return 0;
    const size_t limit = n / (scene->plan.max_error > 0 ? SHARE_ASKED : SHARE_BY_DEFAULT);
    qsort(worst, n_bad, sizeof *worst, by_bound);
    while (n_cast < n_bad && n_cast < limit && square > most) {
        square -= (double)worst[n_cast].bound * (double)worst[n_cast].bound;
        n_cast++;
    }
    return n_cast;
}

typedef struct Cast {
    const CtsScene *scene;
    const CtsRaycaster *caster;
    CtsPicture *band;
    const Pixel *pixels;
} Cast;

static void cast_pixels(void *context, int worker, size_t first, size_t end)
{
    const Cast *const c = context;
    (void)worker;
    for (size_t i = first; i < end && !cts_scene_stopped(c->scene); i++) {
        const uint32_t at = c->pixels[i].at, width = (uint32_t)c->band->width;
        double rgba[4];
        cts_raycast_ray(c->caster, at % width, (double)(at / width) + c->band->first_row, rgba, NULL);
        for (int k = 0; k < 4; k++)
            c->band->pixels[4 * (size_t)at + (size_t)k] = (float)rgba[k];
        c->band->bound[at] = 1e-6f; /* what the ray caster and single precision leave */
    }
}

CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsScene *scene, CtsPicture *band, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const size_t width = (size_t)band->width, n = width * (size_t)band->height, strip = width * CTS_BAND_ROWS;
    CtsStatus st = CTS_OK;
    Pixel *pixels = NULL;
    size_t n_cast = 0;
    if ((st = cts_alloc_array(&pixels, n, err)))
        return st;
    for (size_t first = 0; first < n; first += strip)
        n_cast += choose(scene, band->bound, first, n - first < strip ? n - first : strip, pixels + n_cast);
    if (n_cast > 0 && !bound->caster)
        st = cts_raycaster_new(&bound->caster, scene, NULL, SIZE_MAX, err);
    if (!st) {
        Cast cast = {scene, bound->caster, band, pixels};
        cts_parallel(scene->settings->n_threads, n_cast, 16, cast_pixels, &cast);
        st = cts_scene_stopped(scene) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
    }
    for (size_t i = 0; i < n && !st; i++) {
        bound->square += (double)band->bound[i] * (double)band->bound[i];
        bound->most = fmax(bound->most, (double)band->bound[i]);
    }
    bound->pixels += n;
    bound->cast += n_cast;
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
    cts_free(&pixels);
    return st;
}

void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report)
{
    if (!report || bound->pixels == 0)
        return;
    const double rmse = sqrt(bound->square / (double)bound->pixels);
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
