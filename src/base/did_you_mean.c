#include "base/did_you_mean.h"

#include "base/compare.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

enum { LONGEST = 40, PREFIX = 3 };

static int small(char c)
{
    return tolower((unsigned char)c);
}

/* Damerau and Levenshtein's distance, no letter changed twice: three rows of its table. */
static size_t distance(const char *a, size_t n, const char *b, size_t m)
{
    size_t rows[3][LONGEST + 1];
    for (size_t j = 0; j <= m; j++)
        rows[0][j] = j;
    for (size_t i = 1; i <= n; i++) {
        size_t *const now = rows[i % 3], *const before = rows[(i + 2) % 3], *const earlier = rows[(i + 1) % 3];
        now[0] = i;
        for (size_t j = 1; j <= m; j++) {
            now[j] = cts_smaller_size(before[j - 1] + (small(a[i - 1]) != small(b[j - 1])),
                                      cts_smaller_size(before[j], now[j - 1]) + 1);
            if (i > 1 && j > 1 && small(a[i - 1]) == small(b[j - 2]) && small(a[i - 2]) == small(b[j - 1]))
                now[j] = cts_smaller_size(now[j], earlier[j - 2] + 1);
        }
    }
    return rows[n % 3][m];
}

void cts_did_you_mean_try(CtsDidYouMean *nearest_word, const char *candidate)
{
    const size_t n = nearest_word->length, m = strlen(candidate);
    if (!n || n > LONGEST || m > LONGEST)
        return;
    size_t d = distance(nearest_word->written, n, candidate, m);
    if (n >= PREFIX && m > n && !strncasecmp(nearest_word->written, candidate, n))
        d = cts_smaller_size(d, 1);
    if (d > (n < 6 ? 1 : n / 3) || (nearest_word->word && d >= nearest_word->distance))
        return;
    nearest_word->word = candidate;
    nearest_word->distance = d;
}

CtsHint cts_did_you_mean_hint(const CtsDidYouMean *nearest_word)
{
    CtsHint hint = {""};
    if (nearest_word->word)
        snprintf(hint.text, sizeof hint.text, " (did you mean %s?)", nearest_word->word);
    return hint;
}

CtsHint cts_did_you_mean(const char *written, size_t length, const char *const *names, int n)
{
    CtsDidYouMean nearest_word = {.written = written, .length = length};
    for (int i = 0; i < n; i++)
        cts_did_you_mean_try(&nearest_word, names[i]);
    return cts_did_you_mean_hint(&nearest_word);
}
