/* Concatenations (PS3.3 C.7.6.16.2.2.4): one image of many frames, divided into several objects. */
#include "input/series/series_check.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/text.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NAMED = 8 }; /* missing parts that are listed individually, so that the message stays short */

static bool is_part(const CtsSlice *s)
{
    return s->n_frames && (*s->concatenation || s->part_number > 0 || s->n_parts > 0 || s->first_frame >= 0);
}

static int by_concatenation(const CtsSlice *x, const CtsSlice *y)
{
    const int order = strcmp(x->series_uid, y->series_uid);
    return order ? order : strcmp(x->concatenation, y->concatenation);
}

static int by_part(const void *a, const void *b)
{
    const CtsSlice *x = *(CtsSlice *const *)a, *y = *(CtsSlice *const *)b;
    int order = by_concatenation(x, y);
    order = order ? order : (x->first_frame > y->first_frame) - (x->first_frame < y->first_frame);
    order = order ? order : x->part_number - y->part_number;
    return order ? order : strcmp(x->path, y->path);
}

/* Room for a message about missing parts. */
enum { LACKS = 320 };

/* The numbers missing up to the total, or where it is not given up to the largest. */
static int name_numbers(CtsSlice *const *parts, size_t n, char lacks[LACKS])
{
    int total = 0, largest = 0, n_missing = 0;
    bool there[UINT16_MAX + 1] = {false};
    for (size_t i = 0; i < n; i++) {
        total = cts_larger_int(total, parts[i]->n_parts);
        largest = cts_larger_int(largest, parts[i]->part_number);
        there[parts[i]->part_number] = true;
    }
    const int last = largest ? cts_larger_int(largest, total) : 0;
    for (int number = 1; number <= last; number++)
        if (!there[number] && n_missing++ < MAX_NAMED)
            cts_text_append(lacks, LACKS, ", ", "%s%d", n_missing == 1 ? "part " : "", number);
    if (n_missing > MAX_NAMED)
        cts_text_append(lacks, LACKS, " ", "and %d more", n_missing - MAX_NAMED);
    if (n_missing && total)
        cts_text_append(lacks, LACKS, " ", "of %d", total);
    return n_missing;
}

/* Frames missing before parts, by the parts' offsets. *n_between: those with some before them. */
static int64_t name_frames(CtsSlice *const *parts, size_t n, char lacks[LACKS], int64_t *n_between)
{
    int64_t next = 0, n_missing = 0;
    int n_named = 0;
    *n_between = 0;
    for (size_t i = 0; i < n; i++) {
        const int64_t first = parts[i]->first_frame;
        if (first < 0)
            continue;
        if (first > next) {
            n_missing += first - next;
            *n_between += next ? first - next : 0;
            if (n_named++ < MAX_NAMED)
                cts_text_append(lacks, LACKS, ", ", "frames %" PRId64 " to %" PRId64, next + 1, first);
        }
        const int64_t end = first + parts[i]->n_frames;
        next = end > next ? end : next;
    }
    return n_missing;
}

static CtsStatus check_concatenation(CtsSlice *const *parts, size_t n, CtsSlice *const *slices, size_t n_slices,
                                     CtsStringPool *texts, CtsError *err)
{
    char text[LACKS] = "";
    int64_t n_between;
    const bool by_number = name_numbers(parts, n, text) > 0;
    if (name_frames(parts, n, text, &n_between) == 0 && !by_number)
        return CTS_OK;
    cts_text_append(text, LACKS, " ", "of a concatenation (%s) missing",
                    by_number ? "InConcatenationNumber (0020,9162)" : "ConcatenationFrameOffsetNumber (0020,9228)");
    const char *const lacks = cts_string_pool_add(texts, text, strlen(text));
    if (!lacks)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < n_slices; i++)
        if (is_part(slices[i]) && !by_concatenation(slices[i], parts[0])) {
            slices[i]->missing_parts = lacks;
            slices[i]->n_lacking = (int)(n_between < INT32_MAX / 16 ? n_between : INT32_MAX / 16);
        }
    return CTS_OK;
}

CtsStatus cts_concatenations_check(CtsSlice *const *slices, size_t n, CtsStringPool *texts, CtsError *err)
{
    size_t n_parts = 0;
    CtsSlice **parts = NULL;
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && i < n; i++)
        if (is_part(slices[i]) && slices[i]->frame == 0 && !(st = cts_grow(&parts, n_parts, err)))
            parts[n_parts++] = slices[i];
    if (n_parts)
        qsort(parts, n_parts, sizeof *parts, by_part);
    for (size_t first = 0, end; !st && first < n_parts; first = end) {
        for (end = first + 1; end < n_parts && !by_concatenation(parts[first], parts[end]);)
            end++;
        st = check_concatenation(parts + first, end - first, slices, n, texts, err);
    }
    free(parts);
    return st;
}
