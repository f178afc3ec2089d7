/* Stratified sampling: pixels fall into classes by the probable size of their error; each class is sampled evenly (the
 * pixels with the highest random numbers), with different densities. Half of the pixels are spread over the whole
 * picture evenly, so that no pixel stands for more than twice its share: errors in unexpected places are found too. */
#include "render/error/verify.h"

#include "base/clock.h"
#include "base/compare.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/random.h"
#include "base/simd_fixed.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Classes by factors of 4 in importance, from LEAST on. */
enum { CLASSES = CTS_VERIFY_CLASSES };
#define LEAST 0.1

typedef struct CtsCandidate {
    uint64_t random;
    int x, y;
    float rgba[4];
} CtsCandidate;

void cts_verify_begin(CtsVerify *v, const CtsScene *scene, size_t n)
{
    const size_t area = (size_t)scene->view.width * (size_t)scene->view.height;
    *v = (CtsVerify){.scene = scene, .n = n < area ? n : area, .seed = cts_reference_seed(scene), .choosing = n > 0};
}

/* The highest random numbers first; equal ones by place. */
static int by_random(const void *a, const void *b)
{
    const CtsCandidate *p = a, *q = b;
    if (p->random != q->random)
        return p->random < q->random ? 1 : -1;
    return p->y != q->y ? (p->y > q->y) - (p->y < q->y) : (p->x > q->x) - (p->x < q->x);
}

static void offer(CtsVerify *v, CtsVerifyClass *c, const CtsCandidate *candidate)
{
    if (c->n == 2 * v->n) {
        qsort(c->candidates, c->n, sizeof *c->candidates, by_random);
        c->n = v->n;
        c->least = c->candidates[c->n - 1].random;
    }
    if (c->n == c->room) {
        const size_t room = 2 * c->room + 64;
        CtsCandidate *const more = realloc(c->candidates, room * sizeof *more);
        if (!more) {
            v->lost = true;
            return;
        }
        c->candidates = more;
        c->room = room;
    }
    c->candidates[c->n++] = *candidate;
}

/* Red, green and blue as they are shown. */
static inline f32x4 pixel_at(const float *at, int n_channels, f32x4 background)
{
    if (n_channels != 4)
        return (f32x4){at[0]};
    const f32x4 f = *(const f32x4 *)at;
    return (f + (1 - f[3]) * background) * (f32x4){1, 1, 1, 0};
}

/* Rows are processed in groups, so that the division of a picture into bands does not matter; the ends of the picture
 * and of the groups are mirrored. Errors occur at visible pixels, along edges, and most of all at isolated pixels. */
static inline double importance(const CtsPicture *band, f32x4 back, int x, int y)
{
    const int n = band->n_channels, row = y % CTS_BAND_ROWS;
    const ptrdiff_t row_step = (ptrdiff_t)band->width * n;
    const float *at = band->pixels + (ptrdiff_t)y * row_step + (ptrdiff_t)x * n;
    const f32x4 here = pixel_at(at, n, back), left = pixel_at(x > 0 ? at - n : at, n, back);
    const f32x4 right = pixel_at(x < band->width - 1 ? at + n : at, n, back),
                above = pixel_at(row > 0 ? at - row_step : at, n, back);
    const f32x4 below = pixel_at(row < CTS_BAND_ROWS - 1 && y < band->height - 1 ? at + row_step : at, n, back);
    const f32x4 line[2][3] = {{left, here, right}, {above, here, below}};
    float edge = 0, spot = 0;
    for (int i = 0; i < 6; i++) {
        const f32x4 *const along = line[i / 3];
        const float before = along[1][i % 3] - along[0][i % 3], behind = along[2][i % 3] - along[1][i % 3];
        edge = cts_larger_float(edge, cts_larger_float(fabsf(before), fabsf(behind)));
        spot = cts_larger_float(spot, fabsf(behind - before));
    }
    const double edges = fmin((double)edge, 1), spots = fmin((double)spot, 1);
    const bool visible = here[0] > 0 || here[1] > 0 || here[2] > 0;
    return LEAST + visible + 30 * (edges + spots) + 1000 * spots * spots;
}

/* The engine's estimate of a pixel's error takes precedence over the picture's contrast: its square, at least a
 * sixteenth of 1/255. */
static inline double importance_of_bound(double bound)
{
    const double steps = 16 * 255 * bound;
    return LEAST * steps * steps;
}

static inline int class_of(double importance)
{
    int k = 0;
    for (double above = 4 * LEAST; k < CLASSES - 1 && importance >= above; above *= 4)
        k++;
    return k;
}

static void offer_pixels(CtsVerify *v, const CtsPicture *band, const float *bound)
{
    const int n = band->n_channels;
    const CtsPreset *p = v->scene->preset;
    f32x4 back = {0};
    for (int c = 0; c < 3 && !p->background_none; c++)
        back[c] = (float)p->background[c];
    for (int y = 0; y < band->height; y++)
        for (int x = 0; x < band->width; x++) {
            uint64_t state = v->seed ^ ((uint64_t)(band->first_row + y) << 32 | (uint64_t)x);
            const size_t pixel = (size_t)y * (size_t)band->width + (size_t)x;
            const double weight = bound ? importance_of_bound((double)bound[pixel]) : importance(band, back, x, y);
            CtsVerifyClass *class = &v->classes[class_of(weight)];
            CtsCandidate c = {.random = cts_random_next(&state), .x = x, .y = band->first_row + y};
            class->offered++;
            if (c.random < class->least)
                continue;
            const float *at = band->pixels + pixel * (size_t)n;
            for (int k = 0; k < 4; k++)
                c.rgba[k] = n == 4 ? at[k] : k == 3 ? 1 : at[0];
            offer(v, class, &c);
        }
}

void cts_verify_take(CtsVerify *v, const CtsPicture *band, const float *bound)
{
    if (v->choosing)
        offer_pixels(v, band, bound);
    for (size_t i = 0; v->reference && i < v->reference->n; i++)
        cts_reference_find(v->reference, band, i, v->found[i]);
}

/* Neighbouring classes that are sampled as one. */
typedef struct Stratum {
    int first, end;
    double share; /* of the pixels to choose */
    size_t area, n;
} Stratum;

/* Half of the share by area, half by area and importance. A stratum gets several pixels or joins the next. */
static int make_strata(const CtsVerify *v, Stratum stratum[CLASSES])
{
    enum { SEVERAL = 8 };
    double area = 0, important = 0;
    int n = 0;
    for (int k = 0; k < CLASSES; k++) {
        area += (double)v->classes[k].offered;
        important += ldexp((double)v->classes[k].offered, 2 * k);
    }
    Stratum open = {.end = CLASSES};
    for (int k = CLASSES - 1; k >= 0; k--) {
        const double offered = (double)v->classes[k].offered;
        open.first = k;
        open.area += v->classes[k].offered;
        open.share += 0.5 * (offered / area + ldexp(offered, 2 * k) / important);
        if ((double)v->n * open.share >= SEVERAL) {
            stratum[n++] = open;
            open = (Stratum){.end = k};
        }
    }
    if (n == 0)
        stratum[n++] = (Stratum){.end = CLASSES};
    stratum[n - 1].first = 0;
    stratum[n - 1].area += open.area;
    stratum[n - 1].share += open.share;
    return n;
}

/* Distributes n pixels over the strata by their shares, at most as many as a stratum has. */
static void share_out(Stratum *stratum, int n_strata, size_t n)
{
    double share = 0;
    size_t area = 0;
    for (int i = 0; i < n_strata; i++) {
        share += stratum[i].share;
        area += stratum[i].area;
    }
    for (bool whole = true; whole;) {
        whole = false;
        for (int i = 0; i < n_strata; i++) {
            Stratum *s = &stratum[i];
            if (s->n > 0 || (double)n * s->share < share * (double)s->area)
                continue;
            s->n = s->area;
            n -= s->n;
            area -= s->area;
            share -= s->share;
            whole = true;
        }
    }
    for (int i = 0; i < n_strata; i++) {
        Stratum *s = &stratum[i];
        if (s->n > 0)
            continue;
        area -= s->area;
        s->n = (size_t)((double)n * (s->share / share) + 0.5);
        s->n = s->n < s->area ? s->n : s->area;
        s->n = n - s->n > area ? n - area : s->n;
        n -= s->n;
        share -= s->share;
    }
}

/* The pixels of one stratum, from *at on. */
static CtsStatus choose_in(CtsVerify *v, const Stratum *s, double whole, size_t *at, CtsError *err)
{
    CtsCandidate *all = NULL;
    CtsReference *r = v->reference;
    size_t n = 0;
    for (int k = s->first; k < s->end; k++)
        n += v->classes[k].n;
    const CtsStatus st = cts_alloc_array(&all, n, err);
    n = 0;
    for (int k = s->first; k < s->end && !st; k++) {
        if (v->classes[k].n > 0)
            memcpy(all + n, v->classes[k].candidates, v->classes[k].n * sizeof *all);
        n += v->classes[k].n;
    }
    if (!st)
        qsort(all, n, sizeof *all, by_random);
    const double weight = (double)s->area / (double)s->n / whole;
    if (s->n < s->area)
        r->unit = fmax(r->unit, weight);
    for (size_t i = 0; i < s->n && !st; i++, ++*at) {
        r->xy[*at][0] = all[i].x;
        r->xy[*at][1] = all[i].y;
        r->weight[*at] = weight;
        memcpy(v->found[*at], all[i].rgba, sizeof all[i].rgba);
    }
    cts_free(&all);
    return st;
}

static void free_classes(CtsVerify *v)
{
    for (int k = 0; k < CLASSES; k++) {
        free(v->classes[k].candidates);
        v->classes[k] = (CtsVerifyClass){0};
    }
}

CtsStatus cts_verify_choose(CtsVerify *v, CtsError *err)
{
    CtsStatus st;
    Stratum stratum[CLASSES];
    if (v->lost)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const int n_strata = make_strata(v, stratum);
    size_t area = 0, at = 0;
    for (int i = 0; i < n_strata; i++)
        area += stratum[i].area;
    const size_t n = v->n < area ? v->n : area;
    share_out(stratum, n_strata, n);
    if ((st = cts_reference_empty(&v->reference, v->scene, n, err)) || (st = cts_alloc_zeroed(&v->found, n, err)))
        return st;
    for (int i = 0; i < n_strata && !st; i++)
        st = choose_in(v, &stratum[i], (double)area, &at, err);
    free_classes(v);
    v->choosing = false;
    return st;
}

CtsStatus cts_verify_end(CtsVerify *v, CtsReport *report, CtsError *err)
{
    const double start = cts_wall_ms(), cpu = cts_cpu_ms();
    CtsVerified verified;
    CtsStatus st;
    if (!v->choosing)
        return CTS_OK;
    if ((st = cts_verify_choose(v, err)) || (st = cts_reference_cast(v->reference, v->scene, err)) ||
        (st = cts_reference_evaluate(v->reference, (const float(*)[4])v->found, &verified, err)))
        return st;
    cts_error_limits(&verified);
    verified.wall_ms = cts_wall_ms() - start;
    verified.cpu_ms = cts_cpu_ms() - cpu;
    if (report)
        report->verified = verified;
    return CTS_OK;
}

void cts_verify_free(CtsVerify *v)
{
    free_classes(v);
    cts_reference_free(&v->reference);
    cts_free(&v->found);
}
