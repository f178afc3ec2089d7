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

/* Kernels are numbered in the order of the slices; false where one is missing, or there are too many. */
static bool label_kernels(const CtsSliceSet *set, double *part)
{
    const char *kernels[CTS_MAX_PARTS];
    int n = 0, k;
    for (int i = 0; i < set->n; i++) {
        const char *kernel = set->items[i]->kernel;
        if (!kernel || !*kernel)
            return false;
        for (k = 0; k < n && strcmp(kernels[k], kernel) != 0;)
            k++;
        if (k == CTS_MAX_PARTS)
            return false;
        if (k == n)
            kernels[n++] = kernel;
        part[i] = k;
    }
    return true;
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
    if (way == BY_KERNEL)
        return label_kernels(set, part);
    if (way == BY_CONTENT_ORDER)
        return label_content_order(set, same_mm, part);
    for (int i = 0; i < set->n; i++) {
        const CtsSlice *s = set->items[i];
        const bool repeats = i > 0 && cts_slice_same_place(set->items[i - 1], s, same_mm);
        if (way < BY_KERNEL || way == BY_CONTENT_TIME) {
            part[i] = acquisition_label(s, way);
            if (isnan(part[i]))
                return false;
        } else if (way == BY_OBJECT) {
            if (!s->n_frames)
                return false;
            part[i] = i;
            for (int j = 0; j < i && part[i] == i; j++)
                if (strcmp(set->items[j]->path, s->path) == 0)
                    part[i] = part[j];
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

/* Distributes the slices by rising label to parts that do not own them. *n_parts is 0 when there are too many. */
static CtsStatus deal(const CtsSliceSet *set, const double *part, CtsSliceSet *parts, int max_parts, int *n_parts,
                      CtsError *err)
{
    *n_parts = 0;
    int n_labels = 0;
    double *labels = malloc((size_t)set->n * sizeof *labels);
    if (!labels)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    memcpy(labels, part, (size_t)set->n * sizeof *labels);
    qsort(labels, (size_t)set->n, sizeof *labels, cts_compare_double);
    for (int i = 0; i < set->n; i++)
        if (i == 0 || labels[i] != labels[i - 1])
            labels[n_labels++] = labels[i];
    if (n_labels >= 2 && n_labels <= max_parts) {
        for (int p = 0; p < n_labels; p++) {
            parts[p] = (CtsSliceSet){.items = malloc((size_t)set->n * sizeof *parts[p].items)};
            ++*n_parts;
            for (int i = 0; parts[p].items && i < set->n; i++)
                if (part[i] == labels[p])
                    parts[p].items[parts[p].n++] = set->items[i];
        }
    }
    free(labels);
    return CTS_OK;
}

static void free_parts(CtsSliceSet *parts, int *n_parts)
{
    for (int p = 0; p < *n_parts; p++)
        free(parts[p].items);
    *n_parts = 0;
}

/* True if slices of two parts alternate repeatedly: each part has more than one run along the stack. A single block
 * within another part is no alternation. */
static bool takes_turns(const CtsSliceSet *set, const CtsSliceSet *parts, int n_parts)
{
    int n_turning = 0;
    for (int p = 0; p < n_parts; p++) {
        int n_runs = 0, next = 0; /* position in the part */
        for (int i = 0, within = 0; i < set->n; i++) {
            const int is_here = next < parts[p].n && parts[p].items[next] == set->items[i];
            n_runs += is_here && !within;
            next += is_here;
            within = is_here;
        }
        n_turning += n_runs > 1;
    }
    return n_turning > 1;
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

CtsStatus cts_slice_set_split(CtsSliceSet *set, double same_mm, CtsSliceSet *parts, int max_parts, int *n_parts,
                              const char **by, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const bool repeats = cts_slice_set_repeats(set, same_mm);
    *n_parts = 0;
    *by = NULL;
    double *part = malloc((size_t)set->n * sizeof *part);
    if (!part)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int way = 0; !st && way < N_WAYS && *n_parts == 0; way++) {
        if ((!repeats && !ways[way].takes_turns) || !label(set, way, same_mm, part) ||
            (st = deal(set, part, parts, max_parts, n_parts, err)))
            continue;
        if (!repeats && !takes_turns(set, parts, *n_parts)) {
            free_parts(parts, n_parts);
            continue;
        }
        *by = repeats ? NULL : ways[way].name;
        bool whole = *n_parts > 0 && ((way != BY_TIME && way != BY_CONTENT_ORDER) || in_turn(parts, *n_parts, way));
        for (int p = 0; whole && p < *n_parts; p++)
            whole = is_whole(&parts[p], same_mm);
        whole &= !whole || !ways[way].must_overlap || parts_overlap(parts, *n_parts);
        if (whole)
            *by = ways[way].name;
        else
            free_parts(parts, n_parts);
    }
    if (*n_parts) {
        free(set->items);
        *set = (CtsSliceSet){0};
    }
    free(part);
    return st;
}
