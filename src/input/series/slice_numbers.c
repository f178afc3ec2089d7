#include "input/series/series_check.h"

#include "base/bytes.h"
#include "base/mem.h"
#include "input/series/slice_stack.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* True if the numbers of slices first <= i < end rise or fall monotonically. */
static bool is_in_order(const CtsSliceSet *set, int first, int end)
{
    int n_rising = 0, n_falling = 0;
    for (int i = first + 1; i < end; i++) {
        const int a = set->items[i - 1]->instance_number, b = set->items[i]->instance_number;
        n_rising += a < b;
        n_falling += a > b;
    }
    return !n_rising || !n_falling;
}

/* The slice after the last of those that share i's acquisition. */
static int acquisition_end(const CtsSliceSet *set, int i)
{
    int end = i + 1;
    while (end < set->n && set->items[end]->volume_number[CTS_ACQUISITION_NUMBER] ==
                               set->items[i]->volume_number[CTS_ACQUISITION_NUMBER])
        end++;
    return end;
}

bool cts_slice_set_in_order(const CtsSliceSet *set)
{
    if (is_in_order(set, 0, set->n))
        return true;
    for (int i = 0, end; i < set->n; i = end)
        if ((end = acquisition_end(set, i)) < i + 3 || !is_in_order(set, i, end))
            return false;
    return true;
}

/* FNV-1a of the UID, then the number. */
static uint64_t key_of(const char *study_uid, int number)
{
    return cts_fnv(cts_fnv(CTS_FNV, study_uid, strlen(study_uid)), &number, sizeof number);
}

static int by_key(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

CtsStatus cts_study_numbers_add(CtsStudyNumbers *numbers, const char *study_uid, int number, CtsError *err)
{
    const CtsStatus st = cts_grow(&numbers->keys, numbers->n, err);
    if (!st)
        numbers->keys[numbers->n++] = key_of(study_uid, number);
    return st;
}

void cts_study_numbers_sort(CtsStudyNumbers *numbers)
{
    if (numbers->n)
        qsort(numbers->keys, numbers->n, sizeof *numbers->keys, by_key);
}

bool cts_study_numbers_have(const CtsStudyNumbers *numbers, const char *study_uid, int number)
{
    const uint64_t key = key_of(study_uid, number);
    return numbers->n && bsearch(&key, numbers->keys, numbers->n, sizeof *numbers->keys, by_key);
}

void cts_study_numbers_free(CtsStudyNumbers *numbers)
{
    free(numbers->keys);
    *numbers = (CtsStudyNumbers){0};
}

/* THIN_SHARE: largest share of its gap that a slice's thickness has where slices are missing: half where every second
 * one is, all where none is. MAX_STEPS: a step larger than the largest number of slices counts as none. */
#define THIN_SHARE 0.6
enum { MAX_STEPS = 20000 };

/* True for lengths that differ by up to a quarter of the larger one; lengths of 2 and 3 slices differ by a third. */
static bool is_near(double a_mm, double b_mm)
{
    return fabs(a_mm - b_mm) <= 0.25 * fmax(a_mm, b_mm) + 1e-6;
}

static double gap_mm(const CtsSliceSet *set, int i)
{
    return cts_slice_stack_position_mm(set->items[0], set->items[i + 1]) -
           cts_slice_stack_position_mm(set->items[0], set->items[i]);
}

/* Step of the instance number over gap i if the gap may hold missing slices; else 0. */
static int64_t step_over(const CtsSliceSet *set, int i, double smallest_mm, double *thickness_mm)
{
    const CtsSlice *a = set->items[i], *b = set->items[i + 1];
    const double gap = gap_mm(set, i);
    *thickness_mm = fmax(a->thickness_mm, b->thickness_mm);
    if (!a->has_instance || !b->has_instance || !(*thickness_mm > 0) || *thickness_mm > THIN_SHARE * gap)
        return 0;
    const int64_t step = llabs((int64_t)b->instance_number - a->instance_number);
    if (step < 2 || step > MAX_STEPS)
        return 0;
    const double each_mm = gap / (double)step;
    return is_near(each_mm, *thickness_mm) || is_near(each_mm, smallest_mm) ? step : 0;
}

/* The number of instance numbers skipped at gap i that other objects have. */
static int64_t count_other_numbers(const CtsSliceSet *set, int i, const CtsStudyNumbers *numbers)
{
    const CtsSlice *a = set->items[i], *b = set->items[i + 1];
    const int low = a->instance_number < b->instance_number ? a->instance_number : b->instance_number,
              high = a->instance_number < b->instance_number ? b->instance_number : a->instance_number;
    int64_t n = 0;
    for (int number = low + 1; number < high && !a->n_frames; number++) /* frames are numbered within their object */
        n += cts_study_numbers_have(numbers, a->identity[CTS_STUDY_UID], number);
    return n;
}

CtsMissingSlices cts_slice_set_missing(const CtsSliceSet *set, const CtsStudyNumbers *numbers)
{
    CtsMissingSlices missing = {.first = -1};
    double smallest_mm = INFINITY, thickness_mm;
    int64_t n = 0, n_others = 0, n_asked = 0;
    if (set->n < 2 || !cts_slice_set_in_order(set))
        return missing;
    for (int i = 0; i + 1 < set->n; i++)
        smallest_mm = fmin(smallest_mm, gap_mm(set, i));
    for (int i = 0; i + 1 < set->n; i++) {
        const int64_t step = step_over(set, i, smallest_mm, &thickness_mm);
        if (step && missing.first < 0) {
            missing.first = i;
            missing.every = i == 0 ? (int)step : 0;
            missing.gap_mm = gap_mm(set, i);
            missing.thickness_mm = thickness_mm;
        }
        if (step != missing.every)
            missing.every = 0;
        n += step ? step - 1 : 0;
        if (step && n_asked < MAX_STEPS) {
            n_others += count_other_numbers(set, i, numbers);
            n_asked = n;
        }
    }
    missing.n = 2 * n_others > n_asked ? 0 : (int)n; /* a series has at most 20000 slices: it fits */
    return missing;
}
