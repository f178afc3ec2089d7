#include "input/series/series_check.h"

#include "base/compare.h"
#include "input/series/slice_stack.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void cts_slice_set_free(CtsSliceSet *set)
{
    for (int i = 0; i < set->n; i++)
        cts_slice_free(set->items[i]);
    free(set->items);
    *set = (CtsSliceSet){0};
}

void cts_slice_set_filter(CtsSliceSet *set, const bool *keep)
{
    int kept = 0;
    for (int i = 0; i < set->n; i++)
        if (keep[i])
            set->items[kept++] = set->items[i];
        else
            cts_slice_free(set->items[i]);
    set->n = kept;
}

static int compare_numbers(double a, double b)
{
    return (a > b) - (a < b);
}

static int by_position(const void *a, const void *b, void *reference)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    int order = compare_numbers(cts_slice_stack_position_mm(reference, x), cts_slice_stack_position_mm(reference, y));
    if (!order)
        order = compare_numbers(x->acquisition_number, y->acquisition_number);
    if (!order)
        order = compare_numbers(x->temporal_index, y->temporal_index);
    if (!order)
        order = compare_numbers(x->time_s, y->time_s);
    if (!order)
        order = compare_numbers(x->instance_number, y->instance_number);
    if (!order)
        order = strcmp(x->path, y->path);
    return order ? order : x->frame - y->frame;
}

void cts_slice_set_sort(CtsSliceSet *set, const CtsSlice *reference)
{
    qsort_r(set->items, (size_t)set->n, sizeof(CtsSlice *), by_position, (void *)(uintptr_t)reference);
}

bool cts_slice_same_place(const CtsSlice *a, const CtsSlice *b, double same_mm)
{
    return cts_slice_stack_position_mm(a, b) - cts_slice_stack_position_mm(a, a) <= same_mm;
}

bool cts_slice_set_repeats(const CtsSliceSet *set, double same_mm)
{
    for (int i = 1; i < set->n; i++)
        if (cts_slice_same_place(set->items[i - 1], set->items[i], same_mm))
            return true;
    return false;
}

/* A part is complete when its slices form an even stack. */
static bool is_whole(const CtsSliceSet *part, double same_mm)
{
    CtsSliceStack stack;
    if (part->n < 2 || cts_slice_set_repeats(part, same_mm) ||
        cts_slice_stack_plan((const CtsSlice *const *)part->items, part->n, false, &stack, NULL))
        return false;
    const bool even = stack.kind == CTS_STACK_EVEN;
    cts_slice_stack_free(&stack);
    return even;
}

enum {
    BY_ACQUISITION,
    BY_VOLTAGE,
    BY_TEMPORAL_POSITION,
    BY_TRIGGER,
    BY_PHASE_PERCENT,
    BY_PHASE_DELAY,
    BY_THICKNESS,
    BY_KERNEL,
    BY_OBJECT,
    BY_TIME,
    BY_CONTENT_TIME,  /* one for all slices of a phase */
    BY_CONTENT_ORDER, /* one for each slice, later in each phase */
    N_WAYS
};

static const struct {
    const char *name;
    bool takes_turns;  /* the slices of two acquisitions may lie between each other */
    bool must_overlap; /* its values may also change within one scan, so parts must overlap */
} ways[N_WAYS] = {
    [BY_ACQUISITION] = {"AcquisitionNumber (0020,0012)", true, false},
    [BY_VOLTAGE] = {"KVP (0018,0060)", true, false},
    [BY_TEMPORAL_POSITION] = {"TemporalPositionIdentifier (0020,0100)", true, false},
    [BY_TRIGGER] = {"TriggerTime (0018,1060)", true, false},
    [BY_PHASE_PERCENT] = {"NominalPercentageOfCardiacPhase (0020,9241)", false, true},
    [BY_PHASE_DELAY] = {"NominalCardiacTriggerDelayTime (0020,9153)", false, true},
    [BY_THICKNESS] = {"SliceThickness (0018,0050)", true, false},
    [BY_KERNEL] = {"ConvolutionKernel (0018,1210)", false, true},
    [BY_CONTENT_TIME] = {"ContentTime (0008,0033)", false, true},
    [BY_CONTENT_ORDER] = {"ContentTime (0008,0033)", false, true},
    [BY_OBJECT] = {"SOPInstanceUID (0008,0018)", false, false},
    [BY_TIME] = {"AcquisitionTime (0008,0032)", false, false},
};

/* The value of an acquisition criterion for a slice; NaN where it is missing. */
static double acquisition_label(const CtsSlice *s, int way)
{
    switch (way) {
    case BY_ACQUISITION:
        return s->has_acquisition ? (double)s->acquisition_number : (double)NAN;
    case BY_VOLTAGE:
        return s->kvp < 0 ? (double)NAN : s->kvp;
    case BY_TEMPORAL_POSITION:
        return s->has_temporal ? (double)s->temporal_index : (double)NAN;
    case BY_PHASE_PERCENT:
        return s->phase_percent;
    case BY_PHASE_DELAY:
        return s->phase_delay_ms;
    case BY_CONTENT_TIME:
        return s->content_s < 0 ? (double)NAN : s->content_s;
    default:
        return s->trigger_ms < 0 ? (double)NAN : s->trigger_ms;
    }
}

/* Number of the first slice with the same text, kernel or object (file); false where one is missing. */
static bool label_texts(const CtsSliceSet *set, int way, double *part)
{
    for (int i = 0; i < set->n; i++) {
        const char *text = way == BY_KERNEL ? set->items[i]->kernel : set->items[i]->path;
        if (!text || !*text || (way == BY_OBJECT && !set->items[i]->n_frames))
            return false;
        part[i] = i;
        for (int k = 0; k < i && part[i] == i; k++)
            if (part[k] == k && !strcmp(way == BY_KERNEL ? set->items[k]->kernel : set->items[k]->path, text))
                part[i] = k;
    }
    return true;
}

/* Groups of thicknesses: sorted, each is within 10 % of the one before, as rounding and oblique planes vary them. False
 * for one group, or where a thickness is missing. */
static bool label_thickness(const CtsSliceSet *set, double *part)
{
    struct {
        double thickness_mm; /* first, as cts_compare_double() sorts by it */
        int slice;
    } *const sorted = malloc((size_t)set->n * sizeof *sorted);
    int n_groups = 1;
    for (int i = 0; sorted && i < set->n; i++) {
        sorted[i].thickness_mm = set->items[i]->thickness_mm;
        sorted[i].slice = i;
    }
    if (sorted)
        qsort(sorted, (size_t)set->n, sizeof *sorted, cts_compare_double);
    const bool known = sorted && sorted[0].thickness_mm > 0;
    for (int k = 0; known && k < set->n; k++) {
        n_groups += k && sorted[k].thickness_mm > 1.1 * sorted[k - 1].thickness_mm;
        part[sorted[k].slice] = n_groups;
    }
    free(sorted);
    return known && n_groups > 1;
}

/* Rank of a slice among those at its position by ContentTime; false where two of one position have equal times. */
static bool label_content_order(const CtsSliceSet *set, double same_mm, double *part)
{
    for (int first = 0, end; first < set->n; first = end) {
        for (end = first + 1; end < set->n && cts_slice_same_place(set->items[end - 1], set->items[end], same_mm);)
            end++;
        for (int i = first; i < end; i++) {
            part[i] = 0;
            for (int k = first; k < end; k++) {
                if (set->items[i]->content_s < 0 || (k != i && set->items[k]->content_s == set->items[i]->content_s))
                    return false;
                part[i] += set->items[k]->content_s < set->items[i]->content_s;
            }
        }
    }
    return true;
}

/* part[i] for each slice by a criterion; false when it does not separate them. */
static bool label(const CtsSliceSet *set, int way, double same_mm, double *part)
{
    if (way == BY_KERNEL || way == BY_OBJECT)
        return label_texts(set, way, part);
    if (way == BY_THICKNESS)
        return label_thickness(set, part);
    if (way == BY_CONTENT_ORDER)
        return label_content_order(set, same_mm, part);
    for (int i = 0; i < set->n; i++) {
        const CtsSlice *s = set->items[i];
        const bool repeats = i > 0 && cts_slice_same_place(set->items[i - 1], s, same_mm);
        if (way < BY_THICKNESS || way == BY_CONTENT_TIME) {
            part[i] = acquisition_label(s, way);
            if (isnan(part[i]))
                return false;
        } else {
            part[i] = repeats ? part[i - 1] + 1 : 0;
            if (s->time_s < 0 || (repeats && !(s->time_s > set->items[i - 1]->time_s)))
                return false;
        }
    }
    return true;
}

static double time_of(const CtsSlice *s, int way)
{
    return way == BY_CONTENT_ORDER ? s->content_s : s->time_s;
}

/* Phases are consecutive: a later part begins after the earlier one has ended. */
static bool in_turn(const CtsSliceSet *parts, int n_parts, int way)
{
    double end = -1;
    for (int p = 0; p < n_parts; p++) {
        double first = INFINITY, last = -1;
        for (int i = 0; i < parts[p].n; i++) {
            first = fmin(first, time_of(parts[p].items[i], way));
            last = fmax(last, time_of(parts[p].items[i], way));
        }
        if (!(first > end))
            return false;
        end = last;
    }
    return true;
}

static void free_parts(CtsSliceSet **parts, int *n_parts)
{
    for (int p = 0; p < *n_parts; p++)
        free((*parts)[p].items);
    free(*parts);
    *parts = NULL;
    *n_parts = 0;
}

/* Distributes the slices by rising label to parts that do not own them; NULL where all have one label. labels: of
 * set->n values. */
static CtsStatus deal(const CtsSliceSet *set, const double *part, double *labels, CtsSliceSet **parts, int *n_parts,
                      CtsError *err)
{
    CtsSliceSet *const p = *parts = calloc((size_t)set->n, sizeof *p);
    bool made = p;
    *n_parts = 0;
    memcpy(labels, part, (size_t)set->n * sizeof *labels);
    qsort(labels, (size_t)set->n, sizeof *labels, cts_compare_double);
    for (int i = 0, n_same = 1; made && i < set->n; i++, n_same++) {
        if (i + 1 < set->n && labels[i + 1] == labels[i])
            continue;
        made = (p[*n_parts].items = malloc((size_t)n_same * sizeof *p->items));
        labels[(*n_parts)++] = labels[i];
        n_same = 0;
    }
    for (int i = 0; made && i < set->n; i++) {
        const double *const found = bsearch(&part[i], labels, (size_t)*n_parts, sizeof *labels, cts_compare_double);
        p[found - labels].items[p[found - labels].n++] = set->items[i];
    }
    if (!made || *n_parts < 2)
        free_parts(parts, n_parts);
    return made ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

/* True if slices of two parts alternate repeatedly: each part has more than one run along the stack. A single block
 * within another part is no alternation. runs: of n values. */
static bool takes_turns(const double *part, int n, double *runs)
{
    int n_runs = 0, n_turning = 0;
    for (int i = 0; i < n; i++)
        if (!i || part[i] != part[i - 1])
            runs[n_runs++] = part[i];
    qsort(runs, (size_t)n_runs, sizeof *runs, cts_compare_double);
    for (int i = 1; i < n_runs; i++)
        n_turning += runs[i] == runs[i - 1] && (i < 2 || runs[i] != runs[i - 2]);
    return n_turning > 1;
}

typedef enum Within { OUTSIDE, IN_A_GAP, IN_A_FILLED_GAP } Within;

/* The gap of `outer` that holds a slice of `inner`: a usual one, nearer to one gap than to two, as there none is
 * missing; filled if as narrow beside the thickness. */
static Within lies_within(const CtsSliceSet *inner, const CtsSliceSet *outer)
{
    CtsSliceStack stack;
    const CtsSlice *const reference = outer->items[0];
    Within within = OUTSIDE;
    cts_slice_stack_plan((const CtsSlice *const *)outer->items, outer->n, true, &stack, NULL);
    const double usual_mm = stack.spacing_mm;
    cts_slice_stack_free(&stack);
    for (int i = 1, k = 0; i < outer->n && within < IN_A_FILLED_GAP; i++) {
        const double low = cts_slice_stack_position_mm(reference, outer->items[i - 1]),
                     high = cts_slice_stack_position_mm(reference, outer->items[i]);
        while (k < inner->n && cts_slice_stack_position_mm(reference, inner->items[k]) < low)
            k++;
        if (high - low < 1.5 * usual_mm && k < inner->n &&
            cts_slice_stack_position_mm(reference, inner->items[k]) < high)
            within = high - low < 1.5 * outer->items[i]->thickness_mm ? IN_A_FILLED_GAP : IN_A_GAP;
    }
    return within;
}

/* True if two parts scan a range of positions both, unlike blocks of slices that follow each other: slices of each lie
 * in gaps of the other, or in gaps that the other's slices fill. */
static bool share_range(const CtsSliceSet *parts, int n_parts)
{
    for (int p = 0; p < n_parts; p++)
        for (int q = 0; q < p; q++) {
            const Within a = lies_within(&parts[p], &parts[q]), b = lies_within(&parts[q], &parts[p]);
            if ((a && b) || a == IN_A_FILLED_GAP || b == IN_A_FILLED_GAP)
                return true;
        }
    return false;
}

/* True if all parts share a range of positions, unlike ends of two scans that meet in a slice. */
static bool parts_overlap(const CtsSliceSet *parts, int n_parts)
{
    double begin = -INFINITY, finish = INFINITY;
    const CtsSlice *reference = parts[0].items[0];
    for (int p = 0; p < n_parts; p++) {
        begin = fmax(begin, cts_slice_stack_position_mm(reference, parts[p].items[0]));
        finish = fmin(finish, cts_slice_stack_position_mm(reference, parts[p].items[parts[p].n - 1]));
    }
    return begin < finish;
}

static bool all_whole(const CtsSliceSet *parts, int n_parts, double same_mm)
{
    for (int p = 0; p < n_parts; p++)
        if (!is_whole(&parts[p], same_mm))
            return false;
    return true;
}

/* True if thicknesses make volumes of their own, complete or not. In an even stack an attribute that varies without
 * order is wrong rather than the positions: it stays one volume. */
static bool thicknesses_part(const CtsSliceSet *set, const CtsSliceSet *parts, int n_parts, double same_mm)
{
    for (int p = 0; p < n_parts; p++)
        if (parts[p].n < 2)
            return false;
    return share_range(parts, n_parts) && (!is_whole(set, same_mm) || all_whole(parts, n_parts, same_mm));
}

static bool are_volumes(const CtsSliceSet *set, const CtsSliceSet *parts, int n_parts, int way, double same_mm)
{
    if (way == BY_THICKNESS)
        return thicknesses_part(set, parts, n_parts, same_mm);
    return n_parts > 0 && ((way != BY_TIME && way != BY_CONTENT_ORDER) || in_turn(parts, n_parts, way)) &&
           all_whole(parts, n_parts, same_mm) && (!ways[way].must_overlap || parts_overlap(parts, n_parts));
}

CtsStatus cts_slice_set_split(CtsSliceSet *set, double same_mm, CtsSliceSet **parts, int *n_parts, const char **by,
                              CtsError *err)
{
    CtsStatus st = CTS_OK;
    const bool repeats = cts_slice_set_repeats(set, same_mm);
    *n_parts = 0;
    *parts = NULL;
    *by = NULL;
    double *const part = malloc(2 * (size_t)set->n * sizeof *part), *const scratch = part ? part + set->n : NULL;
    if (!part)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int way = 0; !st && way < N_WAYS && *n_parts == 0; way++) {
        const bool tried = repeats ? way != BY_THICKNESS : ways[way].takes_turns;
        if (!tried || !label(set, way, same_mm, part) ||
            (!repeats && way != BY_THICKNESS && !takes_turns(part, set->n, scratch)) ||
            (st = deal(set, part, scratch, parts, n_parts, err)))
            continue;
        const bool fits = are_volumes(set, *parts, *n_parts, way, same_mm);
        if (fits || way != BY_THICKNESS)
            *by = fits || !repeats ? ways[way].name : NULL;
        if (!fits)
            free_parts(parts, n_parts);
    }
    if (*n_parts) {
        free(set->items);
        *set = (CtsSliceSet){0};
    }
    free(part);
    return st;
}
