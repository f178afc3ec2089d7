
#include "base/vec3.h"
#include "input/series/series_check.h"
#include "input/series/slice_stack.h"
#include <stdlib.h>
#include <string.h>

/* FEWEST: two slices always lie evenly. MAX_GRIDS: bounds the time, which grows with slices times grids; a study has
 * few. */
enum { FEWEST = 3, MAX_GRIDS = 64 };

bool cts_slice_place(const CtsSlice *slice, CtsSlicePlace *place)
{
    if (slice->fault || slice->localizer || slice->is_report || slice->n_frames || slice->kind != CTS_OBJECT_SLICE)
        return false;
    *place = (CtsSlicePlace){.rows = slice->rows,
                             .columns = slice->columns,
                             .series_number = slice->series_number,
                             .row_spacing_mm = slice->row_spacing_mm,
                             .column_spacing_mm = slice->column_spacing_mm};
    memcpy(place->row_lps, slice->row_lps, sizeof place->row_lps);
    memcpy(place->column_lps, slice->column_lps, sizeof place->column_lps);
    memcpy(place->position_lps, slice->position_lps, sizeof place->position_lps);
    return true;
}

static CtsSlice slice_of_place(const CtsSlicePlace *place)
{
    CtsSlice slice = {.rows = place->rows,
                      .columns = place->columns,
                      .series_number = place->series_number,
                      .row_spacing_mm = place->row_spacing_mm,
                      .column_spacing_mm = place->column_spacing_mm};
    memcpy(slice.row_lps, place->row_lps, sizeof slice.row_lps);
    memcpy(slice.column_lps, place->column_lps, sizeof slice.column_lps);
    memcpy(slice.position_lps, place->position_lps, sizeof slice.position_lps);
    cts_cross3(slice.row_lps, slice.column_lps, slice.normal_lps);
    return slice;
}

/* A slice of a grid. */
typedef struct Member {
    const CtsSlice *slice;
    int number;         /* its SeriesNumber, or 0 where that does not matter */
    double position_mm; /* along the normal of the grid's first slice */
    size_t place;
} Member;

typedef struct Stacking {
    CtsSlice *slices;
    const CtsSlice **line; /* of the members tried */
    Member *members;
    bool *taken;
    int *stack, n_stacks;
} Stacking;

static int by_number_and_position(const void *a, const void *b)
{
    const Member *x = a, *y = b;
    if (x->number != y->number)
        return x->number < y->number ? -1 : 1;
    if (x->position_mm != y->position_mm)
        return x->position_mm < y->position_mm ? -1 : 1;
    return (x->place > y->place) - (x->place < y->place);
}

/* Sorted members become a stack where a series of them would be one, with at most a tenth missing. */
static CtsStatus try_stack(Stacking *s, const Member *members, size_t n, bool *found, CtsError *err)
{
    CtsSliceStack stack;
    CtsError why;
    *found = false;
    if (n < FEWEST)
        return CTS_OK;
    for (size_t i = 0; i < n; i++)
        s->line[i] = members[i].slice;
    const CtsStatus st = cts_slice_stack_plan(s->line, (int)n, false, &stack, &why);
    *found = !st && stack.kind != CTS_STACK_UNEQUAL;
    cts_slice_stack_free(&stack);
    if (st == CTS_ERR_MEMORY)
        return cts_fail(err, st, "%s", why.text);
    s->n_stacks += *found;
    for (size_t i = 0; *found && i < n; i++)
        s->stack[members[i].place] = s->n_stacks;
    return CTS_OK;
}

/* All slices of a grid together, or, where several scans were split up, those of each SeriesNumber. */
static CtsStatus try_grid(Stacking *s, size_t n, CtsError *err)
{
    bool found;
    qsort(s->members, n, sizeof *s->members, by_number_and_position);
    CtsStatus st = try_stack(s, s->members, n, &found, err);
    if (st || found)
        return st;
    for (size_t i = 0; i < n; i++)
        s->members[i].number = s->members[i].slice->series_number;
    qsort(s->members, n, sizeof *s->members, by_number_and_position);
    for (size_t first = 0, end; first < n && !st; first = end) {
        for (end = first + 1; end < n && s->members[end].number == s->members[first].number;)
            end++;
        if (end - first < n)
            st = try_stack(s, s->members + first, end - first, &found, err);
    }
    return st;
}

CtsStatus cts_single_slices_find(const CtsSlicePlace *places, size_t n, int *stack, int *n_stacks, CtsError *err)
{
    memset(stack, 0, n * sizeof *stack);
    *n_stacks = 0;
    if (n < FEWEST)
        return CTS_OK;
    Stacking s = {.slices = calloc(n, sizeof *s.slices),
                  .line = calloc(n, sizeof *s.line),
                  .members = calloc(n, sizeof *s.members),
                  .taken = calloc(n, sizeof *s.taken),
                  .stack = stack};
    CtsStatus st = s.slices && s.line && s.members && s.taken ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < n && !st; i++)
        s.slices[i] = slice_of_place(&places[i]);
    for (size_t first = 0, n_grids = 0; first < n && n_grids < MAX_GRIDS && !st; first++) {
        size_t n_members = 0;
        for (size_t i = first; i < n && !s.taken[first]; i++)
            if (!s.taken[i] && cts_slice_same_grid(&s.slices[i], &s.slices[first]))
                s.members[n_members++] =
                    (Member){&s.slices[i], 0, cts_slice_stack_position_mm(&s.slices[first], &s.slices[i]), i};
        for (size_t i = 0; i < n_members; i++)
            s.taken[s.members[i].place] = true;
        n_grids += n_members > 0;
        if (n_members >= FEWEST)
            st = try_grid(&s, n_members, err);
    }
    *n_stacks = s.n_stacks;
    free(s.slices);
    free(s.line);
    free(s.members);
    free(s.taken);
    return st;
}

static int by_study_and_uid(const void *a, const void *b)
{
    const CtsSeries *x = *(const CtsSeries *const *)a, *y = *(const CtsSeries *const *)b;
    const int order = strcmp(x->study_uid, y->study_uid);
    return order ? order : strcmp(x->uid, y->uid);
}

/* Series of single slices, n of one study. places, stack: room for n. */
static CtsStatus report_study(CtsSeriesList *list, const CtsSeries *const *singles, size_t n, CtsSlicePlace *places,
                              int *stack, CtsError *err)
{
    int n_stacks = 0;
    for (size_t i = 0; i < n; i++)
        cts_slice_place(singles[i]->slices[0], &places[i]);
    const CtsStatus st = cts_single_slices_find(places, n, stack, &n_stacks, err);
    for (int k = 1; k <= n_stacks && !st; k++) {
        const CtsSeries *first = NULL;
        int n_slices = 0;
        for (size_t i = 0; i < n; i++) {
            first = !first && stack[i] == k ? singles[i] : first;
            n_slices += stack[i] == k;
        }
        if (first)
            cts_diagnostics_add(&list->diagnostics, CTS_DIAGNOSTIC_SINGLE_SLICES, CTS_SINGLE_SLICES_TEXT, first->uid,
                                n_slices - 1, n_slices);
    }
    return st;
}

CtsStatus cts_single_slices_report(CtsSeriesList *list, CtsError *err)
{
    size_t n = 0;
    const CtsSeries **singles = malloc((list->n + 1) * sizeof *singles);
    CtsSlicePlace *places = malloc((list->n + 1) * sizeof *places);
    int *stack = malloc((list->n + 1) * sizeof *stack);
    CtsStatus st = singles && places && stack ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < list->n && !st; i++) {
        const CtsSeries *const s = &list->items[i];
        if (s->n_slices == 1 && s->part == 0 && s->uid[0] && s->study_uid[0] && cts_slice_place(s->slices[0], places))
            singles[n++] = s;
    }
    if (n)
        qsort(singles, n, sizeof *singles, by_study_and_uid);
    for (size_t first = 0, end; first < n && !st; first = end) {
        for (end = first + 1; end < n && !strcmp(singles[end]->study_uid, singles[first]->study_uid);)
            end++;
        st = report_study(list, singles + first, end - first, places, stack, err);
    }
    free(singles);
    free(places);
    free(stack);
    return st;
}
