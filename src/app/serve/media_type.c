#include "app/serve/media_type.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* How exactly a range such as image/png, image or * with a star behind it names the type: 3, 2, 1; 0: not. */
static int match(const char *range, size_t n, const char *type)
{
    const size_t slash = strcspn(type, "/");
    if (n == 3 && !strncmp(range, "*/*", 3))
        return 1;
    if (n == slash + 2 && range[slash + 1] == '*' && !strncasecmp(range, type, slash + 1))
        return 2;
    return n == strlen(type) && !strncasecmp(range, type, n) ? 3 : 0;
}

/* The q of a range's parameters, 1 where none is told. */
static double quality(const char *at, const char *end)
{
    while (at < end && (at = memchr(at, ';', (size_t)(end - at)))) {
        at += 1 + strspn(at + 1, " \t");
        if (at + 1 < end && (*at == 'q' || *at == 'Q') && at[1] == '=')
            return strtod(at + 2, NULL);
    }
    return 1;
}

/* What the list thinks of a type, by the range that names it most exactly. */
static double liking(const char *list, const char *type)
{
    int best = 0;
    double liked = 0;
    while (*list) {
        list += strspn(list, ", \t");
        const char *const end = list + strcspn(list, ",");
        const int how = match(list, strcspn(list, ";, \t"), type);
        if (how > best) {
            best = how;
            liked = quality(list, end);
        }
        list = end;
    }
    return liked;
}

int cts_accept_best(const char *list, const char *const *media_types, int n)
{
    int best = -1;
    double most = 0;
    if (!list || !*list)
        return 0;
    for (int i = 0; i < n; i++) {
        const double liked = liking(list, media_types[i]);
        if (liked > most) {
            most = liked;
            best = i;
        }
    }
    return best;
}
