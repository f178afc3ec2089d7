/* Suggestions for misspelt words. */
#pragma once

#include <stddef.h>

/* {.written = WORD, .length = its bytes} to begin with. */
typedef struct CtsDidYouMean {
    const char *written;
    size_t length;
    const char *word; /* the nearest of those tried, or NULL */
    size_t distance;
} CtsDidYouMean;

/* A candidate is similar if it begins with the written text, or differs from it by few insertions, deletions, changes
 * or swaps of neighbouring letters: a third of them, and at least one. Case does not matter. */
void cts_did_you_mean_try(CtsDidYouMean *nearest_word, const char *candidate);

/* " (did you mean WORD?)", or "". */
typedef struct CtsHint {
    char text[96];
} CtsHint;
CtsHint cts_did_you_mean_hint(const CtsDidYouMean *nearest_word);
/* The most similar of n names. */
CtsHint cts_did_you_mean(const char *written, size_t length, const char *const *names, int n);
