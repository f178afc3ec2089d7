/* Priority sampling (Duffield, Lund, Thorup 2007): of pixels that weigh w, those with the n highest w / u, u random in
 * 0..1, are kept. With the next highest as t, a pixel stands for max(w, t) / w pixels, and sums have no bias. */
#include "render/verify.h"

#include "base/clock.h"
#include "base/mem.h"
#include <math.h>
#include <string.h>

typedef struct CtsCandidate {
    double priority, weight;
    int x, y;
    float rgba[4];
} CtsCandidate;

CtsStatus cts_verify_begin(CtsVerify *v, const CtsScene *scene, size_t n, CtsError *err)
{
    const size_t area = (size_t)scene->view.width * (size_t)scene->view.height;
    *v = (CtsVerify){.scene = scene, .n = n < area ? n : area, .seed = cts_reference_seed(scene)};
    return cts_alloc_array(&v->heap, v->n + 1, err);
}

/* The lowest priority stays on top. */
static void sift_down(CtsCandidate *heap, size_t n)
{
    const CtsCandidate moved = heap[0];
    size_t at = 0;
    for (size_t child; (child = 2 * at + 1) < n; at = child) {
        if (child + 1 < n && heap[child + 1].priority < heap[child].priority)
            child++;
        if (!(heap[child].priority < moved.priority))
            break;
        heap[at] = heap[child];
    }
    heap[at] = moved;
}

static void sift_up(CtsCandidate *heap, size_t at)
{
    const CtsCandidate moved = heap[at];
    for (; at > 0 && moved.priority < heap[(at - 1) / 2].priority; at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = moved;
}

static void offer(CtsVerify *v, const CtsCandidate *c)
{
    if (v->n_heap <= v->n) {
        v->heap[v->n_heap] = *c;
        sift_up(v->heap, v->n_heap++);
    } else if (c->priority > v->heap[0].priority) {
        v->heap[0] = *c;
        sift_down(v->heap, v->n_heap);
    }
}

typedef float Four __attribute__((vector_size(16)));
typedef int32_t Bits __attribute__((vector_size(16)));

/* Red, green and blue as they are shown. */
static inline Four pixel_at(const float *at, int n_channels, Four background)
{
    if (n_channels != 4)
        return (Four){at[0]};
    Four f;
    memcpy(&f, at, sizeof f);
    return (f + (1 - f[3]) * background) * (Four){1, 1, 1, 0};
}

static inline Four size_of(Four a)
{
    return (Four)((Bits)a & 0x7fffffff);
}

static inline bool is_zero(Four a)
{
    uint64_t bits[2];
    memcpy(bits, &a, sizeof bits);
    return (bits[0] | bits[1]) == 0;
}

static inline Four larger(Four a, Four b)
{
    const Bits more = a > b;
    return (Four)((more & (Bits)a) | (~more & (Bits)b));
}

static inline double largest_of(Four a)
{
    const float x = a[0] > a[1] ? a[0] : a[1], y = a[2] > a[3] ? a[2] : a[3];
    return (double)(x > y ? x : y);
}

/* The largest first and second difference to the neighbours on one line. */
static inline void line_differences(Four before, Four here, Four behind, Four *first, Four *second)
{
    const Four back = here - before, on = behind - here;
    *first = larger(*first, larger(size_of(back), size_of(on)));
    *second = larger(*second, size_of(on - back));
}

/* Rows are looked at in groups, so that how a picture is cut into bands does not matter; the picture's and the groups'
 * ends are mirrored. Errors lie where something is seen, along edges, and most of all where single pixels stand out. */
static inline double importance(const CtsPicture *band, Four back, int x, int y)
{
    const int n = band->n_channels, row = y % CTS_BAND_ROWS;
    const ptrdiff_t row_step = (ptrdiff_t)band->width * n;
    const float *at = band->pixels + (ptrdiff_t)y * row_step + (ptrdiff_t)x * n;
    const Four here = pixel_at(at, n, back), left = pixel_at(x > 0 ? at - n : at, n, back);
    const Four right = pixel_at(x < band->width - 1 ? at + n : at, n, back),
               above = pixel_at(row > 0 ? at - row_step : at, n, back);
    const Four below = pixel_at(row < CTS_BAND_ROWS - 1 && y < band->height - 1 ? at + row_step : at, n, back);
    const double least = 0.1;
    if (is_zero((Four)((Bits)here | (Bits)left | (Bits)right | (Bits)above | (Bits)below)))
        return least;
    Four first = {0}, second = {0};
    line_differences(left, here, right, &first, &second);
    line_differences(above, here, below, &first, &second);
    double edge = largest_of(first), spot = largest_of(second);
    edge = edge < 1 ? edge : 1;
    spot = spot < 1 ? spot : 1;
    return least + (largest_of(here) > 0 ? 1 : 0) + 30 * (edge + spot) + 1000 * spot * spot;
}

static void offer_pixels(CtsVerify *v, const CtsPicture *band)
{
    const int n = band->n_channels;
    const CtsPreset *p = v->scene->preset;
    Four back = {0};
    for (int c = 0; c < 3 && !p->background_none; c++)
        back[c] = (float)p->background[c];
    v->offered += (uint64_t)band->width * (uint64_t)band->height;
    for (int y = 0; y < band->height; y++)
        for (int x = 0; x < band->width; x++) {
            uint64_t state = v->seed ^ ((uint64_t)(band->first_row + y) << 32 | (uint64_t)x);
            const double random = ((double)(int64_t)(cts_reference_random(&state) >> 11) + 1) * 0x1p-53;
            const double weight = importance(band, back, x, y);
            if (v->n_heap > v->n && !(weight > v->heap[0].priority * random))
                continue;
            const float *at = band->pixels + ((size_t)y * (size_t)band->width + (size_t)x) * (size_t)n;
            CtsCandidate c = {.priority = weight / random, .weight = weight, .x = x, .y = band->first_row + y};
            for (int k = 0; k < 4; k++)
                c.rgba[k] = n == 4 ? at[k] : k == 3 ? 1 : at[0];
            offer(v, &c);
        }
}

void cts_verify_take(CtsVerify *v, const CtsPicture *band)
{
    if (v->heap)
        offer_pixels(v, band);
    for (size_t i = 0; v->reference && i < v->reference->n; i++)
        cts_reference_find(v->reference, band, i, v->found[i]);
}

CtsStatus cts_verify_choose(CtsVerify *v, CtsError *err)
{
    CtsStatus st;
    const size_t first = v->n_heap > v->n ? 1 : 0, n = v->n_heap - first;
    const double threshold = first > 0 ? v->heap[0].priority : 0, area = (double)v->offered;
    if ((st = cts_reference_empty(&v->reference, v->scene, n, err)) || (st = cts_alloc_zeroed(&v->found, n, err)) ||
        (st = cts_alloc_array(&v->reference->variance, n, err)))
        return st;
    for (size_t i = 0; i < n; i++) {
        const CtsCandidate *c = &v->heap[first + i];
        CtsReference *r = v->reference;
        r->xy[i][0] = c->x;
        r->xy[i][1] = c->y;
        r->weight[i] = fmax(c->weight, threshold) / (c->weight * area);
        r->variance[i] = threshold * fmax(threshold - c->weight, 0) / pow(c->weight * area, 2);
        memcpy(v->found[i], c->rgba, sizeof c->rgba);
    }
    cts_free(&v->heap);
    return CTS_OK;
}

CtsStatus cts_verify_cast(CtsVerify *v, CtsError *err)
{
    return cts_reference_cast(v->reference, v->scene, err);
}

CtsStatus cts_verify_judge(const CtsVerify *v, CtsVerified *verified, CtsError *err)
{
    return cts_reference_judge(v->reference, (const float(*)[4])v->found, verified, err);
}

CtsStatus cts_verify_end(CtsVerify *v, CtsReport *report, CtsError *err)
{
    const double start = cts_wall_ms(), cpu = cts_cpu_ms();
    CtsVerified verified;
    CtsStatus st;
    if (!v->heap)
        return CTS_OK;
    if ((st = cts_verify_choose(v, err)) || (st = cts_verify_cast(v, err)) ||
        (st = cts_verify_judge(v, &verified, err)))
        return st;
    verified.wall_ms = cts_wall_ms() - start;
    verified.cpu_ms = cts_cpu_ms() - cpu;
    if (report)
        report->verified = verified;
    return CTS_OK;
}

void cts_verify_free(CtsVerify *v)
{
    cts_reference_free(&v->reference);
    cts_free(&v->heap);
    cts_free(&v->found);
}
