#define _GNU_SOURCE
#include "output/report/masked.h"

#include "base/hash.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

char *cts_uid_hash(const char *uid)
{
    uint8_t digest[CTS_DIGEST_BYTES];
    CtsHash *hash;
    char *text = malloc(17);
    if (!text || cts_hash_start(&hash, NULL)) {
        free(text);
        return NULL;
    }
    cts_hash_text(hash, uid);
    if (cts_hash_finish(&hash, digest, NULL)) {
        free(text);
        return NULL;
    }
    for (int i = 0; i < 8; i++)
        snprintf(text + 2 * i, 3, "%02x", digest[i]);
    return text;
}

/* Digits and dots that begin with one of the three roots of object identifiers: how many, 0 where they are no UID. */
static size_t uid_length(const char *text)
{
    static const char of_the_standard[] = "1.2.840.10008.";
    size_t n = strspn(text, "0123456789.");
    while (n && text[n - 1] == '.')
        n--;
    const char *second_dot = n > 3 ? memchr(text + 2, '.', n - 2) : NULL;
    if (!second_dot || !strchr("012", text[0]) || text[1] != '.' ||
        !strncmp(text, of_the_standard, sizeof of_the_standard - 1))
        return 0;
    return n;
}

char *cts_without_uids(const char *text)
{
    char *masked = NULL;
    size_t size;
    FILE *out = open_memstream(&masked, &size);
    if (!out)
        return NULL;
    while (*text) {
        const size_t n = uid_length(text), n_number = strspn(text, "0123456789.");
        char *uid = n ? strndup(text, n) : NULL, *hash = uid ? cts_uid_hash(uid) : NULL;
        if (n)
            fprintf(out, "uid:%s", hash ? hash : "?");
        else
            fwrite(text, 1, n_number ? n_number : 1, out);
        text += n ? n : n_number ? n_number : 1;
        free(uid);
        free(hash);
    }
    if (fclose(out)) {
        free(masked);
        return NULL;
    }
    return masked;
}
