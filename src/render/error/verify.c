/* Stratified sampling: pixels fall into classes by the probable size of their error; each class is sampled evenly (the
 * pixels with the highest random numbers), with different densities. Half of the pixels are spread over the whole
 * picture evenly, so that no pixel stands for more than twice its share: errors in unexpected places are found too. */
#include "render/error/verify.h"

#include "base/clock.h"
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

CtsStatus cts_verify_begin(CtsVerify *v, const CtsScene *scene, size_t n, CtsError *err)
{
    const size_t area = (size_t)scene->view.width * (size_t)scene->view.height;
    (void)err;
    *v = (CtsVerify){.scene = scene, .n = n < area ? n : area, .seed = cts_reference_seed(scene), .choosing = n > 0};
    return CTS_OK;
}

/* The lowest random number stays on top. */
static void sift_down(CtsCandidate *heap, size_t n)
{
    const CtsCandidate moved = heap[0];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < n; at = child) {
        if (child + 1 < n && heap[child + 1].random < heap[child].random)
            child++;
        if (!(heap[child].random < moved.random))
            break;
        heap[at] = heap[child];
    }
    heap[at] = moved;
}

static void sift_up(CtsCandidate *heap, size_t at)
{
    const CtsCandidate moved = heap[at];
    for (; at > 0 && moved.random < heap[(at - 1) / 2].random; at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = moved;
}

static bool has_room(CtsVerify *v, CtsVerifyClass *c)
{
    if (c->n < c->room)
        return true;
    const size_t room = c->room > 0 ? 2 * c->room : 64;
    CtsCandidate *heap = realloc(c->heap, (room < v->n ? room : v->n) * sizeof *heap);
    if (!heap)
        return false;
    c->heap = heap;
    c->room = room < v->n ? room : v->n;
    return true;
}

static void offer(CtsVerify *v, CtsVerifyClass *c, const CtsCandidate *candidate)
{
    if (c->n == v->n) {
        c->heap[0] = *candidate;
        sift_down(c->heap, c->n);
    } else if (has_room(v, c)) {
        c->heap[c->n] = *candidate;
        sift_up(c->heap, c->n++);
    } else {
        v->lost = true;
    }
}

/* Red, green and blue as they are shown. */
static inline f32x4 pixel_at(const float *at, int n_channels, f32x4 background)
{
    if (n_channels != 4)
        return (f32x4){at[0]};
    const f32x4 f = *(const f32x4 *)at;
    return (f + (1 - f[3]) * background) * (f32x4){1, 1, 1, 0};
}

static inline f32x4 size_of(f32x4 a)
{
    return (f32x4)((i32x4)a & 0x7fffffff);
}

static inline bool is_zero(f32x4 a)
{
    uint64_t bits[2];
    memcpy(bits, &a, sizeof bits);
    return (bits[0] | bits[1]) == 0;
}

static inline f32x4 larger(f32x4 a, f32x4 b)
{
    const i32x4 more = a > b;
    return (f32x4)((more & (i32x4)a) | (~more & (i32x4)b));
}

static inline double largest_of(f32x4 a)
{
    const float x = a[0] > a[1] ? a[0] : a[1], y = a[2] > a[3] ? a[2] : a[3];
    return (double)(x > y ? x : y);
}

/* The largest first and second difference to the neighbours on one line. */
static inline void line_differences(f32x4 before, f32x4 here, f32x4 behind, f32x4 *first, f32x4 *second)
{
    const f32x4 back = here - before, on = behind - here;
    *first = larger(*first, larger(size_of(back), size_of(on)));
    *second = larger(*second, size_of(on - back));
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
    if (is_zero((f32x4)((i32x4)here | (i32x4)left | (i32x4)right | (i32x4)above | (i32x4)below)))
        return LEAST;
    f32x4 first = {0}, second = {0};
    line_differences(left, here, right, &first, &second);
    line_differences(above, here, below, &first, &second);
    double edge = largest_of(first), spot = largest_of(second);
    edge = edge < 1 ? edge : 1;
    spot = spot < 1 ? spot : 1;
    return LEAST + (largest_of(here) > 0 ? 1 : 0) + 30 * (edge + spot) + 1000 * spot * spot;
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
            if (class->n == v->n && c.random <= class->heap[0].random)
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

static int by_random(const void *a, const void *b)
{
    const CtsCandidate *p = a, *q = b;
    if (p->random != q->random)
        return p->random < q->random ? 1 : -1;
    return p->y != q->y ? (p->y > q->y) - (p->y < q->y) : (p->x > q->x) - (p->x < q->x);
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
            memcpy(all + n, v->classes[k].heap, v->classes[k].n * sizeof *all);
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
        free(v->classes[k].heap);
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

CtsStatus cts_verify_cast(CtsVerify *v, CtsError *err)
{
    return cts_reference_cast(v->reference, v->scene, err);
}

CtsStatus cts_verify_end(CtsVerify *v, CtsReport *report, CtsError *err)
{
    const double start = cts_wall_ms(), cpu = cts_cpu_ms();
    CtsVerified verified;
    CtsStatus st;
    if (!v->choosing)
        return CTS_OK;
    if ((st = cts_verify_choose(v, err)) || (st = cts_verify_cast(v, err)) ||
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
