/* Concatenations (PS3.3 C.7.6.16.2.2.4): one image of many frames, divided into several objects. */
#include "input/series/series_check.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
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
    if (!order)
        order = (x->first_frame > y->first_frame) - (x->first_frame < y->first_frame);
    if (!order)
        order = x->part_number - y->part_number;
    return order ? order : strcmp(x->path, y->path);
}

typedef struct Text {
    char *at;
    size_t left;
} Text;

static void __attribute__((format(printf, 2, 3))) append(Text *text, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    const int n = vsnprintf(text->at, text->left, format, args);
    va_end(args);
    const size_t written = n < 0 ? 0 : (size_t)n < text->left ? (size_t)n : text->left - 1;
    text->at += written;
    text->left -= written;
}

/* The numbers missing up to the total, or where it is not given up to the largest. */
static int name_numbers(CtsSlice *const *parts, size_t n, Text *text)
{
    int total = 0, largest = 0, n_missing = 0;
    uint8_t *there = calloc(UINT16_MAX + 1, 1);
    for (size_t i = 0; there && i < n; i++) {
        total = parts[i]->n_parts > total ? parts[i]->n_parts : total;
        largest = parts[i]->part_number > largest ? parts[i]->part_number : largest;
        there[parts[i]->part_number] = 1;
    }
    const int last = largest > total ? largest : total;
    for (int number = 1; there && largest && number <= last; number++)
        if (!there[number] && n_missing++ < MAX_NAMED)
            append(text, "%s%d", n_missing == 1 ? "part " : ", ", number);
    if (n_missing > MAX_NAMED)
        append(text, " and %d more", n_missing - MAX_NAMED);
    if (n_missing && total)
        append(text, " of %d", total);
    free(there);
    return n_missing;
}

/* Frames missing before parts, by the parts' offsets. *n_between: those with some before them. */
static int64_t name_frames(CtsSlice *const *parts, size_t n, bool numbered, Text *text, int64_t *n_between)
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
                append(text, "%sframes %" PRId64 " to %" PRId64,
                       n_named > 1 ? ", "
                       : numbered  ? ", "
                                   : "",
                       next + 1, first);
        }
        const int64_t end = first + parts[i]->n_frames;
        next = end > next ? end : next;
    }
    return n_missing;
}

static CtsStatus check_concatenation(CtsSlice *const *parts, size_t n, CtsSlice *const *slices, size_t n_slices,
                                     CtsStringPool *texts, CtsError *err)
{
    char words[320];
    Text text = {words, sizeof words};
    int64_t n_between;
    const int n_parts = name_numbers(parts, n, &text);
    const int64_t n_frames = name_frames(parts, n, n_parts > 0, &text, &n_between);
    if (!n_parts && !n_frames)
        return CTS_OK;
    append(&text, " of a concatenation (%s) missing",
           n_parts ? "InConcatenationNumber (0020,9162)" : "ConcatenationFrameOffsetNumber (0020,9228)");
    const char *lacks = cts_string_pool_add(texts, words, strlen(words));
    if (!lacks)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < n_slices; i++)
        if (is_part(slices[i]) && !by_concatenation(slices[i], parts[0])) {
            slices[i]->missing_parts = lacks;
            slices[i]->n_lacking = n_between < INT32_MAX / 16 ? (int)n_between : INT32_MAX / 16;
        }
    return CTS_OK;
}

CtsStatus cts_concatenations_check(CtsSlice *const *slices, size_t n, CtsStringPool *texts, CtsError *err)
{
    size_t n_parts = 0;
    CtsSlice **parts = NULL;
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < n; i++)
        n_parts += is_part(slices[i]) && slices[i]->frame == 0;
    if (!n_parts)
        return CTS_OK;
    if (!(parts = malloc(n_parts * sizeof *parts)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    n_parts = 0;
    for (size_t i = 0; i < n; i++)
        if (is_part(slices[i]) && slices[i]->frame == 0)
            parts[n_parts++] = slices[i];
    qsort(parts, n_parts, sizeof *parts, by_part);
    for (size_t first = 0, end; !st && first < n_parts; first = end) {
        for (end = first + 1; end < n_parts && !by_concatenation(parts[first], parts[end]);)
            end++;
        st = check_concatenation(parts + first, end - first, slices, n, texts, err);
    }
    free(parts);
    return st;
}
