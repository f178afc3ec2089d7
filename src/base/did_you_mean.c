#include "base/did_you_mean.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

enum { LONGEST = 40, PREFIX = 3 };

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

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
            now[j] = least(before[j - 1] + (small(a[i - 1]) != small(b[j - 1])), least(before[j], now[j - 1]) + 1);
            if (i > 1 && j > 1 && small(a[i - 1]) == small(b[j - 2]) && small(a[i - 2]) == small(b[j - 1]))
                now[j] = least(now[j], earlier[j - 2] + 1);
        }
    }
    return rows[n % 3][m];
}

void cts_near_try(CtsNear *near, const char *candidate)
{
    const size_t n = near->length, m = strlen(candidate);
    if (!n || n > LONGEST || m > LONGEST)
        return;
    size_t d = distance(near->written, n, candidate, m);
    if (n >= PREFIX && m > n && !strncasecmp(near->written, candidate, n))
        d = least(d, 1);
    if (d > (n < 6 ? 1 : n / 3) || (near->word && d >= near->distance))
        return;
    near->word = candidate;
    near->distance = d;
}

CtsHint cts_near_hint(const CtsNear *near)
{
    CtsHint hint = {""};
    if (near->word)
        snprintf(hint.text, sizeof hint.text, " (did you mean %s?)", near->word);
    return hint;
}

CtsHint cts_near_name(const char *written, size_t length, const char *const *names, int n)
{
    CtsNear near = {.written = written, .length = length};
    for (int i = 0; i < n; i++)
        cts_near_try(&near, names[i]);
    return cts_near_hint(&near);
}
