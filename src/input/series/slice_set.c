#include "input/series/series_check.h"

#include "base/compare.h"
#include "base/mem.h"
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

static double or_zero(double number)
{
    return isnan(number) ? 0 : number;
}

static int by_position(const void *a, const void *b, void *reference)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    static const CtsVolumeNumber numbers[] = {CTS_ACQUISITION_NUMBER, CTS_TEMPORAL_POSITION, CTS_ACQUISITION_TIME};
    double p = cts_slice_stack_position_mm(reference, x), q = cts_slice_stack_position_mm(reference, y);
    for (int i = 0; p == q && i < 3; i++) {
        p = or_zero(x->volume_number[numbers[i]]);
        q = or_zero(y->volume_number[numbers[i]]);
    }
    int order = p == q ? cts_compare_int(&x->instance_number, &y->instance_number) : cts_compare_double(&p, &q);
    order = order ? order : strcmp(x->path, y->path);
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

/* True if a part is complete: its slices form an even stack. may_repeat: several of them may lie at each position. */
static bool is_whole(const CtsSliceSet *part, bool may_repeat, double same_mm)
{
    const CtsSlice **places = malloc((size_t)part->n * sizeof *places);
    CtsSliceStack stack = {.layer = NULL};
    int n = 0;
    for (int i = 0; places && i < part->n; i++)
        if (!n || !cts_slice_same_place(places[n - 1], part->items[i], same_mm))
            places[n++] = part->items[i];
    const bool whole = n > 1 && (n == part->n || may_repeat) && !cts_slice_stack_plan(places, n, false, &stack, NULL) &&
                       stack.kind == CTS_STACK_EVEN;
    cts_slice_stack_free(&stack);
    free(places);
    return whole;
}

static bool all_whole(const CtsSliceSet *parts, int n_parts, bool may_repeat, double same_mm)
{
    for (int p = 0; p < n_parts; p++)
        if (!is_whole(&parts[p], may_repeat, same_mm))
            return false;
    return true;
}

/* Criteria: the volumes' numbers (CtsVolumeNumber) and words (CtsVolumeWord), and others. */
enum {
    BY_WORD = CTS_N_VOLUME_NUMBERS,
    BY_TRIGGER_ORDER = BY_WORD + CTS_N_VOLUME_WORDS, /* one for each slice, later in each phase */
    BY_CONTENT_ORDER,                                /* the same */
    BY_TIME,                                         /* the same, of AcquisitionTime */
    BY_NUMBER,                                       /* the same, of InstanceNumber */
    BY_THICKNESS,
    BY_KERNEL,
    BY_OBJECT,
    N_WAYS
};

enum { IN_CT = 1 << CTS_MODALITY_CT, IN_MR = 1 << CTS_MODALITY_MR, IN_PET = 1 << CTS_MODALITY_PT };

static const struct {
    const char *name;
    unsigned turns;        /* bits of the modalities where slices of two values may lie between each other */
    bool must_overlap;     /* its values may also change within one scan, so parts must overlap */
    CtsVolumeNumber ranks; /* of an order: the time by which the slices at one position rank */
} ways[N_WAYS] = {
    [CTS_ACQUISITION_NUMBER] = {"AcquisitionNumber (0020,0012)", IN_CT, false, 0},
    [CTS_VOLTAGE] = {"KVP (0018,0060)", IN_CT, false, 0},
    [CTS_TEMPORAL_POSITION] = {"TemporalPositionIdentifier (0020,0100)", IN_CT | IN_MR | IN_PET, false, 0},
    [CTS_TRIGGER_TIME] = {"TriggerTime (0018,1060)", IN_CT, false, 0},
    [BY_TRIGGER_ORDER] = {"TriggerTime (0018,1060)", 0, true, CTS_TRIGGER_TIME},
    [CTS_PHASE_PERCENT] = {"NominalPercentageOfCardiacPhase (0020,9241)", 0, true, 0},
    [CTS_PHASE_DELAY] = {"NominalCardiacTriggerDelayTime (0020,9153)", 0, true, 0},
    [BY_THICKNESS] = {"SliceThickness (0018,0050)", IN_CT, false, 0},
    [BY_KERNEL] = {"ConvolutionKernel (0018,1210)", IN_CT, true, 0},
    [CTS_CONTENT_TIME] = {"ContentTime (0008,0033)", 0, true, 0},
    [BY_CONTENT_ORDER] = {"ContentTime (0008,0033)", 0, true, CTS_CONTENT_TIME},
    [BY_OBJECT] = {"SOPInstanceUID (0008,0018)", 0, false, 0},
    [BY_TIME] = {"AcquisitionTime (0008,0032)", 0, false, CTS_ACQUISITION_TIME},
    [BY_NUMBER] = {"InstanceNumber (0020,0013)", 0, false, 0},
    [CTS_ECHO_NUMBER] = {"EchoNumbers (0018,0086)", IN_MR, false, 0},
    [CTS_ECHO_TIME] = {"EchoTime (0018,0081)", IN_MR, false, 0},
    [CTS_INVERSION_TIME] = {"InversionTime (0018,0082)", 0, false, 0},
    [CTS_FLIP_ANGLE] = {"FlipAngle (0018,1314)", 0, false, 0},
    [CTS_B_VALUE] = {"DiffusionBValue (0018,9087)", IN_MR, false, 0},
    [CTS_FRAME_REFERENCE_TIME] = {"FrameReferenceTime (0054,1300)", IN_PET, false, 0},
    [CTS_TIME_SLICE] = {"ImageIndex (0054,1330)", 0, false, 0},
    [BY_WORD + CTS_GRADIENT_DIRECTION] = {"DiffusionGradientOrientation (0018,9089)", 0, false, 0},
    [BY_WORD + CTS_IMAGE_TYPE] = {"ImageType (0008,0008)", IN_MR, false, 0},
    [BY_WORD + CTS_COMPLEX_COMPONENT] = {"ComplexImageComponent (0008,9208)", IN_MR, false, 0},
};

/* The criteria of a modality in order; an MR or PET series may need several of them, one within the other. */
static const struct {
    int n;
    signed char ways[N_WAYS];
} orders[CTS_N_MODALITIES] = {
    [CTS_MODALITY_CT] = {12,
                         {CTS_ACQUISITION_NUMBER, CTS_VOLTAGE, CTS_TEMPORAL_POSITION, CTS_TRIGGER_TIME,
                          CTS_PHASE_PERCENT, CTS_PHASE_DELAY, BY_THICKNESS, BY_KERNEL, BY_OBJECT, BY_TIME,
                          CTS_CONTENT_TIME, BY_CONTENT_ORDER}},
    [CTS_MODALITY_MR] = {19,
                         {CTS_ECHO_NUMBER, CTS_ECHO_TIME, CTS_INVERSION_TIME, CTS_FLIP_ANGLE, CTS_B_VALUE,
                          BY_WORD + CTS_GRADIENT_DIRECTION, CTS_TEMPORAL_POSITION, CTS_TRIGGER_TIME, BY_TRIGGER_ORDER,
                          BY_WORD + CTS_IMAGE_TYPE, BY_WORD + CTS_COMPLEX_COMPONENT, CTS_ACQUISITION_NUMBER,
                          CTS_PHASE_PERCENT, CTS_PHASE_DELAY, BY_OBJECT, BY_TIME, CTS_CONTENT_TIME, BY_CONTENT_ORDER,
                          BY_NUMBER}},
    [CTS_MODALITY_PT] = {6,
                         {CTS_FRAME_REFERENCE_TIME, CTS_TIME_SLICE, CTS_TEMPORAL_POSITION, CTS_PHASE_PERCENT,
                          CTS_PHASE_DELAY, BY_OBJECT}},
};

/* The text of a criterion; NULL for an object that is no frame. */
static const char *text_label(const CtsSlice *s, int way)
{
    if (way == BY_OBJECT)
        return s->n_frames ? s->path : NULL;
    return way == BY_KERNEL ? s->kernel : s->volume_word[way - BY_WORD];
}

/* Number of the first slice with the same text: a word, the kernel or the object (file); false where one of the latter
 * two is missing. */
static bool label_texts(const CtsSliceSet *set, int way, double *part)
{
    for (int i = 0; i < set->n; i++) {
        const char *const text = text_label(set->items[i], way);
        if (!text || (way >= BY_TRIGGER_ORDER && !*text))
            return false;
        part[i] = i;
        for (int k = 0; k < i && part[i] == i; k++)
            if (part[k] == k && !strcmp(text_label(set->items[k], way), text))
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

/* The number that orders the slices at one position; NAN where a slice has none. */
static double order_number(const CtsSlice *s, int way)
{
    return way != BY_NUMBER  ? s->volume_number[ways[way].ranks]
           : s->n_frames     ? s->frame
           : s->has_instance ? (double)s->instance_number
                             : NAN;
}

/* Rank of a slice among those at its position by a number; false where two of one position have equal ones. */
static bool label_order(const CtsSliceSet *set, int way, double same_mm, double *part)
{
    for (int first = 0, end; first < set->n; first = end) {
        for (end = first + 1; end < set->n && cts_slice_same_place(set->items[end - 1], set->items[end], same_mm);)
            end++;
        for (int i = first; i < end; i++) {
            const double own = order_number(set->items[i], way);
            part[i] = 0;
            for (int k = first; k < end; k++) {
                const double other = order_number(set->items[k], way);
                if (isnan(own) || (k != i && other == own))
                    return false;
                part[i] += other < own;
            }
        }
    }
    return true;
}

/* part[i] for each slice by a criterion; false when it does not separate them. Of MR, images without diffusion
 * gradients have no direction; numbers that CT have, too, every slice has. */
static bool label(const CtsSliceSet *set, int way, double same_mm, double *part)
{
    if (way == BY_THICKNESS)
        return label_thickness(set, part);
    if (way >= BY_TRIGGER_ORDER && way <= BY_NUMBER)
        return label_order(set, way, same_mm, part);
    if (way >= BY_WORD)
        return label_texts(set, way, part);
    for (int i = 0; i < set->n; i++) {
        part[i] = set->items[i]->volume_number[way];
        if (isnan(part[i]) && way < CTS_ECHO_NUMBER)
            return false;
        part[i] = isnan(part[i]) ? -INFINITY : part[i];
    }
    return true;
}

/* Phases are consecutive: a later part begins after the earlier one has ended. */
static bool in_turn(const CtsSliceSet *parts, int n_parts, CtsVolumeNumber time)
{
    double end = -1;
    for (int p = 0; p < n_parts; p++) {
        double first = INFINITY, last = -1;
        for (int i = 0; i < parts[p].n; i++) {
            first = fmin(first, parts[p].items[i]->volume_number[time]);
            last = fmax(last, parts[p].items[i]->volume_number[time]);
        }
        if (!(first > end))
            return false;
        end = last;
    }
    return true;
}

/* True if the numbers of each part are those of the first, shifted: volume after volume, or position after position.
 * GE's series in time and Philips' diffusion of old have no other mark that is public. */
static bool numbered_alike(const CtsSliceSet *parts, int n_parts)
{
    for (int p = 1; p < n_parts; p++)
        for (int i = 0; i < parts[p].n; i++)
            if (parts[p].n != parts[0].n ||
                order_number(parts[p].items[i], BY_NUMBER) - order_number(parts[p].items[0], BY_NUMBER) !=
                    order_number(parts[0].items[i], BY_NUMBER) - order_number(parts[0].items[0], BY_NUMBER))
                return false;
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
    CtsSliceSet *const s = *parts = calloc((size_t)set->n, sizeof *s);
    bool made = s;
    *n_parts = 0;
    memcpy(labels, part, (size_t)set->n * sizeof *labels);
    qsort(labels, (size_t)set->n, sizeof *labels, cts_compare_double);
    for (int i = 0, n_same = 1; made && i < set->n; i++, n_same++) {
        if (i + 1 < set->n && labels[i + 1] == labels[i])
            continue;
        made = (s[*n_parts].items = malloc((size_t)n_same * sizeof *s->items));
        labels[(*n_parts)++] = labels[i];
        n_same = 0;
    }
    for (int i = 0; made && i < set->n; i++) {
        const double *const found = bsearch(&part[i], labels, (size_t)*n_parts, sizeof *labels, cts_compare_double);
        s[found - labels].items[s[found - labels].n++] = set->items[i];
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

/* True if thicknesses make volumes of their own, complete or not. In an even stack an attribute that varies without
 * order is wrong rather than the positions: it stays one volume. */
static bool thicknesses_part(const CtsSliceSet *set, const CtsSliceSet *parts, int n_parts, double same_mm)
{
    for (int p = 0; p < n_parts; p++)
        if (parts[p].n < 2)
            return false;
    return share_range(parts, n_parts) && (!is_whole(set, false, same_mm) || all_whole(parts, n_parts, false, same_mm));
}

/* True if each part is a volume, or of MR and PET several volumes at the same positions. */
static bool are_volumes(const CtsSliceSet *set, const CtsSliceSet *parts, int n_parts, int way, double same_mm)
{
    if (way == BY_THICKNESS)
        return thicknesses_part(set, parts, n_parts, same_mm);
    const bool follow = way == BY_TIME || way == BY_CONTENT_ORDER;
    return n_parts > 0 && all_whole(parts, n_parts, set->items[0]->modality_id != CTS_MODALITY_CT, same_mm) &&
           (!follow || in_turn(parts, n_parts, ways[way].ranks)) &&
           (way != BY_NUMBER || numbered_alike(parts, n_parts)) &&
           (!ways[way].must_overlap || parts_overlap(parts, n_parts));
}

/* Volumes that a set was split into. */
typedef struct Split {
    double same_mm;
    CtsSliceSet *parts;
    int n_parts;
    const char *by;
} Split;

static CtsStatus split_volumes(Split *to, const CtsSliceSet *set, int first_way, CtsError *err);

/* Adds one part of a criterion, which moves, or its own parts where its positions repeat; *added is false if it has
 * none. */
static CtsStatus add_part(Split *to, CtsSliceSet *part, int next_way, bool *added, CtsError *err)
{
    const int before = to->n_parts;
    CtsStatus st;
    if (cts_slice_set_repeats(part, to->same_mm)) {
        st = split_volumes(to, part, next_way, err);
    } else if (!(st = cts_grow(&to->parts, (size_t)to->n_parts, err))) {
        to->parts[to->n_parts++] = *part;
        *part = (CtsSliceSet){0};
    }
    *added = to->n_parts > before;
    return st;
}

/* Adds the parts of a set by the first criterion that gives volumes; none without such. */
static CtsStatus split_volumes(Split *to, const CtsSliceSet *set, int first_way, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsModality modality = set->items[0]->modality_id;
    const bool repeats = cts_slice_set_repeats(set, to->same_mm);
    const int before = to->n_parts;
    double *const part = malloc(2 * (size_t)set->n * sizeof *part), *const scratch = part ? part + set->n : NULL;
    if (!part)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int k = first_way; !st && k < orders[modality].n && to->n_parts == before; k++) {
        const int way = orders[modality].ways[k];
        const bool tried = repeats ? way != BY_THICKNESS : ways[way].turns & 1 << modality;
        CtsSliceSet *parts = NULL;
        int n_parts = 0;
        if (!tried || !label(set, way, to->same_mm, part) ||
            (!repeats && way != BY_THICKNESS && !takes_turns(part, set->n, scratch)) ||
            (st = deal(set, part, scratch, &parts, &n_parts, err)))
            continue;
        bool done = are_volumes(set, parts, n_parts, way, to->same_mm);
        for (int p = 0; !st && done && p < n_parts; p++)
            st = add_part(to, &parts[p], k + 1, &done, err);
        while (!done && to->n_parts > before)
            free(to->parts[--to->n_parts].items);
        if (!first_way && (done || way != BY_THICKNESS))
            to->by = done || !repeats ? ways[way].name : NULL;
        free_parts(&parts, &n_parts);
    }
    free(part);
    return st;
}

CtsStatus cts_slice_set_split(CtsSliceSet *set, double same_mm, CtsSliceSet **parts, int *n_parts, const char **by,
                              CtsError *err)
{
    Split to = {.same_mm = same_mm};
    const CtsModality modality = set->items[0]->modality_id;
    const bool is_static = modality == CTS_MODALITY_PT && !set->items[0]->pet.is_dynamic;
    CtsStatus st = CTS_OK;
    if (!is_static || !cts_slice_set_repeats(set, same_mm))
        st = split_volumes(&to, set, 0, err);
    if (st)
        free_parts(&to.parts, &to.n_parts);
    *parts = to.parts;
    *n_parts = to.n_parts;
    *by = to.by;
    if (*n_parts) {
        free(set->items);
        *set = (CtsSliceSet){0};
    }
    return st;
}
