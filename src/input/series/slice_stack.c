#include "input/series/slice_stack.h"

#include "base/compare.h"
#include "base/vec3.h"
#include <stdlib.h>

double cts_slice_stack_position_mm(const CtsSlice *reference, const CtsSlice *slice)
{
    return cts_dot3(reference->normal_lps, slice->position_lps);
}

/* Precision of stored positions; smaller deviations are ignored. Files have jitter of up to 0.01 mm (ITK issues 1476,
 * 1607 and 1616). */
#define JITTER_MM 0.02

double cts_slice_stack_tolerance_mm(double median_gap_mm)
{
    return fmin(fmax(JITTER_MM, 0.01 * median_gap_mm), 0.25 * median_gap_mm);
}

void cts_slice_stack_free(CtsSliceStack *stack)
{
    free(stack->layer);
    *stack = (CtsSliceStack){0};
}

/* Largest deviation of a gap that is a multiple of the spacing. */
static double multiple_slack_mm(double spacing_mm)
{
    return fmax(cts_slice_stack_tolerance_mm(spacing_mm), 0.05 * spacing_mm);
}

/* Spacing about gap i: the median, or that of a part with wider slices, which three gaps in a row show that would lack
 * equally many slices: a protocol, not three accidents. */
static double spacing_about(const double *gaps, int n_gaps, int i, double median_mm)
{
    double spacing_mm = median_mm;
    for (int k = i < 3 ? 0 : i - 3; k <= i + 1 && k + 2 < n_gaps; k++) {
        const double *const g = gaps + k, least_mm = fmin(fmin(g[0], g[1]), g[2]);
        if (fmax(fmax(g[0], g[1]), g[2]) - least_mm < 0.5 * median_mm)
            spacing_mm = fmax(spacing_mm, least_mm);
    }
    return spacing_mm;
}

/* The number of slices that gap i lacks: none where it is too narrow for two spacings; at most the largest number of
 * slices, 20000. */
static int missing_in(const double *gaps, int n_gaps, int i, double median_mm)
{
    const double spacing_mm = spacing_about(gaps, n_gaps, i, median_mm);
    return gaps[i] < 2 * spacing_mm - multiple_slack_mm(spacing_mm)
               ? 0
               : (int)fmin(floor(gaps[i] / spacing_mm + 0.5) - 1, 20000);
}

static void classify(CtsSliceStack *s, const double *gaps, int n)
{
    const int n_gaps = n - 1;
    const double tolerance = cts_slice_stack_tolerance_mm(s->spacing_mm), slack = multiple_slack_mm(s->spacing_mm);
    const double even_mm = (s->layer[n - 1] - s->layer[0]) / n_gaps;
    double drift = 0;
    bool is_even = true, whole = true;
    for (int i = 0; i < n_gaps; i++) {
        is_even &= fabs(gaps[i] - even_mm) <= tolerance;
        drift = fmax(drift, fabs(s->layer[i] - s->layer[0] - i * even_mm));
        const int n_missing = missing_in(gaps, n_gaps, i, s->spacing_mm);
        whole &= fabs(gaps[i] - (n_missing + 1) * s->spacing_mm) <= slack;
        if (n_missing && !s->n_missing)
            s->first_gap = i;
        s->n_missing += n_missing;
    }
    /* Gaps within the tolerance may still add up to a drift; a tenth of a layer is visible. */
    if (is_even && drift <= 0.1 * s->spacing_mm)
        s->kind = CTS_STACK_EVEN;
    else
        s->kind = whole && s->n_missing ? CTS_STACK_MISSING : CTS_STACK_UNEQUAL;
}

/* Positions in mm become layer numbers. */
static void number_layers(CtsSliceStack *s, const double *gaps, int n)
{
    if (s->kind == CTS_STACK_UNEQUAL) {
        const double first = s->layer[0], span = s->layer[n - 1] - first;
        const double wanted = ceil(span / s->smallest_gap_mm - 1e-3) + 1; /* 1e-3: rounding of positions */
        s->n_layers = (int)fmin(wanted, CTS_STACK_GROWTH * (double)n);
        for (int i = 0; i < n; i++)
            s->layer[i] = (s->layer[i] - first) / span * (s->n_layers - 1);
        return;
    }
    int layer = 0;
    for (int i = 0; i < n; i++) {
        if (i > 0)
            layer += s->kind == CTS_STACK_EVEN ? 1 : (int)floor(gaps[i - 1] / s->spacing_mm + 0.5);
        s->layer[i] = layer;
    }
    s->n_layers = layer + 1;
}

/* Removes a vector's component along a unit normal, and returns it. */
static double take_along(double v[3], const double normal[3])
{
    const double along = cts_dot3(v, normal);
    for (int c = 0; c < 3; c++)
        v[c] -= along * normal[c];
    return along;
}

/* The line from the first to the last position, its angle to the normal, and the slices' lateral deviation from it. */
static void follow_line(CtsSliceStack *s, const CtsSlice *const *slices, int n)
{
    const CtsSlice *first = slices[0], *middle = slices[n / 2];
    double line[3], off[3];
    cts_sub3(slices[n - 1]->position_lps, first->position_lps, line);
    for (int c = 0; c < 3; c++)
        s->step_lps[c] = line[c] / (s->n_layers - 1);
    const double along = take_along(line, middle->normal_lps);
    s->tilt_deg = atan2(cts_norm3(line), along) * (180 / 3.14159265358979323846);
    for (int i = 0; i < n; i++) {
        for (int c = 0; c < 3; c++)
            off[c] = slices[i]->position_lps[c] - first->position_lps[c] - s->layer[i] * s->step_lps[c];
        take_along(off, middle->normal_lps);
        s->sideways_mm = fmax(s->sideways_mm, cts_norm3(off));
    }
}

bool cts_slice_stack_lacks_many(int n_missing, int n)
{
    return (int64_t)n_missing * 10 > (int64_t)n + n_missing;
}

static CtsStatus check_positions(const CtsSliceStack *s, const CtsSlice *const *slices, int n, bool allow_missing,
                                 CtsError *err)
{
    const CtsSlice *middle = slices[n / 2];
    const double pixel_mm = fmin(middle->row_spacing_mm, middle->column_spacing_mm);
    if (!allow_missing && cts_slice_stack_lacks_many(s->n_missing, n)) {
        const double at = cts_slice_stack_position_mm(middle, slices[s->first_gap]);
        const double next = cts_slice_stack_position_mm(middle, slices[s->first_gap + 1]);
        return cts_fail(
            err, CTS_ERR_GEOMETRY,
            "%d of %d slices missing: a gap of %.3f mm from position %.3f to %.3f mm along the slice normal, "
            "elsewhere %.3f mm (fetch the whole series, split it if it holds several scans, or give "
            "`allow-missing-slices`)",
            s->n_missing, n + s->n_missing, next - at, at, next, s->spacing_mm);
    }
    if (s->tilt_deg > 60) /* gantries tilt by 30 degrees at most */
        return cts_fail(err, CTS_ERR_GEOMETRY, "the line of slice positions is %.1f degrees off the slice normal",
                        s->tilt_deg);
    if (s->sideways_mm > 0.5 * pixel_mm) /* from there on another pixel is nearer */
        return cts_fail(err, CTS_ERR_GEOMETRY,
                        "the slice positions do not lie on a line: one is %.3f mm beside it, with pixels of %.3f mm",
                        s->sideways_mm, pixel_mm);
    return CTS_OK;
}

CtsStatus cts_slice_stack_plan(const CtsSlice *const *slices, int n, bool allow_missing, CtsSliceStack *stack,
                               CtsError *err)
{
    *stack = (CtsSliceStack){0};
    double *gaps = malloc(2 * (size_t)n * sizeof *gaps);
    stack->layer = malloc((size_t)n * sizeof *stack->layer);
    if (!gaps || !stack->layer) {
        free(gaps);
        cts_slice_stack_free(stack);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    double *sorted = gaps + n;
    for (int i = 0; i < n; i++) {
        stack->layer[i] = cts_slice_stack_position_mm(slices[n / 2], slices[i]);
        if (i > 0)
            gaps[i - 1] = sorted[i - 1] = stack->layer[i] - stack->layer[i - 1];
    }
    qsort(sorted, (size_t)n - 1, sizeof *sorted, cts_compare_double);
    stack->spacing_mm = sorted[(n - 2) / 2];
    stack->smallest_gap_mm = sorted[0];
    stack->largest_gap_mm = sorted[n - 2];
    CtsStatus st = CTS_OK;
    if (!(stack->smallest_gap_mm > 0)) {
        st = cts_fail(err, CTS_ERR_GEOMETRY, "several slices lie at one position");
    } else {
        classify(stack, gaps, n);
        number_layers(stack, gaps, n);
        follow_line(stack, slices, n);
        st = check_positions(stack, slices, n, allow_missing, err);
    }
    free(gaps);
    if (st) {
        free(stack->layer);
        stack->layer = NULL;
        stack->n_layers = 0;
    }
    return st;
}

void cts_slice_stack_diagnostics(const CtsSliceStack *s, const CtsSlice *const *slices, int n,
                                 CtsDiagnostics *diagnostics)
{
    const CtsSlice *middle = slices[n / 2];
    if (s->n_missing) {
        const double at = cts_slice_stack_position_mm(middle, slices[s->first_gap]);
        const double next = cts_slice_stack_position_mm(middle, slices[s->first_gap + 1]);
        cts_diagnostics_add(
            diagnostics, CTS_DIAGNOSTIC_MISSING_SLICES,
            "%d of %d slices missing and interpolated: the first gap is %.3f mm, from position %.3f to %.3f "
            "mm along the slice normal, elsewhere %.3f mm",
            s->n_missing, n + s->n_missing, next - at, at, next, s->spacing_mm);
    }
    if (s->kind == CTS_STACK_UNEQUAL)
        cts_diagnostics_add(
            diagnostics, CTS_DIAGNOSTIC_UNEQUAL_SPACING,
            "slice spacing varies from %.3f to %.3f mm (median %.3f): %d slices resampled to %d layers of "
            "%.3f mm",
            s->smallest_gap_mm, s->largest_gap_mm, s->spacing_mm, n, s->n_layers,
            cts_dot3(s->step_lps, middle->normal_lps));
    const double height_mm = fabs(cts_dot3(s->step_lps, middle->normal_lps)) * (s->n_layers - 1);
    if (s->tilt_deg > 0.1 && height_mm * tan(s->tilt_deg * (3.14159265358979323846 / 180)) > JITTER_MM)
        cts_diagnostics_add(diagnostics, CTS_DIAGNOSTIC_GANTRY_TILT,
                            "the stack is sheared by %.2f degrees (gantry tilt); the picture keeps its true shape",
                            s->tilt_deg);
    if (s->sideways_mm > fmax(JITTER_MM, 0.1 * fmin(middle->row_spacing_mm, middle->column_spacing_mm)))
        cts_diagnostics_add(diagnostics, CTS_DIAGNOSTIC_SIDEWAYS_SHIFT,
                            "slice positions deviate by up to %.3f mm from a straight line", s->sideways_mm);
}
