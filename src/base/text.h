/* Sanitising text from headers and file names for display. */
#pragma once

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

CTS_C_BEGIN

/* Closes a stream of open_memstream() on text, or NULL where that failed. The text, to be freed with free(); NULL, and
 * nothing to free, where memory ran out. */
char *cts_text_end(FILE *stream, char **text);

/* Length of the UTF-8 character at text, of n > 0 bytes, and its code point; 0 when it is none: PS3.5 has no use for
 * overlong forms either. */
size_t cts_text_code(const char *text, size_t n, unsigned *code);
/* Length of the UTF-8 character at p, of n > 0 bytes; 1 where it is invalid. *safe: valid and printable, unlike
 * controls and marks that change the writing direction or break a line. */
size_t cts_text_step(const char *p, size_t n, bool *safe);

/* Appends to a text in a buffer of this size, behind the separator unless it is empty; truncated. */
void cts_text_append(char *text, size_t size, const char *separator, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Replaces unsafe characters by question marks. */
void cts_text_clean(char *text);

/* True if a list with commas holds the word, in any case of its letters. */
bool cts_text_lists(const char *list, const char *word);

/* True if a text matches a pattern, in which * stands for any characters and, with has_marks, ? for one. */
typedef struct CtsPattern {
    const char *text;
    size_t n;
    bool ignores_case, has_marks; /* of ASCII */
} CtsPattern;
bool cts_text_matches(const CtsPattern *pattern, const char *text, size_t n);

/* True for a valid UID (PS3.5 9.1), tolerating leading zeros: 1 to 64 digits and single dots between them. */
bool cts_uid_is_valid(const char *uid);

/* The colour of #RRGGBB at the start of text, each part 0 to 1; false where text begins otherwise. */
bool cts_text_rgb(const char *text, double rgb[3]);

CTS_C_END
