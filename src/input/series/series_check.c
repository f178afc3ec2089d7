#include "input/series/series_check.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/text.h"
#include "base/vec3.h"
#include "dicom/header/utf8.h"
#include "input/series/slice_stack.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* MAX_SLICES: 2 m in steps of 0.1 mm. MIN_SHARE_PERCENT: like missing slices, at most a tenth is left out. */
enum { MAX_SLICES = 20000, MIN_SHARE_PERCENT = 90 };

/* A status for series that are refused for no fault: by their nature they are no volume. */
static const CtsStatus NO_VOLUME = CTS_OK;

/* The first reason stays. */
static void __attribute__((format(printf, 3, 4)))
refuse_series(CtsSeries *series, CtsStatus fault, const char *format, ...)
{
    va_list args;
    if (series->refusal)
        return;
    va_start(args, format);
    vsnprintf(series->reason, sizeof series->reason, format, args);
    va_end(args);
    cts_text_clean(series->reason);
    series->passed = fault == NO_VOLUME;
    series->refusal = series->passed ? CTS_ERR_GEOMETRY : fault;
    cts_diagnostics_add(&series->diagnostics, series->passed ? CTS_DIAGNOSTIC_PASSED : CTS_DIAGNOSTIC_REFUSED, "%s",
                        series->reason);
}

static const char *plural(int n)
{
    return n == 1 ? "" : "s";
}

/* Only the user can know the meaning of another quantity. */
static void check_quantity(const CtsSliceSet *set, const CtsSeriesRules *rules)
{
    for (int i = 0; i < set->n && !rules->named_quantity; i++)
        if (*set->items[i]->rescale_type)
            cts_slice_fault(
                set->items[i], CTS_ERR_PIXELS,
                "RescaleType (0028,1054) is %.16s, not HU (`quantity` stored renders its values as they are)",
                set->items[i]->rescale_type);
}

typedef void (*pick_fn)(const CtsSliceSet *set, CtsSeries *series, bool *keep);

/* Scouts share the series UID of the scan they planned, and dose pages sometimes that of the scan they report. */
static void pick_slices(const CtsSliceSet *set, CtsSeries *series, bool *keep)
{
    int n_localizers = 0, n_pages = 0;
    for (int i = 0; i < set->n; i++) {
        keep[i] = !set->items[i]->localizer && !set->items[i]->is_report;
        n_localizers += set->items[i]->localizer;
        n_pages += set->items[i]->is_report && !set->items[i]->localizer;
    }
    if (n_localizers == set->n)
        refuse_series(series, NO_VOLUME, "holds only localizer images (scouts), %d of them, and no volume",
                      n_localizers);
    else if (n_localizers + n_pages == set->n)
        refuse_series(series, NO_VOLUME, "holds only pages (dose reports, screen captures), %d of them, and no volume",
                      n_pages);
    else if (set->items[0]->pet.is_reprojection)
        refuse_series(series, NO_VOLUME, "holds projections (SeriesType (0054,1000) is REPROJECTION), and no volume");
    else if (set->n == 1 && (!set->items[0]->fault || set->items[0]->fault == CTS_ERR_GEOMETRY))
        refuse_series(series, NO_VOLUME, "has 1 slice; a volume needs 2 or more");
    if (n_localizers && !series->refusal)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_LOCALIZERS_DROPPED, "%d localizer image%s left out",
                            n_localizers, plural(n_localizers));
    if (n_pages && !series->refusal)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_PAGES_DROPPED,
                            "%d page%s (dose report, screen capture) left out", n_pages, plural(n_pages));
}

/* Slices that cannot be used are left out like missing ones; a series that is mostly such slices is refused. */
static void pick_sound(const CtsSliceSet *set, CtsSeries *series, bool *keep)
{
    const CtsSlice *first = NULL;
    int n = 0;
    for (int i = 0; i < set->n; i++) {
        const CtsSlice *s = set->items[i];
        keep[i] = !s->fault;
        n += !keep[i];
        /* An undecodable transfer syntax is no damage: the whole series needs conversion. */
        if (s->fault && (!first || (s->fault == CTS_ERR_SYNTAX && first->fault != CTS_ERR_SYNTAX)))
            first = s;
    }
    if (!n)
        return;
    if (first->fault == CTS_ERR_SYNTAX)
        refuse_series(series, CTS_ERR_SYNTAX, "%s", first->fault_text);
    else if (n * 10 > set->n || set->n - n < 2)
        refuse_series(series, first->fault, "%s: %s%s", cts_slice_label(first).text, first->fault_text,
                      n > 1 ? ", and others like it" : "");
    else
        for (int i = 0; i < set->n; i++)
            if (!keep[i])
                cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_BAD_SLICES, "%s: %s (left out)",
                                    cts_slice_label(set->items[i]).text, set->items[i]->fault_text);
}

/* One size, orientation and pixel spacing: the largest group, when it is nearly all. Up to three images at right angles
 * to it, within 6 degrees, are scouts without the type: a scan has one or two, frontal and lateral. */
static void pick_largest_grid(const CtsSliceSet *set, CtsSeries *series, bool *keep)
{
    const CtsSlice *best = NULL;
    int n_best = 0, n_across = 0;
    for (int i = 0; i < set->n && n_best * 2 <= set->n; i++) {
        int n = 0;
        for (int j = 0; j < set->n; j++)
            n += cts_slice_same_grid(set->items[j], set->items[i]);
        if (n > n_best) {
            n_best = n;
            best = set->items[i];
        }
    }
    if (n_best < set->n)
        cts_slice_set_take_jittering(set, best, series, keep, &n_best);
    for (int i = 0; i < set->n; i++) {
        keep[i] = cts_slice_same_grid(set->items[i], best);
        n_across += fabs(cts_dot3(set->items[i]->normal_lps, best->normal_lps)) < 0.1;
    }
    const int n_left = set->n - n_best, n_other = n_left - n_across;
    if (!n_left)
        return;
    if (n_across > 3 || (n_other > 0 && n_best * 100 < (set->n - n_across) * MIN_SHARE_PERCENT) || n_best < n_left)
        refuse_series(
            series, CTS_ERR_GEOMETRY,
            "its %d slices differ in size, orientation or pixel spacing; the largest group has %d (split the series)",
            set->n, n_best);
    else
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_OTHER_SLICES_DROPPED,
                            "%d image%s of another size, orientation or pixel spacing left out", n_left,
                            plural(n_left));
}

/* Names of the parts of an identity, and the meaning of two values of each. */
static const struct {
    const char *name, *means;
} identities[CTS_N_IDENTITY] = {
    [CTS_PATIENT_ID] = {"PatientID (0010,0020)", "name different patients"},
    [CTS_PATIENT_ISSUER] = {"IssuerOfPatientID (0010,0021)", "name different patients"},
    [CTS_PATIENT_NAME] = {"PatientName (0010,0010)", "name different patients"},
    [CTS_PATIENT_BIRTH_DATE] = {"PatientBirthDate (0010,0030)", "name different patients"},
    [CTS_PATIENT_SEX] = {"PatientSex (0010,0040)", "name different patients"},
    [CTS_STUDY_UID] = {"StudyInstanceUID (0020,000D)", "are of different studies"},
    [CTS_FRAME_UID] = {"FrameOfReferenceUID (0020,0052)",
                       "lie in different frames of reference, so their positions cannot be compared"},
};

/* Equal texts, in any character sets of the slices. */
static bool same_identity(const CtsSlice *a, const CtsSlice *b, int part)
{
    const char *x = a->identity[part], *y = b->identity[part];
    if (strcmp(x, y) == 0 || strcmp(a->charset, b->charset) == 0)
        return strcmp(x, y) == 0;
    char *p = cts_dcm_convert(x, a->charset), *q = cts_dcm_convert(y, b->charset);
    const bool same = p && q && strcmp(p, q) == 0;
    free(p);
    free(q);
    return same;
}

/* Least number of slices whose even positions are no chance; two always lie evenly. */
enum { FEWEST_OWN_FRAMES = 5 };

static int by_frame_uid(const void *a, const void *b)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    const int order = strcmp(x->identity[CTS_FRAME_UID], y->identity[CTS_FRAME_UID]);
    return order ? order : strcmp(x->sop_uid, y->sop_uid);
}

/* Anonymisers give each slice a frame of reference of its own. That many slices of one scanner are one scan all the
 * same, where they lie evenly (check_stack()); only copies of a slice share one. */
static bool has_own_frames(const CtsSliceSet *set, CtsStatus *st, CtsError *err)
{
    CtsSlice **sorted = NULL;
    if (set->n < FEWEST_OWN_FRAMES)
        return false;
    if (!(sorted = malloc((size_t)set->n * sizeof *sorted))) {
        *st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        return false;
    }
    memcpy(sorted, set->items, (size_t)set->n * sizeof *sorted);
    qsort(sorted, (size_t)set->n, sizeof *sorted, by_frame_uid);
    int n_own = 1;
    bool own = *sorted[0]->identity[CTS_FRAME_UID] && !sorted[0]->n_frames;
    for (int i = 1; own && i < set->n; i++) {
        const bool differ = strcmp(sorted[i]->identity[CTS_FRAME_UID], sorted[i - 1]->identity[CTS_FRAME_UID]) != 0;
        n_own += differ;
        own = !sorted[i]->n_frames && !strcmp(sorted[i]->scanner, sorted[0]->scanner) &&
              (differ || (*sorted[i]->sop_uid && !strcmp(sorted[i]->sop_uid, sorted[i - 1]->sop_uid)));
    }
    free(sorted);
    return own && n_own >= FEWEST_OWN_FRAMES;
}

static void refuse_identity(CtsSeries *series, int part)
{
    refuse_series(series, CTS_ERR_GEOMETRY, "its slices %s (%s)", identities[part].means, identities[part].name);
}

/* A volume needs one patient, one study and one frame of reference. Messages contain no values. */
static void check_identity(const CtsSliceSet *set, CtsSeries *series, int part)
{
    const CtsSlice *known = NULL;
    int n_empty = 0;
    for (int i = 0; i < set->n; i++) {
        const CtsSlice *s = set->items[i];
        const bool empty = !*s->identity[part];
        n_empty += empty;
        if (!known && !empty)
            known = s;
        if (known && !empty && !same_identity(known, s, part)) {
            refuse_identity(series, part);
            return;
        }
    }
    if (known && n_empty)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_IDENTITY_INCOMPLETE,
                            "%s is empty in %d of %d slices, and has one value in the others", identities[part].name,
                            n_empty, set->n);
}

/* An object has the modality of its class; DICOM requires it, and a missing value is not a contradiction. */
static void check_modality(const CtsSliceSet *set, CtsSeries *series)
{
    for (int i = 0; i < set->n; i++) {
        const char *const modality = set->items[i]->modality, *const of_class =
                                                                  cts_modality_names[set->items[i]->modality_id];
        if (*modality && strcasecmp(modality, of_class) != 0)
            refuse_series(series, CTS_ERR_PIXELS, "%s: Modality (0008,0060) is %.16s in an object of %s",
                          cts_slice_label(set->items[i]).text, modality, of_class);
        if (set->items[i]->pet.units != set->items[0]->pet.units)
            refuse_series(series, CTS_ERR_PIXELS, "its slices differ in Units (0054,1001) (split the series)");
    }
}

/* Positions nearer than this are one position; negative when all are. Gaps up to 1e-3 mm are rounding. The mean counts,
 * since most gaps are narrow where several volumes lie a little beside each other. */
static double same_position(const CtsSliceSet *set)
{
    int n = 0;
    for (int i = 1; i < set->n; i++)
        n += !cts_slice_same_place(set->items[i - 1], set->items[i], 1e-3);
    const double span_mm = cts_slice_stack_position_mm(set->items[0], set->items[set->n - 1]) -
                           cts_slice_stack_position_mm(set->items[0], set->items[0]);
    return n ? cts_slice_stack_tolerance_mm(span_mm / n) : -1;
}

static void describe_deviation(CtsSeries *series)
{
    static const struct {
        unsigned deviations;
        CtsDiagnosticId id;
        const char *text;
    } kinds[] = {
        {CTS_DEVIATION_NO_PREAMBLE, CTS_DIAGNOSTIC_NO_PREAMBLE, "have no DICOM preamble; read as bare data sets"},
        {CTS_DEVIATION_NO_SYNTAX, CTS_DIAGNOSTIC_NO_TRANSFER_SYNTAX,
         "name no transfer syntax; it was detected from the data"},
        {CTS_DEVIATION_ORIENTATION, CTS_DIAGNOSTIC_ROUGH_ORIENTATION,
         "have an orientation that is not orthonormal by more than 0.001; corrected"},
        {CTS_DEVIATION_MONOCHROME1, CTS_DIAGNOSTIC_MONOCHROME1, "are MONOCHROME1; values are taken as they are"},
        {CTS_DEVIATION_LOSSY, CTS_DIAGNOSTIC_LOSSY, "hold lossy compressed pixels (0028,2110)"},
        {CTS_DEVIATION_LONG_PIXELS, CTS_DIAGNOSTIC_LONG_PIXELS,
         "have more PixelData (7FE0,0010) than they need; the rest is not read"},
        {CTS_DEVIATION_UNSPECIFIED, CTS_DIAGNOSTIC_RESCALE_UNSPECIFIED,
         "have the RescaleType (0028,1054) US or UNSPECIFIED; taken for Hounsfield units"},
        {CTS_DEVIATION_FALLING, CTS_DIAGNOSTIC_NEGATIVE_SLOPE,
         "have a negative RescaleSlope (0028,1053), so that their largest stored values are the least dense"},
        {CTS_DEVIATION_NOT_HU, CTS_DIAGNOSTIC_NOT_HU,
         "say by ImageType (0008,0008) that they show another quantity than Hounsfield units, in which a preset means "
         "nothing"},
        {CTS_DEVIATION_BURNED_IN, CTS_DIAGNOSTIC_BURNED_IN_ANNOTATION,
         "say that text is burned into their pixels (0028,0301); it may show in the picture"},
    };
    const bool is_image = series->n_slices && series->slices[0]->kind == CTS_OBJECT_IMAGE;
    for (size_t k = 0; !is_image && k < sizeof kinds / sizeof *kinds; k++) {
        int n = 0;
        for (int i = 0; i < series->n_slices; i++)
            n += (series->slices[i]->deviations & kinds[k].deviations) != 0;
        if (n)
            cts_diagnostics_add(&series->diagnostics, kinds[k].id, "%d of %d slices %s", n, series->n_slices,
                                kinds[k].text);
    }
}

/* The plane across the axis within 37 degrees of the normal; at most one axis is. */
static const char *orientation_of(const double normal[3])
{
    static const char *const names[3] = {"sagittal", "coronal", "axial"};
    for (int c = 0; c < 3; c++)
        if (fabs(normal[c]) > 0.8)
            return names[c];
    return "oblique";
}

static void describe_series(CtsSeries *series, const CtsSlice *s)
{
    snprintf(series->uid, sizeof series->uid, "%s", s->series_uid);
    snprintf(series->study_uid, sizeof series->study_uid, "%s", s->identity[CTS_STUDY_UID]);
    if (strlen(s->study_date) == 8 && strspn(s->study_date, "0123456789") == 8)
        snprintf(series->study_date, sizeof series->study_date, "%.4s-%.2s-%.2s", s->study_date, s->study_date + 4,
                 s->study_date + 6);
    series->series_number = s->series_number;
    series->no_patient = s->kind == CTS_OBJECT_NIFTI;
    snprintf(series->modality, sizeof series->modality, "%s", s->modality);
    series->modality_id = s->modality_id;
    snprintf(series->transfer_syntax, sizeof series->transfer_syntax, "%s", s->syntax_uid);
    cts_text_clean(series->uid); /* shown as they are */
    cts_text_clean(series->study_uid);
    cts_text_clean(series->modality);
    cts_text_clean(series->transfer_syntax);
    snprintf(series->orientation, sizeof series->orientation, "%s", orientation_of(s->normal_lps));
    series->may_name = s->deviations & CTS_DEVIATION_MAY_NAME;
    if (s->kind == CTS_OBJECT_IMAGE)
        series->orientation[0] = 0;
    series->rows = s->rows;
    series->columns = s->columns;
    series->spacing_mm[0] = s->column_spacing_mm;
    series->spacing_mm[1] = s->row_spacing_mm;
}

/* Slices missing at regular intervals leave no wider gap; their instance numbers reveal them. With every 2nd or 3rd
 * slice the picture is coarse but correct. n_in_gaps of them were already reported. */
static void check_numbers(const CtsSliceSet *set, const CtsStudyNumbers *numbers, int n_in_gaps, CtsSeries *series)
{
    const CtsMissingSlices missing = cts_slice_set_missing(set, numbers);
    char what[300];
    if (!missing.n)
        return;
    const CtsSlice *a = set->items[missing.first], *b = set->items[missing.first + 1];
    const bool is_thinned = missing.every == 2 || missing.every == 3;
    if (missing.every)
        snprintf(what, sizeof what,
                 "only every %d%s slice is present: InstanceNumber (0020,0013) steps by %d, and slices of %.3g mm lie "
                 "%.3g mm apart",
                 missing.every,
                 !is_thinned          ? "th"
                 : missing.every == 2 ? "nd"
                                      : "rd",
                 missing.every, missing.thickness_mm, missing.gap_mm);
    else
        snprintf(what, sizeof what,
                 "%d of %d slices missing: InstanceNumber (0020,0013) steps from %d to %d between slices of %.3g mm "
                 "that lie %.3g mm apart",
                 missing.n, set->n + missing.n, a->instance_number, b->instance_number, missing.thickness_mm,
                 missing.gap_mm);
    if (!is_thinned && !series->rules.allow_missing_slices && cts_slice_stack_lacks_many(missing.n, set->n))
        refuse_series(series, CTS_ERR_GEOMETRY, "%s (fetch the whole series, or give `allow-missing-slices`)", what);
    else if (missing.n > n_in_gaps)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_MISSING_SLICES,
                            "%s; what lies between is interpolated", what);
}

/* A missing part at an end leaves no gap and causes a warning; one between others counts as missing slices. */
static const char *check_parts(const CtsSliceSet *set, CtsSeries *series)
{
    const CtsSlice *lacking = NULL;
    for (int i = 0; i < set->n && !lacking; i++)
        lacking = set->items[i]->missing_parts ? set->items[i] : NULL;
    if (!lacking)
        return NULL;
    if (cts_slice_stack_lacks_many(lacking->n_lacking, set->n) && !series->rules.allow_missing_slices)
        refuse_series(series, CTS_ERR_GEOMETRY, "%s (fetch the whole series, or give `allow-missing-slices`)",
                      lacking->missing_parts);
    else
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_CONCATENATION_INCOMPLETE, "%s",
                            lacking->missing_parts);
    return lacking->missing_parts;
}

/* True of cuts to plan a scan by: more of the body lies between than twice what they hold, and none is missing. */
static bool are_single_cuts(const CtsSliceSet *set, const CtsSliceStack *stack, const CtsStudyNumbers *numbers)
{
    const double thickness_mm = set->items[0]->thickness_mm;
    return set->items[0]->modality_id == CTS_MODALITY_MR && thickness_mm > 0 && stack->spacing_mm > 3 * thickness_mm &&
           !cts_slice_set_missing(set, numbers).n;
}

static CtsStatus check_stack(CtsSliceSet *set, const CtsStudyNumbers *numbers, CtsSeries *series, CtsError *err)
{
    CtsSliceStack stack;
    CtsError why = {0};
    const CtsSlice *const *slices = (const CtsSlice *const *)set->items;
    const CtsStatus st = cts_slice_stack_plan(slices, set->n, series->rules.allow_missing_slices, &stack, &why);
    if (st == CTS_ERR_MEMORY)
        return cts_fail(err, st, "%s", why.text);
    series->spacing_mm[2] = stack.spacing_mm;
    series->tilt_deg = stack.tilt_deg;
    if (series->frames_differ && (st || stack.kind != CTS_STACK_EVEN))
        refuse_identity(series, CTS_FRAME_UID);
    else if (series->frames_differ)
        cts_diagnostics_add(
            &series->diagnostics, CTS_DIAGNOSTIC_FRAMES_OF_REFERENCE,
            "each of its %d slices has a FrameOfReferenceUID (0020,0052) of its own, as some anonymisers "
            "write; taken for one, as one scanner made them and they lie evenly",
            set->n);
    const char *lacks = check_parts(set, series);
    if (are_single_cuts(set, &stack, numbers))
        refuse_series(series, NO_VOLUME, "holds %d single cuts of %.3g mm that lie %.3g mm apart, and no volume",
                      set->n, set->items[0]->thickness_mm, stack.spacing_mm);
    if (st) {
        refuse_series(series, st, "%s%s%s", lacks ? lacks : "", lacks ? "; " : "", why.text);
        return CTS_OK;
    }
    if (set->n == 2 && !series->refusal)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_TWO_SLICES, "only 2 slices: a very thin volume");
    cts_slice_stack_diagnostics(&stack, slices, set->n, &series->diagnostics);
    check_numbers(set, numbers, stack.n_missing, series);
    cts_slice_stack_free(&stack);
    return CTS_OK;
}

static bool distinct(int *numbers, int n)
{
    qsort(numbers, (size_t)n, sizeof *numbers, cts_compare_int);
    for (int i = 1; i < n; i++)
        if (numbers[i] == numbers[i - 1])
            return false;
    return true;
}

/* Scanners number slices by position. Where numbers and positions disagree, one of the two is wrong, and the picture
 * follows the positions. */
static CtsStatus check_order(const CtsSliceSet *set, CtsSeries *series, CtsError *err)
{
    int *numbers = NULL, n = 0;
    const CtsStatus st = cts_alloc_array(&numbers, (size_t)set->n, err);
    if (st)
        return st;
    while (n < set->n && set->items[n]->has_instance && !set->items[n]->n_frames) {
        numbers[n] = set->items[n]->instance_number;
        n++;
    }
    if (n == set->n && !cts_slice_set_in_order(set) && distinct(numbers, n))
        cts_diagnostics_add(
            &series->diagnostics, CTS_DIAGNOSTIC_ORDER_CONFLICT,
            "InstanceNumber (0020,0013) neither rises nor falls with the slices' positions (0020,0032), "
            "by which they are ordered");
    cts_free(&numbers);
    return CTS_OK;
}

/* Slices missing at an end leave no gap. Where instance numbers rise by one from slice to slice they reveal missing
 * first ones; they need not begin at 1, so this is not a warning. */
static void note_first_number(const CtsSliceSet *set, CtsSeries *series)
{
    const int a = set->items[0]->instance_number, b = set->items[set->n - 1]->instance_number;
    const int step = a < b ? 1 : -1, least = a < b ? a : b;
    for (int i = 0; i < set->n; i++)
        if (set->items[i]->n_frames || set->items[i]->instance_number != a + step * i)
            return;
    if (least > 1)
        cts_diagnostics_add(
            &series->diagnostics, CTS_DIAGNOSTIC_LATE_FIRST_NUMBER,
            "the instance numbers (0020,0013) of its slices begin at %d: up to %d slices may be missing at "
            "one end",
            least, least - 1);
}

/* A series refused for its pixels still has a place in space. */
static void describe_refused(CtsSliceSet *set, CtsSeries *series)
{
    CtsSliceStack stack;
    for (int i = 0; i < set->n; i++)
        if (set->items[i]->kind != CTS_OBJECT_SLICE || set->items[i]->fault == CTS_ERR_GEOMETRY ||
            set->items[i]->localizer || !cts_slice_same_grid(set->items[i], set->items[0]))
            return;
    if (set->n < 2)
        return;
    cts_slice_set_sort(set, set->items[0]);
    cts_slice_stack_plan((const CtsSlice *const *)set->items, set->n, true, &stack, NULL);
    series->spacing_mm[2] = stack.spacing_mm;
    series->tilt_deg = stack.tilt_deg;
    cts_slice_stack_free(&stack);
}

/* A NIfTI file names no modality. */
static const CtsModality modality_of_quantity[CTS_N_QUANTITIES] = {[CTS_QUANTITY_HU] = CTS_MODALITY_CT,
                                                                   [CTS_QUANTITY_SUVBW] = CTS_MODALITY_PT,
                                                                   [CTS_QUANTITY_BQML] = CTS_MODALITY_PT,
                                                                   [CTS_QUANTITY_STORED] = CTS_MODALITY_MR};

static CtsValueScale quantity_scale(const CtsSliceSet *set, CtsSeries *series)
{
    bool is_named = set->items[0]->kind == CTS_OBJECT_NIFTI;
    for (int i = 0; i < set->n; i++)
        is_named |= *set->items[i]->rescale_type;
    if (series->modality_id == CTS_MODALITY_PT)
        return cts_pet_scale((const CtsSlice *const *)set->items, set->n);
    if (series->modality_id == CTS_MODALITY_MR || set->items[0]->kind == CTS_OBJECT_IMAGE)
        return (CtsValueScale){CTS_QUANTITY_STORED, 1, ""};
    return (CtsValueScale){is_named ? cts_rules_quantity(&series->rules) : CTS_QUANTITY_HU, 1, ""};
}

/* Sets the quantity, and brings slope and intercept of the slices to it. */
static void take_quantity(const CtsSliceSet *set, CtsSeries *series)
{
    const CtsValueScale scale = quantity_scale(set, series);
    series->quantity = scale.quantity;
    series->value_factor = scale.factor;
    if (series->no_patient) {
        series->modality_id = modality_of_quantity[scale.quantity];
        snprintf(series->modality, sizeof series->modality, "%s", cts_modality_names[series->modality_id]);
    }
    if (scale.why[0] && !series->refusal)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_NO_SUV,
                            "values are %s, not SUV, for which they lack %s",
                            scale.quantity == CTS_QUANTITY_BQML ? "Bq/ml" : "as stored", scale.why);
    for (int i = 0; i < set->n; i++) {
        set->items[i]->slope *= scale.factor;
        set->items[i]->intercept *= scale.factor;
    }
}

static CtsStatus finish_series(CtsSeries *series, CtsSliceSet *set, const CtsStudyNumbers *numbers, bool whole,
                               CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsSlice *middle = set->items[set->n / 2];
    describe_series(series, middle);
    take_quantity(set, series);
    if (*middle->description && !(series->description = cts_dcm_utf8(middle->description, middle->charset)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (series->refusal)
        describe_refused(set, series);
    else if (!st)
        st = check_stack(set, numbers, series, err);
    if (!st && whole && !series->refusal)
        note_first_number(set, series);
    if (!st && !series->refusal)
        st = check_order(set, series, err);
    if (!st) { /* refused or not */
        series->slices = set->items;
        series->n_slices = set->n;
        *set = (CtsSliceSet){0};
    }
    describe_deviation(series);
    series->renderable = !series->refusal;
    return st;
}

/* All checks that do not compare positions. */
static CtsStatus check_each_slice(CtsSliceSet *set, CtsSeries *series, CtsError *err)
{
    static const pick_fn picks[] = {pick_slices, pick_sound, pick_largest_grid};
    bool *keep = NULL;
    if (set->items[0]->kind == CTS_OBJECT_IMAGE) {
        cts_slice_set_sort(set, set->items[0]);
        refuse_series(series, NO_VOLUME, "holds %d image%s of modality %.16s, and no volume", set->n, plural(set->n),
                      set->items[0]->modality[0] ? set->items[0]->modality : "(none)");
        return CTS_OK;
    }
    if (set->n > MAX_SLICES)
        refuse_series(series, CTS_ERR_GEOMETRY, "has %d slices, more than %d", set->n, MAX_SLICES);
    check_modality(set, series);
    check_quantity(set, &series->rules);
    const size_t n_picks = set->items[0]->modality_id == CTS_MODALITY_CT ? 3 : 2;
    CtsStatus st = cts_alloc_array(&keep, (size_t)set->n, err);
    for (size_t i = 0; !st && !series->refusal && i < n_picks; i++) {
        picks[i](set, series, keep);
        if (!series->refusal)
            cts_slice_set_filter(set, keep);
    }
    cts_free(&keep);
    for (int part = 0; !st && !series->refusal && part < CTS_N_IDENTITY; part++)
        if (part != CTS_FRAME_UID || !(series->frames_differ = has_own_frames(set, &st, err)))
            check_identity(set, series, part);
    if (!st && !series->refusal && set->n == 1)
        refuse_series(series, NO_VOLUME, "has 1 slice; a volume needs 2 or more");
    return st;
}

/* True for as many slices at one position as there are times: a time series of contrast agent, not a volume. */
static bool is_watch(const CtsSliceSet *set)
{
    for (int i = 0; i < set->n; i++)
        for (int k = 0; k < i; k++) {
            const double time = set->items[i]->volume_number[CTS_ACQUISITION_TIME];
            if (isnan(time) || time == set->items[k]->volume_number[CTS_ACQUISITION_TIME])
                return false;
        }
    return true;
}

/* The attributes that may separate volumes, in words. */
static const char *const separators[CTS_N_MODALITIES] = {
    [CTS_MODALITY_CT] = "acquisition, tube voltage, temporal position, trigger, cardiac phase, kernel nor time",
    [CTS_MODALITY_MR] =
        "echo, inversion time, flip angle, diffusion, temporal position, trigger, image type, time nor instance number",
    [CTS_MODALITY_PT] = "reference time nor image index",
};

/* Removes copies and separates phases. The parts own the slices afterwards, where there are any. */
static CtsStatus separate(CtsSliceSet *set, CtsSeries *series, CtsSliceSet **parts, int *n_parts, CtsError *err)
{
    int n_dropped = 0;
    const char *by = NULL;
    const CtsModality modality = set->items[0]->modality_id;
    cts_slice_set_sort(set, set->items[0]);
    const double same_mm = same_position(set);
    CtsStatus st = cts_slice_set_drop_copies(set, same_mm < 0 ? 1e-3 : same_mm, &n_dropped, err);
    if (st)
        return st;
    if (n_dropped)
        cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_COPIES_DROPPED,
                            "%d slice%s left out as duplicate%s (same position, same pixels)", n_dropped,
                            plural(n_dropped), plural(n_dropped));
    if (set->n == 1)
        refuse_series(series, NO_VOLUME, "has 1 slice; a volume needs 2 or more");
    else if (same_mm < 0 && (is_watch(set) || modality != CTS_MODALITY_CT))
        refuse_series(series, NO_VOLUME, "is a time series of %d images at one position, and no volume", set->n);
    else if (same_mm < 0)
        refuse_series(series, CTS_ERR_GEOMETRY,
                      "all %d slices lie at one position (ImagePositionPatient (0020,0032)): no volume", set->n);
    else if (!(st = cts_slice_set_split(set, same_mm, parts, n_parts, &by, err))) {
        bool differ = false;
        for (int p = 1; p < *n_parts; p++)
            differ |= (*parts)[p].n != (*parts)[0].n;
        if (*n_parts)
            cts_diagnostics_add(&series->diagnostics, CTS_DIAGNOSTIC_ACQUISITIONS_PARTED,
                                "%s separates %d volumes%s, whose slices lie at the same positions or alternate", by,
                                *n_parts, differ ? " of unequal numbers of slices" : "");
        else if (by)
            refuse_series(
                series, CTS_ERR_GEOMETRY,
                "its slices alternate between values of %s, and those of one value form no complete volume (split the "
                "series)",
                by);
        else if (cts_slice_set_repeats(set, same_mm) && modality == CTS_MODALITY_PT && !set->items[0]->pet.is_dynamic)
            refuse_series(series, CTS_ERR_GEOMETRY,
                          "several slices with different pixels lie at one position, which a PET has only where "
                          "SeriesType (0054,1000) is DYNAMIC or GATED: no volume (split the series, or correct its "
                          "type)");
        else if (cts_slice_set_repeats(set, same_mm))
            refuse_series(series, CTS_ERR_GEOMETRY,
                          "several slices with different pixels lie at one position, and neither %s separates complete "
                          "volumes (split the series)",
                          separators[modality]);
    }
    return st;
}

static void free_sets(CtsSliceSet *sets, int n)
{
    for (int i = 0; i < n; i++)
        cts_slice_set_free(&sets[i]);
    free(sets);
}

/* A series with diagnostics of its own. */
static CtsSeries copy_of(const CtsSeries *series)
{
    CtsSeries copy = *series;
    copy.diagnostics = (CtsDiagnostics){0};
    for (size_t i = 0; i < series->diagnostics.n; i++)
        cts_diagnostics_add(&copy.diagnostics, series->diagnostics.items[i].id, "%s",
                            series->diagnostics.items[i].text);
    return copy;
}

/* Fills traits of a series that has its slices. */
static void describe_traits(CtsSeries *series)
{
    const CtsSlice *const middle = series->slices[series->n_slices / 2];
    char *const traits = series->traits;
    const size_t size = sizeof series->traits;
    cts_text_append(traits, size, ", ", "%d x %d x %d", series->columns, series->rows, series->n_slices);
    if (series->spacing_mm[0] > 0)
        cts_text_append(traits, size, ", ", "pixels of %.3g mm", series->spacing_mm[0]);
    if (series->spacing_mm[2] > 0)
        cts_text_append(traits, size, ", ", "slices %.3g mm apart", series->spacing_mm[2]);
    if (middle->thickness_mm > 0)
        cts_text_append(traits, size, ", ", "%.3g mm thick", middle->thickness_mm);
    if (middle->kernel[0])
        cts_text_append(traits, size, ", ", "kernel %.32s", middle->kernel);
    if (middle->contrast)
        cts_text_append(traits, size, ", ", "contrast agent");
    /* The first two values say ORIGINAL or DERIVED, PRIMARY or SECONDARY. */
    const char *type = middle->image_type;
    for (int i = 0; type && i < 2; i++)
        type = strchr(type, '\\') ? strchr(type, '\\') + 1 : NULL;
    if (type && *type)
        cts_text_append(traits, size, ", ", "%.32s", type);
    cts_text_clean(traits);
}

/* Add one volume, with what was found about the whole series. */
static CtsStatus add_volume(CtsSeriesList *list, const CtsSeries *whole, CtsSliceSet *part,
                            const CtsStudyNumbers *numbers, bool is_whole, CtsError *err)
{
    CtsStatus st = cts_grow(&list->items, list->n, err);
    if (st)
        return st;
    CtsSeries *const series = &list->items[list->n++];
    *series = copy_of(whole);
    if (!(st = finish_series(series, part, numbers, is_whole, err)))
        describe_traits(series);
    return st;
}

/* Adds the volumes of one grid, with what was found about all. */
static CtsStatus add_grid(CtsSeriesList *list, const CtsSeries *all, CtsSliceSet *set, const CtsStudyNumbers *numbers,
                          bool is_whole, CtsError *err)
{
    CtsSeries whole = copy_of(all);
    CtsSliceSet *parts = NULL;
    int n_parts = 0;
    CtsStatus st = CTS_OK;
    if (!whole.refusal)
        st = separate(set, &whole, &parts, &n_parts, err);
    if (!st && !n_parts)
        st = add_volume(list, &whole, set, numbers, is_whole, err);
    for (int p = 0; !st && p < n_parts; p++)
        st = add_volume(list, &whole, &parts[p], numbers, false, err);
    free_sets(parts, n_parts);
    cts_diagnostics_free(&whole.diagnostics);
    return st;
}

CtsStatus cts_series_check(CtsSliceSet *set, const CtsSeriesRules *rules, const CtsStudyNumbers *numbers,
                           CtsSeriesList *list, CtsError *err)
{
    CtsSeries all = {.rules = *rules};
    CtsSliceSet *grids = NULL;
    int n_grids = 0;
    CtsStatus st = check_each_slice(set, &all, err);
    if (!st && !all.refusal && set->items[0]->modality_id != CTS_MODALITY_CT)
        st = cts_slice_set_grids(set, &all, &grids, &n_grids, err);
    if (!st && !all.refusal && set->n > 1 && !n_grids && !cts_slice_same_grid(set->items[0], set->items[1]))
        refuse_series(&all, NO_VOLUME, "its %d images have sizes or orientations of their own, and are no volume",
                      set->n);
    if (!st && !n_grids)
        st = add_grid(list, &all, set, numbers, true, err);
    for (int g = 0; !st && g < n_grids; g++)
        st = add_grid(list, &all, &grids[g], numbers, false, err);
    free_sets(grids, n_grids);
    cts_slice_set_free(set);
    cts_diagnostics_free(&all.diagnostics);
    return st;
}
