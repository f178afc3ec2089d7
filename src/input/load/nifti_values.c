#include "input/load/load.h"

#include "base/file_bytes.h"
#include "base/mem.h"
#include "core/volume/grey.h"
#include "input/files/file_header.h"
#include "input/load/outliers.h"
#include <math.h>

/* Words of 16 bits: PADDING is the largest one, LAST the largest value. */
enum { PADDING = 65535, LAST = PADDING - 1 };

typedef struct Values {
    float *items; /* n, in the file's order */
    size_t n, n_lost;
    double low, high; /* of those that are finite */
    bool whole;       /* each of them is */
} Values;

static void add_value(Values *v, float x)
{
    if (!isfinite(x)) {
        v->n_lost++;
        return;
    }
    v->low = fmin(v->low, x);
    v->high = fmax(v->high, x);
    v->whole &= x == floorf(x);
}

/* Isolated values that no scanner measures become padding where they are low, and the largest other value where they
 * are high; the scale follows from the others. */
static CtsStatus mend_outliers(Values *v, const int dims[3], CtsReport *report, CtsError *err)
{
    CtsOutliers outliers;
    CtsStatus st = CTS_OK;
    cts_outliers_begin(&outliers, dims);
    for (size_t i = 0; !st && i < v->n; i++)
        if (isfinite(v->items[i]))
            st = cts_outliers_take(&outliers, i, v->items[i], err);
    if (!st)
        st = cts_outliers_check(&outliers, dims, report, err);
    for (size_t i = 0; !st && i < outliers.n; i++) {
        float *const x = &v->items[outliers.voxels[i]];
        *x = *x < 0 ? NAN : (float)outliers.rest_high;
    }
    v->low = outliers.rest_low;
    v->high = outliers.rest_high;
    v->whole = outliers.rest_whole;
    cts_outliers_free(&outliers);
    return st;
}

static CtsStatus read_values(CtsNifti *nifti, CtsQuantity quantity, const volatile sig_atomic_t *stop, Values *v,
                             CtsReport *report, CtsError *err)
{
    enum { PART = 4096 }; /* 32 KiB of values on the stack, in the first-level cache; changes no result */
    double part[PART];
    *v = (Values){.low = INFINITY, .high = -INFINITY, .whole = true};
    CtsStatus st = cts_nifti_count(nifti, sizeof *v->items + sizeof(uint16_t), &v->n, err);
    if (!st)
        st = cts_alloc_array(&v->items, v->n, err);
    for (size_t done = 0; !st && done < v->n; done += PART) {
        const size_t n = v->n - done < PART ? v->n - done : PART;
        st = stop && *stop ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : cts_nifti_read(nifti, part, n, err);
        for (size_t i = 0; !st && i < n; i++)
            add_value(v, v->items[done + i] = (float)part[i]);
    }
    if (!st && !(v->low <= v->high))
        st = cts_fail(err, CTS_ERR_PIXELS, "holds no finite number");
    return !st && quantity == CTS_QUANTITY_HU && (cts_is_outlier(v->low) || cts_is_outlier(v->high))
               ? mend_outliers(v, nifti->dims, report, err)
               : st;
}

/* HU of a word and step between words. */
typedef struct Scale {
    double step_hu, low_hu;
} Scale;

static Scale scale_of(const Values *v, CtsQuantity quantity)
{
    const double span = v->high - v->low;
    if (quantity != CTS_QUANTITY_HU)
        return (Scale){cts_grey_decimal_step(span, LAST), v->low};
    const bool keeps_values = (v->whole && span <= LAST) || !(span > 0);
    return (Scale){keeps_values ? 1 : span / LAST, v->low};
}

static void make_words(const Values *v, const CtsBox *b, Scale scale, uint16_t *words)
{
    const double per_hu = 1 / scale.step_hu;
    for (int k = 0; k < b->dims[2]; k++)
        for (int j = 0; j < b->dims[1]; j++) {
            const float *x = v->items + b->first + k * b->stride[2] + j * b->stride[1];
            for (int i = 0; i < b->dims[0]; i++, x += b->stride[0])
                *words++ = isfinite(*x) ? (uint16_t)((*x - scale.low_hu) * per_hu + 0.5) : PADDING;
        }
}

static void report_slices(CtsSlice *slices, int n, Scale scale, const uint16_t *words)
{
    for (int k = 0; k < n; k++) {
        CtsSlice *const s = &slices[k];
        s->pixel_bytes = (uint64_t)s->rows * (uint64_t)s->columns * sizeof *words;
        s->pixel_offset = (uint64_t)s->frame * s->pixel_bytes;
        s->memory = (const uint8_t *)words;
        s->file_bytes = (uint64_t)s->n_frames * s->pixel_bytes;
        s->slope = scale.step_hu;
        s->intercept = scale.low_hu;
        s->has_padding = true;
        s->padding_low = s->padding_high = PADDING;
    }
}

/* Towards which side of the patient an axis runs. */
static char side(const double step_lps[3])
{
    int most = 0;
    for (int c = 1; c < 3; c++)
        if (fabs(step_lps[c]) > fabs(step_lps[most]))
            most = c;
    return "LPSRAI"[step_lps[most] > 0 ? most : most + 3];
}

static void report_values(const CtsNifti *nifti, const CtsBox *box, const Values *v, CtsReport *report)
{
    char from[4] = "", to[4] = "";
    for (int a = 0; a < 3; a++) {
        from[a] = side(nifti->step_lps[a]);
        to[a] = side(box->step_lps[a]);
    }
    cts_report_diagnostic(
        report, CTS_DIAGNOSTIC_NIFTI_AXES,
        "its voxels are stored in the directions %s, and are read in the order %s as a scanner stores "
        "them; no voxel moves",
        from, to);
    if (v->n_lost)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_NOT_FINITE, "%zu values are not finite, and taken for padding",
                              v->n_lost);
}

/* No header confirms that it is a CT; a body has air around or within it. -500: halfway between air and water. */
static CtsStatus check_hu(const Values *v, const CtsSeriesRules *rules, CtsError *err)
{
    return v->low <= -500 || rules->named_quantity
               ? CTS_OK
               : cts_fail(
                     err, CTS_ERR_PIXELS,
                     "no value is below %g, and air has -1000 HU: not in Hounsfield units (name its `quantity`: HU, "
                     "stored, SUVbw or Bq/ml)",
                     v->low);
}

static void report_forms(const CtsNifti *nifti, CtsReport *report)
{
    char text[CTS_NIFTI_FORMS_TEXT];
    if (cts_nifti_compare_forms(nifti, text) == CTS_NIFTI_FORMS_DIFFER)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_NIFTI_FORMS,
            "its sform and its qform differ: %s; the sform is taken (`nifti-form` qform takes the other)", text);
}

CtsStatus cts_nifti_words(CtsSlice *slices, int n, const CtsSeriesRules *rules, const volatile sig_atomic_t *stop,
                          uint16_t **words, CtsReport *report, CtsError *err)
{
    CtsFileBytes file = {.fd = -1};
    CtsNifti nifti = {0};
    Values values = {0};
    CtsStatus st = cts_slice_open(&slices[0], &file, err);
    if (!st && !(st = cts_nifti_open(&nifti, &file, err)) &&
        !(st = read_values(&nifti, cts_rules_quantity(rules), stop, &values, report, err)) &&
        !(st = check_hu(&values, rules, err)))
        st = cts_alloc_array(words, values.n, err);
    if (!st) {
        cts_nifti_take_form(&nifti, rules->nifti_form);
        const CtsBox box = cts_nifti_box(&nifti);
        const Scale scale = scale_of(&values, cts_rules_quantity(rules));
        make_words(&values, &box, scale, *words);
        report_slices(slices, n, scale, *words);
        report_values(&nifti, &box, &values, report);
        if (rules->nifti_form == CTS_NIFTI_FORM_AUTO)
            report_forms(&nifti, report);
    }
    cts_free(&values.items);
    cts_nifti_close(&nifti);
    cts_file_bytes_close(&file);
    return st;
}
