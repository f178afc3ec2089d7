#include "input/load/load.h"

#include "base/file_bytes.h"
#include "base/mem.h"
#include "core/volume/grey.h"
#include "input/files/file_header.h"
#include <math.h>

/* Words of 16 bits: PADDING is the largest one, LAST the largest value. */
enum { PADDING = 65535, LAST = PADDING - 1 };

typedef struct Values {
    float *items; /* n, in the file's order */
    size_t n, n_lost;
    CtsOutliers range; /* of those that are finite */
    bool is_hu;
} Values;

static CtsStatus take_values(void *context, const double *values, size_t first, size_t n, CtsError *err)
{
    Values *const v = context;
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && i < n; i++) {
        const float x = v->items[first + i] = (float)values[i];
        if (isfinite(x))
            st = cts_outliers_take(&v->range, first + i, x, err);
        else
            v->n_lost++;
    }
    return st;
}

/* Isolated HU that no scanner measures become padding where they are low, and the largest other value where they are
 * high; the scale follows from the others. */
static CtsStatus mend_outliers(Values *v, const int dims[3], CtsReport *report, CtsError *err)
{
    CtsOutliers *const all = &v->range;
    const CtsStatus st = cts_outliers_check(all, dims, report, err);
    for (size_t i = 0; !st && i < all->n; i++) {
        float *const x = &v->items[all->voxels[i]];
        *x = *x < 0 ? NAN : (float)all->rest_high;
    }
    all->low = all->rest_low;
    all->high = all->rest_high;
    return st;
}

static CtsStatus read_values(CtsNifti *nifti, const volatile sig_atomic_t *stop, Values *v, CtsReport *report,
                             CtsError *err)
{
    cts_outliers_begin(&v->range, nifti->dims);
    CtsStatus st = cts_nifti_count(nifti, sizeof *v->items + sizeof(uint16_t), &v->n, err);
    if (!st && !(st = cts_alloc_array(&v->items, v->n, err)))
        st = cts_nifti_read(nifti, v->n, stop, take_values, v, err);
    if (!st && !(v->range.low <= v->range.high))
        st = cts_fail(err, CTS_ERR_PIXELS, "holds no finite number");
    return st || !v->is_hu ? st : mend_outliers(v, nifti->dims, report, err);
}

/* Step between words; the lowest value is word 0. */
static double step_of(const Values *v)
{
    const double span = v->range.high - v->range.low;
    if (!v->is_hu)
        return cts_grey_decimal_step(span, LAST);
    return (v->range.rest_whole && span <= LAST) || !(span > 0) ? 1 : span / LAST;
}

static void make_words(const Values *v, const CtsBox *b, double step, uint16_t *words)
{
    const double per_step = 1 / step;
    for (int k = 0; k < b->dims[2]; k++)
        for (int j = 0; j < b->dims[1]; j++) {
            const float *x = v->items + b->first + k * b->stride[2] + j * b->stride[1];
            for (int i = 0; i < b->dims[0]; i++, x += b->stride[0])
                *words++ = isfinite(*x) ? (uint16_t)((*x - v->range.low) * per_step + 0.5) : PADDING;
        }
}

static void report_slices(CtsSlice *slices, int n, double step, double low, const uint16_t *words)
{
    for (int k = 0; k < n; k++) {
        CtsSlice *const s = &slices[k];
        s->pixel_bytes = (uint64_t)s->rows * (uint64_t)s->columns * sizeof *words;
        s->pixel_offset = (uint64_t)s->frame * s->pixel_bytes;
        s->memory = (const uint8_t *)words;
        s->file_bytes = (uint64_t)s->n_frames * s->pixel_bytes;
        s->slope = step;
        s->intercept = low;
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
        from[a] = side(nifti->place.step_lps[a]);
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
    return v->range.low <= -500 || rules->named_quantity
               ? CTS_OK
               : cts_fail(
                     err, CTS_ERR_PIXELS,
                     "no value is below %g, and air has -1000 HU: not in Hounsfield units (name its `quantity`: HU, "
                     "stored, SUVbw or Bq/ml)",
                     v->range.low);
}

CtsStatus cts_nifti_words(CtsSlice *slices, int n, const CtsSeriesRules *rules, const volatile sig_atomic_t *stop,
                          uint16_t **words, CtsReport *report, CtsError *err)
{
    CtsFileBytes file = {.fd = -1};
    CtsNifti nifti = {0};
    Values values = {.is_hu = cts_rules_quantity(rules) == CTS_QUANTITY_HU};
    CtsStatus st = cts_slice_open(&slices[0], &file, err);
    if (!st && !(st = cts_nifti_open(&nifti, &file, err)) && !(st = read_values(&nifti, stop, &values, report, err)) &&
        !(st = check_hu(&values, rules, err)))
        st = cts_alloc_array(words, values.n, err);
    if (!st) {
        cts_nifti_take_form(&nifti, rules->nifti_form);
        const CtsBox box = cts_nifti_box(&nifti);
        const double step = step_of(&values);
        make_words(&values, &box, step, *words);
        report_slices(slices, n, step, values.range.low, *words);
        report_values(&nifti, &box, &values, report);
        char text[CTS_NIFTI_FORMS_TEXT];
        if (rules->nifti_form == CTS_NIFTI_FORM_AUTO && cts_nifti_compare_forms(&nifti, text) == CTS_NIFTI_FORMS_DIFFER)
            cts_report_diagnostic(
                report, CTS_DIAGNOSTIC_NIFTI_FORMS,
                "its sform and its qform differ: %s; the sform is taken (`nifti-form` qform takes the other)", text);
    }
    cts_outliers_free(&values.range);
    cts_free(&values.items);
    cts_nifti_close(&nifti);
    cts_file_bytes_close(&file);
    return st;
}
