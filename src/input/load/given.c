/* HU that come as numbers in memory. */
#include "ctsplat/series.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "core/volume/box.h"
#include "core/volume/grey.h"
#include "core/volume/volume_new.h"
#include <math.h>
#include <string.h>

#define HU_OFFSET (-1024.0)
enum { GREY_MAX = 65535 };

typedef struct Given {
    const uint8_t *bytes;
    CtsNumber number;
    CtsBox box;
} Given;

/* Slices lie across the longest step. */
static Given stored(const CtsGivenHu *g)
{
    CtsBox box = {0};
    memcpy(box.dims, g->dims, sizeof box.dims);
    memcpy(box.stride, g->stride_bytes, sizeof box.stride);
    memcpy(box.origin_lps, g->origin_lps, sizeof box.origin_lps);
    memcpy(box.step_lps, g->step_lps, sizeof box.step_lps);
    return (Given){g->bytes, g->number, cts_box_as_scanned(&box, CTS_BOX_ANY)};
}

static const size_t number_bytes[CTS_N_NUMBERS] = {
    [CTS_INT16] = 2, [CTS_UINT16] = 2, [CTS_INT32] = 4, [CTS_FLOAT32] = 4, [CTS_FLOAT64] = 8};

/* Row (j, k) as numbers; row has room for dims[0]. */
static void read_row(const Given *g, int j, int k, double *row)
{
    const CtsBox *const b = &g->box;
    const uint8_t *at = g->bytes + b->first + j * b->stride[1] + k * b->stride[2];
    const ptrdiff_t step = b->stride[0];
    const int n = b->dims[0];
    switch (g->number) {
#define READ(NUMBER, type)                                                                                             \
    case NUMBER:                                                                                                       \
        for (int i = 0; i < n; i++) {                                                                                  \
            type x;                                                                                                    \
            memcpy(&x, at + i * step, sizeof x);                                                                       \
            row[i] = (double)x;                                                                                        \
        }                                                                                                              \
        break;
        READ(CTS_INT16, int16_t)
        READ(CTS_UINT16, uint16_t)
        READ(CTS_INT32, int32_t)
        READ(CTS_FLOAT32, float)
        READ(CTS_FLOAT64, double)
#undef READ
    case CTS_N_NUMBERS:
        break;
    }
}

typedef struct Range {
    double low, high;
    bool whole; /* every number is one */
    uint64_t n_lost;
} Range;

typedef struct Pass {
    const Given *given;
    CtsVolume *volume;
    Range *ranges; /* by slice */
    double **rows; /* by worker */
    cts_grey_whole_fn to_grey;
} Pass;

static bool has_words(const Given *g)
{
    return g->number == CTS_INT16 || g->number == CTS_UINT16;
}

/* Numbers of 16 bits become grey levels at once, as a slice's stored words do. words has room for a row. */
static Range convert_slice(const Pass *p, int k, uint16_t *words)
{
    const CtsBox *const b = &p->given->box;
    const CtsStored stored = {
        .bits = 16, .is_signed = p->given->number == CTS_INT16, .padding_low = 1, .padding_word = -1};
    CtsStoredRange range = {INT32_MAX, INT32_MIN};
    for (int j = 0; j < b->dims[1]; j++) {
        const uint8_t *const at = p->given->bytes + b->first + j * b->stride[1] + k * b->stride[2];
        uint16_t *const grey = p->volume->grey + ((size_t)k * (size_t)b->dims[1] + (size_t)j) * (size_t)b->dims[0];
        if (b->stride[0] == sizeof *words)
            memcpy(words, at, (size_t)b->dims[0] * sizeof *words);
        else
            for (int i = 0; i < b->dims[0]; i++)
                memcpy(&words[i], at + i * b->stride[0], sizeof *words);
        range = cts_stored_range_join(range, p->to_grey(grey, words, (size_t)b->dims[0], &stored, 1, (int)-HU_OFFSET));
    }
    return (Range){range.low, range.high, true, 0};
}

static void look_at_slices(void *context, int worker, size_t first, size_t end)
{
    const Pass *const p = context;
    double *const row = p->rows[worker];
    for (int k = (int)first; k < (int)end; k++) {
        Range r = {INFINITY, -INFINITY, true, 0};
        if (has_words(p->given)) {
            p->ranges[k] = convert_slice(p, k, (uint16_t *)row);
            continue;
        }
        for (int j = 0; j < p->given->box.dims[1]; j++) {
            read_row(p->given, j, k, row);
            for (int i = 0; i < p->given->box.dims[0]; i++) {
                const double x = row[i];
                if (!isfinite(x)) {
                    r.n_lost++;
                    continue;
                }
                r.low = x < r.low ? x : r.low;
                r.high = x > r.high ? x : r.high;
                r.whole &= x == floor(x);
            }
        }
        p->ranges[k] = r;
    }
}

static void make_slices(void *context, int worker, size_t first, size_t end)
{
    const Pass *const p = context;
    const CtsVolume *const v = p->volume;
    const int nx = v->dims[0], ny = v->dims[1];
    double *const row = p->rows[worker];
    const double scale = 1 / v->hu_step;
    for (int k = (int)first; k < (int)end; k++)
        for (int j = 0; j < ny; j++) {
            uint16_t *const grey = v->grey + ((size_t)k * (size_t)ny + (size_t)j) * (size_t)nx;
            read_row(p->given, j, k, row);
            for (int i = 0; i < nx; i++) {
                const double g = (row[i] - HU_OFFSET) * scale + 0.5;
                grey[i] = g >= 1 && g < INFINITY ? g < GREY_MAX ? (uint16_t)g : GREY_MAX : 0; /* not finite: padding */
            }
        }
}

static CtsStatus check(const CtsGivenHu *g, CtsError *err)
{
    double normal[3], spans = 1;
    for (int a = 0; a < 3; a++) {
        if (g->dims[a] < 1)
            return cts_fail(err, CTS_ERR_USAGE, "a volume of %dx%dx%d voxels", g->dims[0], g->dims[1], g->dims[2]);
        spans *= cts_norm3(g->step_lps[a]);
    }
    cts_cross3(g->step_lps[0], g->step_lps[1], normal);
    const double volume_mm3 = fabs(cts_dot3(normal, g->step_lps[2]));
    if (!(spans > 0 && volume_mm3 > 1e-3 * spans &&
          isfinite(volume_mm3 + g->origin_lps[0] + g->origin_lps[1] + g->origin_lps[2])))
        return cts_fail(err, CTS_ERR_GEOMETRY, "the steps from voxel to voxel do not span space");
    return (unsigned)g->number < CTS_N_NUMBERS && number_bytes[g->number]
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "numbers of kind %d", (int)g->number);
}

static CtsStatus settle_range(const Pass *p, CtsVolume *v, CtsReport *report, CtsError *err)
{
    Range all = {INFINITY, -INFINITY, true, 0};
    for (int k = 0; k < p->given->box.dims[2]; k++) {
        all.low = fmin(all.low, p->ranges[k].low);
        all.high = fmax(all.high, p->ranges[k].high);
        all.whole &= p->ranges[k].whole;
        all.n_lost += p->ranges[k].n_lost;
    }
    v->hu_min = all.low <= all.high ? all.low : HU_OFFSET;
    v->hu_max = all.low <= all.high ? all.high : HU_OFFSET;
    if (v->hu_min < -65536 || v->hu_max > 131072)
        return cts_fail(err, CTS_ERR_PIXELS, "its values from %g to %g are no Hounsfield units", v->hu_min, v->hu_max);
    if (!all.whole)
        v->hu_step = cts_grey_finest_step(HU_OFFSET, v->hu_max);
    const double top = v->hu_offset + v->hu_step * GREY_MAX;
    if (v->hu_max > top)
        cts_report_finding(report, "clamped_high", CTS_WARNING,
                           "values up to %g HU are shown as %g HU, the largest grey level", v->hu_max, top);
    if (all.n_lost)
        cts_report_finding(report, "not_finite", CTS_WARNING, "%llu values are not finite, and taken for padding",
                           (unsigned long long)all.n_lost);
    return CTS_OK;
}

static CtsStatus fill(const Pass *p, CtsVolume *v, int n_threads, CtsReport *report, CtsError *err)
{
    const size_t n = (size_t)p->given->box.dims[2];
    cts_parallel(n_threads, n, 0, look_at_slices, (void *)p);
    const CtsStatus st = settle_range(p, v, report, err);
    if (st)
        return st;
    if (has_words(p->given))
        return CTS_OK;
    cts_parallel(n_threads, n, 0, make_slices, (void *)p);
    return CTS_OK;
}

static CtsStatus place(CtsScanned *s, const CtsBox *b, CtsError *err)
{
    const int *const dims = b->dims;
    CtsStatus st = cts_alloc_array(&s->position_lps, (size_t)dims[2], err);
    if (st || (st = cts_volume_new_unset(&s->even, dims[0], dims[1], dims[2], err)))
        return st;
    s->n_slices = s->n_slots = dims[2];
    memcpy(s->even->origin_lps, b->origin_lps, sizeof b->origin_lps);
    memcpy(s->even->step_lps, b->step_lps, sizeof b->step_lps);
    for (int k = 0; k < dims[2]; k++)
        for (int c = 0; c < 3; c++)
            s->position_lps[k][c] = b->origin_lps[c] + k * b->step_lps[2][c];
    return CTS_OK;
}

CtsStatus cts_scanned_of_hu(const CtsGivenHu *given, int n_threads, CtsScanned **scanned, CtsReport *report,
                            CtsError *err)
{
    CtsStatus st = check(given, err);
    *scanned = NULL;
    if (st || (st = cts_alloc_zeroed(scanned, 1, err)))
        return st;
    n_threads = cts_threads(n_threads);
    const Given as_scanned = stored(given);
    const CtsBox *const box = &as_scanned.box;
    Pass pass = {.given = &as_scanned, .to_grey = cts_grey_whole(cts_cpu_flags())};
    if (!(st = place(*scanned, box, err)) && !(st = cts_alloc_array(&pass.ranges, (size_t)box->dims[2], err)))
        st = cts_alloc_zeroed(&pass.rows, (size_t)n_threads, err);
    for (int t = 0; !st && t < n_threads; t++)
        st = cts_alloc_array(&pass.rows[t], (size_t)box->dims[0], err);
    pass.volume = (*scanned)->even;
    if (!st)
        st = fill(&pass, pass.volume, n_threads, report, err);
    for (int t = 0; pass.rows && t < n_threads; t++)
        cts_free(&pass.rows[t]);
    cts_free(&pass.rows);
    cts_free(&pass.ranges);
    if (st)
        cts_scanned_free(scanned);
    return st;
}
