/* Text from headers and file names, safe to show. */
#ifndef CTS_BASE_TEXT_H
#define CTS_BASE_TEXT_H

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>

CTS_C_BEGIN

/* Bytes of the UTF-8 character at p, of which n > 0 are there; 1 where there is none. *safe: it is one, and may be
 * shown, unlike controls and marks that turn the writing direction or break a line. */
size_t cts_text_step(const char *p, size_t n, bool *safe);

/* What is not safe becomes a question mark. */
void cts_text_clean(char *text);

/* Whether it is a UID (PS3.5 9.1) as far as it names one thing: 1 to 64 digits and single dots between them. */
bool cts_uid_is_valid(const char *uid);

/* The colour that #RRGGBB, whatever follows, stands for, each part 0 to 1; false where text begins otherwise. */
bool cts_text_rgb(const char *text, double rgb[3]);

CTS_C_END
#endif
