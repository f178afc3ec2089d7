#include "ctsplat/series.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/stage_timer.h"
#include "core/volume/grey.h"
#include "core/volume/levels.h"
#include "core/volume/volume_new.h"
#include "dicom/codec/pixels.h"
#include "dicom/header/slice.h"
#include "input/load/load.h"
#include "input/series/slice_stack.h"
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The slices of a series that are to become a volume: copies of its records, which own nothing. */
typedef struct Loading {
    CtsSlice *slices;
    int *number;               /* of each in the series */
    uint16_t *words;           /* of a NIfTI file; owned */
    const CtsWordWatch *watch; /* NULL: none */
    char **faults;             /* of slices whose pixels are damaged, else NULL; owned */
    int n_slices, n_threads;
} Loading;

/* One thread's. */
typedef struct SliceReader {
    CtsSandbox *decoder; /* sandbox for compressed pixels, started at the first one */
    double decode_ms, grey_ms;
    int held; /* a slice that is being decoded, or -1 */
} SliceReader;

/* One thread's table, and the slice it was made for. */
typedef struct Converter {
    const CtsSlice *made_for;
    double rounding; /* largest difference of a value and its grey level's */
    uint16_t table[65536];
} Converter;

/* State shared by the threads that read slices into layers. */
typedef struct Assembly {
    const Loading *in;
    CtsVolume *volume; /* slice k becomes its layer k */
    size_t layer_voxels;
    bool whole_numbers;     /* every slope and intercept is a whole number */
    CtsStoredRange *ranges; /* of each slice */
    uint16_t *samples;      /* CTS_SAMPLES of each slice */
    SliceReader *readers;
    Converter *converters;
    pthread_mutex_t lock; /* of the failures: */
    int n_bad;            /* damaged slices */
    int first_failed;     /* the first slice that was not read, damaged or not; n_slices: none */
    CtsError why;         /* of that one */
    atomic_int stop;      /* slices after this one are not read */
} Assembly;

static uint16_t *layer_of(const Assembly *a, int k)
{
    return a->volume->grey + (size_t)k * a->layer_voxels;
}

/* State of one slice while it is read. */
typedef struct Arrival {
    Assembly *assembly;
    int k;
    CtsStored stored;
    double grey_ms;
} Arrival;

/* Converts stored values first <= n < end to grey levels while they are in the cache. With a fractional slope or
 * intercept they are copied and their range is found; convert_fractions() follows. */
static void take_words(void *context, const uint16_t *at, size_t first, size_t end)
{
    Arrival *const in = context;
    Assembly *const a = in->assembly;
    const CtsSlice *s = &a->in->slices[in->k];
    uint16_t *layer = layer_of(a, in->k);
    const double start = cts_wall_ms();
    if (a->in->watch && a->in->watch->take)
        a->in->watch->take(a->in->watch->context, a->in->number[in->k], at, first, end, &in->stored, s->slope,
                           s->intercept);
    const CtsStoredRange r = a->whole_numbers
                                 ? cts_grey_whole(layer + first, at, end - first, &in->stored, (int32_t)s->slope,
                                                  (int32_t)(s->intercept - CTS_LEAST_HU))
                                 : cts_stored_range(at, end - first, &in->stored);
    if (!a->whole_numbers && at != layer + first)
        memcpy(layer + first, at, (end - first) * sizeof *at);
    CtsStoredRange *const all = &a->ranges[in->k];
    *all = cts_stored_range_join(*all, r);
    in->grey_ms += cts_wall_ms() - start;
}

static CtsStatus read_slice(Assembly *a, int k, SliceReader *reader, CtsError *err)
{
    const CtsSlice *s = &a->in->slices[k];
    Arrival in = {.assembly = a, .k = k, .stored = cts_slice_stored(s)};
    const double start = cts_wall_ms();
    a->ranges[k] = (CtsStoredRange){INT32_MAX, INT32_MIN};
    const CtsStatus st = cts_slice_read_pixels(s, &reader->decoder, layer_of(a, k), take_words, &in, err);
    if (st) {
        cts_context(err, "%s", cts_slice_label(s).text);
        return st;
    }
    cts_slice_sample(s, layer_of(a, k), a->whole_numbers, a->samples + (size_t)k * CTS_SAMPLES);
    reader->decode_ms += cts_wall_ms() - start - in.grey_ms;
    reader->grey_ms += in.grey_ms;
    return CTS_OK;
}

/* A tenth of a series may be damaged, as in cts_series_check(). */
static bool too_many_bad(int n_bad, int n_slices)
{
    return n_bad * 10 > n_slices || n_slices - n_bad < 2;
}

/* Of several failures the first slice's is reported. Damaged pixels are a fault of that slice alone; other failures, or
 * too much damage, end the reading. */
static void note_failure(Assembly *a, int k, const CtsError *why)
{
    const bool damaged = why->status == CTS_ERR_PIXELS && (a->in->faults[k] = strdup(why->text)) != NULL;
    a->n_bad += damaged;
    if (k < a->first_failed) {
        a->first_failed = k;
        a->why = *why;
    }
    if (!damaged || too_many_bad(a->n_bad, a->in->n_slices))
        atomic_store(&a->stop, a->first_failed);
}

static bool is_stopped(const CtsWordWatch *watch)
{
    return watch && watch->stop && *watch->stop;
}

static void read_one(Assembly *a, SliceReader *reader, int k)
{
    CtsError why = {0};
    if (k > atomic_load(&a->stop) || is_stopped(a->in->watch) || !read_slice(a, k, reader, &why))
        return;
    pthread_mutex_lock(&a->lock);
    note_failure(a, k, &why);
    pthread_mutex_unlock(&a->lock);
}

static void read_held(Assembly *a, SliceReader *reader)
{
    if (reader->held >= 0)
        read_one(a, reader, reader->held);
    reader->held = -1;
}

/* Pipelined: while a thread takes a slice from its decoder, the next one is decoded; its last one stays there. */
static void read_some(void *context, int worker, size_t first, size_t end)
{
    Assembly *const a = context;
    SliceReader *const reader = &a->readers[worker];
    for (int k = (int)first; k < (int)end; k++) {
        const bool begun = k <= atomic_load(&a->stop) && !is_stopped(a->in->watch) &&
                           cts_slice_begin(&a->in->slices[k], &reader->decoder);
        read_held(a, reader);
        if (begun)
            reader->held = k;
        else
            read_one(a, reader, k);
    }
}

static CtsStatus read_each(Assembly *a, double busy[CTS_N_STAGES], CtsError *err)
{
    const CtsStatus st = cts_alloc_zeroed(&a->readers, (size_t)a->in->n_threads, err);
    if (st)
        return st;
    for (int t = 0; t < a->in->n_threads; t++)
        a->readers[t].held = -1;
    cts_parallel(a->in->n_threads, (size_t)a->in->n_slices, 1, read_some, a);
    for (int t = 0; t < a->in->n_threads; t++) {
        SliceReader *const reader = &a->readers[t];
        read_held(a, reader);
        busy[CTS_STAGE_DECODE] += reader->decode_ms;
        busy[CTS_STAGE_GREY] += reader->grey_ms;
        cts_sandbox_free(&reader->decoder);
    }
    cts_free(&a->readers);
    return CTS_OK;
}

/* CTS_ERR_PIXELS: some slices are bad; a->in->faults has the reasons. */
static CtsStatus read_slices(Assembly *a, CtsReport *report, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const uint64_t n = (uint64_t)a->in->n_slices, n_voxels = n * a->layer_voxels;
    const uint64_t items[CTS_N_STAGES] = {[CTS_STAGE_DECODE] = n, [CTS_STAGE_GREY] = n_voxels};
    uint64_t bytes[CTS_N_STAGES] = {[CTS_STAGE_GREY] = n_voxels * sizeof *a->volume->grey};
    double busy[CTS_N_STAGES] = {0};
    a->first_failed = a->in->n_slices;
    atomic_store(&a->stop, a->in->n_slices);
    const CtsStatus st = read_each(a, busy, err);
    if (st)
        return st;
    for (int k = 0; k < a->in->n_slices; k++)
        bytes[CTS_STAGE_DECODE] += a->in->slices[k].pixel_bytes;
    cts_report_region(report, cts_wall_ms() - wall, cts_cpu_ms() - cpu, busy, items, bytes);
    if (is_stopped(a->in->watch))
        return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    return a->first_failed == a->in->n_slices ? CTS_OK : cts_fail(err, a->why.status, "%s", a->why.text);
}

static void find_range(const Assembly *a)
{
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < a->in->n_slices; k++) {
        const CtsSlice *s = &a->in->slices[k];
        const CtsStoredRange r = a->ranges[k];
        if (r.low > r.high)
            continue;
        const double x = s->slope * r.low + s->intercept, y = s->slope * r.high + s->intercept;
        low = fmin(low, fmin(x, y));
        high = fmax(high, fmax(x, y));
    }
    cts_volume_set_range(a->volume, low, high);
}

static void convert_some(void *context, int worker, size_t first, size_t end)
{
    const Assembly *const a = context;
    const CtsVolume *const v = a->volume;
    Converter *const mine = &a->converters[worker];
    for (int k = (int)first; k < (int)end; k++) {
        const CtsSlice *s = &a->in->slices[k];
        if (!mine->made_for || !cts_slice_same_values(mine->made_for, s)) {
            const CtsStored stored = cts_slice_stored(s);
            cts_grey_table(mine->table, &stored, s->slope, s->intercept, v->hu_offset, v->hu_step);
            mine->made_for = s;
        }
        mine->rounding =
            fmax(mine->rounding, cts_grey_rounding(a->ranges[k], s->slope, s->intercept, v->hu_offset, v->hu_step));
        cts_grey_look_up(layer_of(a, k), a->layer_voxels, mine->table);
    }
}

static CtsStatus convert_fractions(Assembly *a, double *rounding, CtsError *err)
{
    const CtsStatus st = cts_alloc_zeroed(&a->converters, (size_t)a->in->n_threads, err);
    if (!st)
        cts_parallel(a->in->n_threads, (size_t)a->in->n_slices, 0, convert_some, a);
    for (int t = 0; !st && t < a->in->n_threads; t++)
        *rounding = fmax(*rounding, a->converters[t].rounding);
    cts_free(&a->converters);
    return st;
}

/* Signed read of unsigned pixels: dense bone, of 1100 HU and more, becomes less than -1100 HU, less than air, while the
 * header's numbers end below 1100. */
static bool lost_bone(const Assembly *a, int k)
{
    const CtsSlice *s = &a->in->slices[k];
    const double top = s->slope * ((1 << (s->bits_stored - 1)) - 1) + s->intercept;
    return s->is_signed && s->slope > 0 && top < 1100 && s->slope * a->ranges[k].low + s->intercept < -1100;
}

/* Refuses values that a wrong PixelRepresentation explains: signed pixels read as unsigned, or the reverse. */
static CtsStatus check_range(const Assembly *a, CtsError *err)
{
    const CtsVolume *const v = a->volume;
    int n_lost = 0;
    for (int k = 0; k < a->in->n_slices; k++)
        n_lost += lost_bone(a, k);
    if (n_lost)
        return cts_fail(err, CTS_ERR_PIXELS,
                        "its values from %g to %g look like unsigned pixels that PixelRepresentation (0028,0103) calls "
                        "signed (set it to 0 with dcmodify)",
                        v->hu_min, v->hu_max);
    /* Unsigned read of signed pixels: air becomes more than 32767. No scan has such numbers and nothing below -200 HU.
     */
    if (v->hu_max > 32767 && v->hu_min > -200 && a->in->slices[0].kind != CTS_OBJECT_NIFTI)
        return cts_fail(err, CTS_ERR_PIXELS,
                        "its values from %g to %g look like signed pixels that PixelRepresentation (0028,0103) calls "
                        "unsigned (set it to 1 with dcmodify)",
                        v->hu_min, v->hu_max);
    return CTS_OK;
}

static void take_words_as_stored(CtsOutliers *outliers, const Assembly *a, int k, CtsStatus *st, CtsError *err)
{
    const CtsSlice *const s = &a->in->slices[k];
    const CtsStored stored = cts_slice_stored(s);
    const uint16_t *const words = layer_of(a, k);
    for (size_t n = 0; n < a->layer_voxels && !*st; n++) {
        const int32_t value = cts_stored_value(words[n], &stored);
        if (!cts_stored_is_padding(words[n], value, &stored))
            *st = cts_outliers_take(outliers, (size_t)k * a->layer_voxels + n, s->slope * value + s->intercept, err);
    }
}

/* The range without isolated outliers, which are listed. Grey levels saturate there, so the words are read again where
 * needed. */
static CtsStatus leave_outliers_out(Assembly *a, const int dims[3], CtsOutliers *outliers, CtsReport *report,
                                    CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (a->whole_numbers) {
        a->whole_numbers = false;
        st = read_slices(a, report, err);
    }
    for (int k = 0; k < a->in->n_slices; k++)
        take_words_as_stored(outliers, a, k, &st, err);
    a->volume->hu_min = outliers->rest_low;
    a->volume->hu_max = outliers->rest_high;
    return st ? st : cts_outliers_check(outliers, dims, report, err);
}

/* coarsest_hu: HU step between words, for slices whose words were rounded before. */
static void report_range(const CtsVolume *v, bool whole_numbers, double coarsest_hu, double rounding, CtsReport *report)
{
    if (v->quantity != CTS_QUANTITY_HU) {
        if (rounding > 1e-6 * v->hu_step) /* more than arithmetic loses */
            cts_report_diagnostic(report, CTS_DIAGNOSTIC_FRACTIONAL_RESCALE,
                                  "grey levels are steps of %g%s%s; the largest rounding is %.2g", v->hu_step,
                                  *cts_quantity_units[v->quantity] ? " " : "", cts_quantity_units[v->quantity],
                                  rounding);
        return;
    }
    if (!whole_numbers)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_FRACTIONAL_RESCALE,
                              "the rescale slope or intercept has a fraction; grey levels are steps of %g HU",
                              fmax(v->hu_step, coarsest_hu));
    cts_report_clamped(v, report);
}

/* Warns about a slice of one value, or of padding, between others with more: lost in transfer, or erased. */
static void report_blank(const Assembly *a, CtsReport *report)
{
    int first = -1, last = -1, blank = -1, n = 0;
    char others[40] = "";
    for (int k = 0; k < a->in->n_slices; k++)
        if (a->ranges[k].low < a->ranges[k].high) {
            first = first < 0 ? k : first;
            last = k;
        }
    for (int k = first + 1; k < last; k++)
        if (a->ranges[k].low >= a->ranges[k].high) {
            blank = blank < 0 ? k : blank;
            n++;
        }
    if (n > 1)
        snprintf(others, sizeof others, ", as in %d more", n - 1);
    if (n)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_BLANK_SLICES,
                              "%s: one value in all pixels%s, between slices with more",
                              cts_slice_label(&a->in->slices[blank]).text, others);
}

/* Origin and steps: rows and columns from the middle slice, layers from the line of positions. */
static void place_volume(CtsVolume *v, const CtsSlice *slices, int n, const CtsSliceStack *stack)
{
    const CtsSlice *middle = &slices[n / 2];
    for (int c = 0; c < 3; c++) {
        v->origin_lps[c] = slices[0].position_lps[c];
        v->step_lps[0][c] = middle->row_lps[c] * middle->column_spacing_mm;
        v->step_lps[1][c] = middle->column_lps[c] * middle->row_spacing_mm;
        v->step_lps[2][c] = stack->step_lps[c];
    }
}

static CtsStatus read_nifti(const CtsSeries *series, Loading *in, CtsReport *report, CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const CtsStatus st = cts_nifti_words(in->slices, in->n_slices, &series->rules, in->watch ? in->watch->stop : NULL,
                                         &in->words, report, err);
    cts_report_stage(report, CTS_STAGE_DECODE, cts_wall_ms() - wall, cts_cpu_ms() - cpu, 0, 0);
    return st;
}

static CtsStatus begin_loading(Loading *in, const CtsSeries *series, int n_threads, CtsReport *report, CtsError *err)
{
    const size_t n = (size_t)series->n_slices;
    CtsStatus st;
    in->n_slices = series->n_slices;
    in->n_threads = n_threads;
    if ((st = cts_alloc_array(&in->slices, n, err)) || (st = cts_alloc_zeroed(&in->faults, n, err)) ||
        (st = cts_alloc_array(&in->number, n, err)))
        return st;
    for (size_t k = 0; k < n; k++) {
        in->slices[k] = *series->slices[k];
        in->number[k] = (int)k;
    }
    if (series->slices[0]->kind == CTS_OBJECT_NIFTI)
        st = read_nifti(series, in, report, err);
    return st;
}

static void end_loading(Loading *in)
{
    for (int k = 0; in->faults && k < in->n_slices; k++)
        free(in->faults[k]);
    cts_free(&in->slices);
    cts_free(&in->number);
    cts_free(&in->faults);
    cts_free(&in->words);
}

/* Leaves the damaged slices out, and names each. */
static void drop_bad(Loading *in, CtsReport *report)
{
    int kept = 0;
    for (int k = 0; k < in->n_slices; k++) {
        if (!in->faults[k]) {
            in->number[kept] = in->number[k];
            in->slices[kept++] = in->slices[k];
            continue;
        }
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_BAD_SLICES, "%s (left out)", in->faults[k]);
        free(in->faults[k]);
        in->faults[k] = NULL;
    }
    in->n_slices = kept;
}

/* Positions of the slices; warns about gaps that removed slices leave, since the series' own findings do not. */
static CtsStatus plan_stack(const CtsSeries *series, const Loading *in, CtsSliceStack *stack, CtsReport *report,
                            CtsError *err)
{
    const CtsSlice **slices;
    CtsStatus st = cts_alloc_bytes((void **)&slices, (size_t)in->n_slices, sizeof *slices, err);
    for (int k = 0; !st && k < in->n_slices; k++)
        slices[k] = &in->slices[k];
    if (!st)
        st = cts_slice_stack_plan(slices, in->n_slices, series->rules.allow_missing_slices, stack, err);
    if (!st && in->n_slices < series->n_slices && report)
        cts_slice_stack_diagnostics(stack, slices, in->n_slices, &report->diagnostics);
    cts_free_bytes(slices);
    return st;
}

static CtsStatus fill_volume(const Loading *in, CtsVolume *v, CtsReport *report, CtsError *err)
{
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    const int dims[3] = {v->dims[0], v->dims[1], in->n_slices};
    Assembly a = {.in = in,
                  .volume = v,
                  .layer_voxels = (size_t)dims[0] * (size_t)dims[1],
                  .whole_numbers = is_hu,
                  .lock = PTHREAD_MUTEX_INITIALIZER};
    double rounding = 0;
    for (int k = 0; k < in->n_slices; k++)
        a.whole_numbers &= in->slices[k].slope == floor(in->slices[k].slope) &&
                           in->slices[k].intercept == floor(in->slices[k].intercept);
    CtsStatus st = cts_alloc_array(&a.ranges, (size_t)in->n_slices, err);
    if (!st && !(st = cts_alloc_array(&a.samples, (size_t)in->n_slices * CTS_SAMPLES, err)) &&
        !(st = read_slices(&a, report, err)))
        find_range(&a);
    const bool whole_numbers = a.whole_numbers;
    CtsOutliers outliers;
    cts_outliers_begin(&outliers, dims);
    if (!st && is_hu && (cts_is_outlier(v->hu_min) || cts_is_outlier(v->hu_max)))
        st = leave_outliers_out(&a, dims, &outliers, report, err);
    if (!st && is_hu)
        st = check_range(&a, err);
    else if (!st && v->hu_min == v->hu_max)
        st = cts_fail(err, CTS_ERR_PIXELS, "all of its values are %g: nothing to show", v->hu_min);
    if (!st && !whole_numbers)
        cts_volume_set_scale(v);
    if (!st && !a.whole_numbers)
        st = convert_fractions(&a, &rounding, err);
    for (int k = 0; !st && !is_hu && k < in->n_slices; k++)
        cts_slice_sample(&in->slices[k], layer_of(&a, k), true, a.samples + (size_t)k * CTS_SAMPLES);
    if (!st) {
        cts_outliers_mend(&outliers, v);
        report_range(v, whole_numbers, in->slices[0].kind == CTS_OBJECT_NIFTI ? in->slices[0].slope : 0, rounding,
                     report);
        report_blank(&a, report);
        if (!(st = cts_slice_consistency_report(in->slices, in->n_slices, a.samples, is_hu, report, err)))
            st = cts_volume_measure_levels(v, in->n_slices, in->n_threads, err);
    }
    cts_outliers_free(&outliers);
    cts_free(&a.samples);
    cts_free(&a.ranges);
    return st;
}

/* "series UID: " in front of a failure; by its file or folder where the data has no UID. */
static CtsStatus in_series(const CtsSeries *series, CtsError *err)
{
    const CtsSlice *first = series->slices[0];
    if (series->no_patient)
        return cts_context(err, "%s", first->path);
    const int n = (int)(cts_slice_name(first) - first->path);
    return series->uid[0] ? cts_context(err, "series %s", series->uid)
                          : cts_context(err, "%.*s: series without UID", n > 1 ? n - 1 : 1, n ? first->path : ".");
}

/* Stores the slices' positions with the scanned volume. */
static CtsStatus place_slices(CtsScanned *scanned, const Loading *in, const CtsSliceStack *stack, CtsError *err)
{
    CtsStatus st = cts_alloc_array(&scanned->position_lps, (size_t)in->n_slices, err);
    if (!st)
        st = cts_alloc_array(&scanned->number, (size_t)in->n_slices, err);
    if (!st)
        memcpy(scanned->number, in->number, (size_t)in->n_slices * sizeof *in->number);
    for (int k = 0; !st && k < in->n_slices; k++)
        memcpy(scanned->position_lps[k], in->slices[k].position_lps, sizeof *scanned->position_lps);
    scanned->n_slices = in->n_slices;
    if (!st && stack->kind != CTS_STACK_EVEN && !(st = cts_alloc_array(&scanned->layer, (size_t)in->n_slices, err)))
        memcpy(scanned->layer, stack->layer, (size_t)in->n_slices * sizeof *scanned->layer);
    return st;
}

static CtsStatus load_slices(const CtsSeries *series, const Loading *in, CtsScanned **scanned, CtsReport *report,
                             CtsError *err)
{
    CtsSliceStack stack = {0};
    CtsVolume *v;
    CtsStatus st = cts_alloc_zeroed(scanned, 1, err);
    if (st || (st = plan_stack(series, in, &stack, report, err)) || (st = place_slices(*scanned, in, &stack, err)))
        goto end;
    const bool even = stack.kind == CTS_STACK_EVEN;
    const double need =
        (double)series->columns * series->rows * (in->n_slices + (even ? 0 : stack.n_layers)) * sizeof *v->grey;
    const uint64_t free_bytes = cts_memory_available();
    if (!cts_memory_allows(need, free_bytes))
        st = cts_fail(err, CTS_ERR_MEMORY, "the volume needs %.0f MiB of memory, and %.0f MiB are free", need / 1048576,
                      (double)free_bytes / 1048576);
    if (st || (st = cts_volume_new_unset(&(*scanned)->even, series->columns, series->rows, in->n_slices, err)))
        goto end;
    v = (*scanned)->even;
    v->modality = series->modality_id;
    v->quantity = series->quantity;
    v->dims[2] = stack.n_layers;
    if (!even) /* on average */
        v->slice_layers = (int)fmax(floor((stack.n_layers - 1.0) / fmax(in->n_slices - 1, 1) + 0.5), 1);
    place_volume(v, in->slices, in->n_slices, &stack);
    st = fill_volume(in, v, report, err);
end:
    if (st)
        cts_scanned_free(scanned);
    cts_slice_stack_free(&stack);
    return st;
}

/* A slice that turns out to be damaged is treated as missing, and the rest is read again. */
static CtsStatus load_series(const CtsSeries *series, const CtsWordWatch *watch, int n_threads, CtsScanned **scanned,
                             CtsReport *report, CtsError *err)
{
    Loading in = {.watch = watch};
    CtsError why = {0};
    CtsStatus st = begin_loading(&in, series, n_threads, report, &why);
    while (!st && (st = load_slices(series, &in, scanned, report, &why)) == CTS_ERR_PIXELS) {
        int n = 0;
        for (int k = 0; k < in.n_slices; k++)
            n += in.faults[k] != NULL;
        if (n == 0 || too_many_bad(series->n_slices - in.n_slices + n, series->n_slices))
            break;
        drop_bad(&in, report);
        st = CTS_OK;
    }
    end_loading(&in);
    if (st && err)
        *err = why;
    return st;
}

CtsStatus cts_series_scan(const CtsSeries *series, const CtsWordWatch *watch, int n_threads, CtsScanned **scanned,
                          CtsReport *report, CtsError *err)
{
    const CtsStageTimer meter = cts_stage_timer_start(report);
    *scanned = NULL;
    if (!series->renderable) {
        cts_fail(err, series->refusal, "%s", series->reason);
        in_series(series, err);
        return series->refusal;
    }
    const CtsStatus st = load_series(series, watch, cts_threads(n_threads), scanned, report, err);
    /* Time other than reading slices counts as conversion to grey levels. */
    cts_stage_timer_stop(meter, report, CTS_STAGE_GREY);
    for (size_t i = 0; !st && i < series->diagnostics.n; i++)
        cts_report_diagnostic(report, series->diagnostics.items[i].id, "%s", series->diagnostics.items[i].text);
    if (st)
        in_series(series, err);
    return st;
}
