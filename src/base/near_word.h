/* What somebody may have meant who wrote a word that is not known. */
#ifndef CTS_BASE_NEAR_WORD_H
#define CTS_BASE_NEAR_WORD_H

#include <stddef.h>

/* {.written = WORD, .length = its bytes} to begin with. */
typedef struct CtsNear {
    const char *written;
    size_t length;
    const char *word; /* the nearest of those tried, or NULL */
    size_t distance;
} CtsNear;

/* A candidate is near that begins with what was written, or that takes few letters to be put in, left out, changed or
 * swapped with their neighbour: a third of them, and one at least. Capitals are small letters. */
void cts_near_try(CtsNear *near, const char *candidate);

/* " (did you mean WORD?)", or "". */
typedef struct CtsHint {
    char text[96];
} CtsHint;
CtsHint cts_near_hint(const CtsNear *near);
/* Likewise of n names. */
CtsHint cts_near_name(const char *written, size_t length, const char *const *names, int n);

#endif
