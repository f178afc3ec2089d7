/* A volume from an array of HU in memory. */
#include "ctsplat/series.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "core/volume/box.h"
#include "core/volume/grey.h"
#include "core/volume/levels.h"
#include "core/volume/volume_new.h"
#include "input/load/load.h"
#include <math.h>
#include <string.h>

enum { GREY_MAX = 65535 };

/* Slices lie across the longest step. */
static CtsBox box_as_scanned(const CtsHuArray *g)
{
    CtsBox box = {0};
    memcpy(box.dims, g->dims, sizeof box.dims);
    memcpy(box.stride, g->stride_bytes, sizeof box.stride);
    memcpy(box.origin_lps, g->origin_lps, sizeof box.origin_lps);
    memcpy(box.step_lps, g->step_lps, sizeof box.step_lps);
    return cts_box_as_scanned(&box, CTS_BOX_ANY);
}

static const size_t number_bytes[CTS_N_NUMBERS] = {
    [CTS_INT16] = 2, [CTS_UINT16] = 2, [CTS_INT32] = 4, [CTS_FLOAT32] = 4, [CTS_FLOAT64] = 8};

typedef struct Range {
    double low, high;
    bool whole; /* every number is one */
    uint64_t n_lost;
} Range;

typedef struct ArrayPass {
    const CtsHuArray *array;
    CtsBox box; /* of its voxels in the order of a scanner */
    CtsVolume *volume;
    Range *ranges; /* by slice */
    double *rows;  /* for each worker room for two rows of numbers */
} ArrayPass;

static double *rows_of_worker(const ArrayPass *p, int worker)
{
    return p->rows + (size_t)worker * 2 * (size_t)p->box.dims[0];
}

/* Row (j, k) as the array has it: where it lies, or gathered. */
static const void *row_of(const ArrayPass *p, int j, int k, double *gathered)
{
    const CtsBox *const b = &p->box;
    const uint8_t *const at = (const uint8_t *)p->array->bytes + b->first + j * b->stride[1] + k * b->stride[2];
    const size_t size = number_bytes[p->array->number];
    if (b->stride[0] == (ptrdiff_t)size && (uintptr_t)at % size == 0)
        return at;
    for (int i = 0; i < b->dims[0]; i++)
        memcpy((uint8_t *)gathered + (size_t)i * size, at + i * b->stride[0], size);
    return gathered;
}

/* Its numbers. row: room for two rows. */
static const double *numbers_of_row(const ArrayPass *p, int j, int k, double *row)
{
    const size_t n = (size_t)p->box.dims[0];
    const void *const from = row_of(p, j, k, row + n);
    if (p->array->number == CTS_FLOAT64)
        return from;
    for (size_t i = 0; i < n && p->array->number == CTS_FLOAT32; i++)
        row[i] = (double)((const float *)from)[i];
    for (size_t i = 0; i < n && p->array->number == CTS_INT32; i++)
        row[i] = ((const int32_t *)from)[i];
    for (size_t i = 0; i < n && p->array->number == CTS_INT16; i++)
        row[i] = ((const int16_t *)from)[i];
    for (size_t i = 0; i < n && p->array->number == CTS_UINT16; i++)
        row[i] = ((const uint16_t *)from)[i];
    return row;
}

static inline uint16_t *grey_of(const ArrayPass *p, int j, int k)
{
    const int *const dims = p->volume->dims;
    return p->volume->grey + ((size_t)k * (size_t)dims[1] + (size_t)j) * (size_t)dims[0];
}

static Range range_of_slice(const ArrayPass *p, int k, double *numbers)
{
    Range r = {INFINITY, -INFINITY, true, 0};
    for (int j = 0; j < p->box.dims[1]; j++) {
        const double *const row = numbers_of_row(p, j, k, numbers);
        for (int i = 0; i < p->box.dims[0]; i++) {
            const double x = row[i] + 0.0; /* no negative zero */
            const bool lost = !isfinite(x);
            r.n_lost += lost;
            r.low = !lost && x < r.low ? x : r.low;
            r.high = !lost && x > r.high ? x : r.high;
            r.whole &= lost || x == rint(x);
        }
    }
    return r;
}

/* HU of 16 bits, which are converted directly, like a slice's stored words. */
static bool has_words(const ArrayPass *p)
{
    return p->volume->quantity == CTS_QUANTITY_HU && (p->array->number == CTS_INT16 || p->array->number == CTS_UINT16);
}

static Range convert_slice(const ArrayPass *p, int k, double *gathered)
{
    const CtsStored stored = {
        .bits = 16, .is_signed = p->array->number == CTS_INT16, .padding_low = 1, .padding_word = -1};
    CtsStoredRange range = {INT32_MAX, INT32_MIN};
    for (int j = 0; j < p->box.dims[1]; j++)
        range = cts_stored_range_join(range, cts_grey_whole(grey_of(p, j, k), row_of(p, j, k, gathered),
                                                            (size_t)p->box.dims[0], &stored, 1, (int)-CTS_LEAST_HU));
    return (Range){range.low, range.high, true, 0};
}

static void find_ranges(void *context, int worker, size_t first, size_t end)
{
    const ArrayPass *const p = context;
    double *const rows = rows_of_worker(p, worker);
    for (int k = (int)first; k < (int)end; k++)
        p->ranges[k] = has_words(p) ? convert_slice(p, k, rows) : range_of_slice(p, k, rows);
}

/* Non-finite values become padding, 0: for them x - x is not a number. */
static void make_slices(void *context, int worker, size_t first, size_t end)
{
    const ArrayPass *const p = context;
    const double offset = p->volume->hu_offset, scale = 1 / p->volume->hu_step;
    const int n_rows = p->box.dims[1];
    for (int n = (int)first * n_rows; n < (int)end * n_rows; n++) {
        const int j = n % n_rows, k = n / n_rows;
        const double *const row = numbers_of_row(p, j, k, rows_of_worker(p, worker));
        uint16_t *const restrict grey = grey_of(p, j, k);
        for (int i = 0; i < p->box.dims[0]; i++) {
            double g = (row[i] - offset) * scale + 0.5 + (row[i] - row[i]);
            g = g >= 0 ? g : 0;
            g = g <= GREY_MAX ? g : GREY_MAX;
            grey[i] = (uint16_t)(int32_t)g;
        }
    }
}

static CtsStatus check_array(const CtsHuArray *g, CtsError *err)
{
    double normal[3], spans = 1;
    for (int a = 0; a < 3; a++) {
        if (g->dims[a] < 1)
            return cts_fail(err, CTS_ERR_USAGE, "a volume of %dx%dx%d voxels", g->dims[0], g->dims[1], g->dims[2]);
        spans *= cts_norm3(g->step_lps[a]);
    }
    cts_cross3(g->step_lps[0], g->step_lps[1], normal);
    const double volume_mm3 = fabs(cts_dot3(normal, g->step_lps[2]));
    /* Axes in one plane. A cell that a scanner shears, by 30 degrees at most, has 0.87 of an upright one's volume. */
    if (!(spans > 0 && volume_mm3 > 1e-3 * spans &&
          isfinite(volume_mm3 + g->origin_lps[0] + g->origin_lps[1] + g->origin_lps[2])))
        return cts_fail(err, CTS_ERR_GEOMETRY, "the steps from voxel to voxel do not span space");
    if ((unsigned)g->quantity >= CTS_N_QUANTITIES || (unsigned)g->modality >= CTS_N_MODALITIES)
        return cts_fail(err, CTS_ERR_USAGE, "values of quantity %d, modality %d", (int)g->quantity, (int)g->modality);
    return (unsigned)g->number < CTS_N_NUMBERS && number_bytes[g->number]
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "numbers of kind %d", (int)g->number);
}

/* The range without isolated values that no scanner measures, which are listed. */
static CtsStatus leave_values_out(const ArrayPass *p, Range *all, CtsOutliers *outliers, CtsReport *report,
                                  CtsError *err)
{
    const int *const dims = p->box.dims;
    CtsStatus st = CTS_OK;
    size_t voxel = 0;
    for (int k = 0; k < dims[2]; k++)
        for (int j = 0; j < dims[1]; j++) {
            const double *const row = numbers_of_row(p, j, k, p->rows);
            for (int i = 0; !st && i < dims[0]; i++, voxel++)
                if (isfinite(row[i]))
                    st = cts_outliers_take(outliers, voxel, row[i], err);
        }
    *all = (Range){outliers->rest_low, outliers->rest_high, outliers->rest_whole, all->n_lost};
    return st ? st : cts_outliers_check(outliers, dims, report, err);
}

static CtsStatus settle_range(const ArrayPass *p, CtsOutliers *outliers, CtsReport *report, CtsError *err)
{
    CtsVolume *const v = p->volume;
    Range all = {INFINITY, -INFINITY, true, 0};
    CtsStatus st;
    for (int k = 0; k < p->box.dims[2]; k++) {
        const Range r = p->ranges[k];
        all = (Range){fmin(all.low, r.low), fmax(all.high, r.high), all.whole && r.whole, all.n_lost + r.n_lost};
    }
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    if (is_hu && all.low <= all.high && (cts_is_outlier(all.low) || cts_is_outlier(all.high)) &&
        (st = leave_values_out(p, &all, outliers, report, err)))
        return st;
    cts_volume_set_range(v, all.low, all.high);
    if (!is_hu || !all.whole)
        cts_volume_set_scale(v);
    cts_report_clamped(v, report);
    if (all.n_lost)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_NOT_FINITE, "%llu values are not finite, and taken for padding",
                              (unsigned long long)all.n_lost);
    return CTS_OK;
}

static CtsStatus fill_from_array(const ArrayPass *p, int n_threads, CtsReport *report, CtsError *err)
{
    CtsVolume *const v = p->volume;
    const size_t n = (size_t)p->box.dims[2];
    cts_parallel(n_threads, n, 0, find_ranges, (void *)p);
    CtsOutliers outliers;
    cts_outliers_begin(&outliers, p->box.dims);
    const CtsStatus st = settle_range(p, &outliers, report, err);
    if (!st && !has_words(p)) {
        cts_parallel(n_threads, n, 0, make_slices, (void *)p);
        cts_outliers_mend(&outliers, v);
    }
    cts_outliers_free(&outliers);
    return st ? st : cts_volume_measure_levels(v, v->dims[2], n_threads, err);
}

static CtsStatus place_array(CtsScanned *s, const CtsBox *b, CtsError *err)
{
    const int *const dims = b->dims;
    CtsStatus st = cts_alloc_array(&s->position_lps, (size_t)dims[2], err);
    if (st || (st = cts_volume_new_unset(&s->even, dims[0], dims[1], dims[2], err)))
        return st;
    s->n_slices = dims[2];
    memcpy(s->even->origin_lps, b->origin_lps, sizeof b->origin_lps);
    memcpy(s->even->step_lps, b->step_lps, sizeof b->step_lps);
    for (int k = 0; k < dims[2]; k++)
        for (int c = 0; c < 3; c++)
            s->position_lps[k][c] = b->origin_lps[c] + k * b->step_lps[2][c];
    return CTS_OK;
}

CtsStatus cts_scanned_of_hu(const CtsHuArray *array, int n_threads, CtsScanned **scanned, CtsReport *report,
                            CtsError *err)
{
    CtsStatus st = check_array(array, err);
    *scanned = NULL;
    if (st || (st = cts_alloc_zeroed(scanned, 1, err)))
        return st;
    n_threads = cts_threads(n_threads);
    ArrayPass pass = {.array = array, .box = box_as_scanned(array)};
    const CtsBox *const box = &pass.box;
    if (!(st = place_array(*scanned, box, err)) && !(st = cts_alloc_array(&pass.ranges, (size_t)box->dims[2], err)))
        st = cts_alloc_array(&pass.rows, (size_t)n_threads * 2 * (size_t)box->dims[0], err);
    pass.volume = (*scanned)->even;
    if (!st) {
        pass.volume->quantity = array->quantity;
        pass.volume->modality = array->modality;
        st = fill_from_array(&pass, n_threads, report, err);
    }
    cts_free(&pass.rows);
    cts_free(&pass.ranges);
    if (st)
        cts_scanned_free(scanned);
    return st;
}
