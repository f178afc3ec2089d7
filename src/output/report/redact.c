#include "output/report/redact.h"

#include "base/hash.h"
#include "base/mem.h"
#include "base/text.h"
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

char *cts_uid_hash(const CtsKey *key, const char *uid)
{
    CtsHash *hash = cts_hash_start(key);
    char hex[2 * CTS_DIGEST_BYTES + 1];
    cts_hash_text(hash, uid);
    return cts_hash_hex(&hash, hex, NULL) ? NULL : strndup(hex, 16);
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

char *cts_redact_uids(const CtsKey *key, const char *text)
{
    char *masked = NULL;
    size_t size;
    FILE *out = open_memstream(&masked, &size);
    if (!out)
        return NULL;
    while (*text) {
        const size_t n = uid_length(text), n_number = strspn(text, "0123456789.");
        char *uid = n ? strndup(text, n) : NULL, *hash = uid && key ? cts_uid_hash(key, uid) : NULL;
        if (n)
            fprintf(out, "uid:%s", hash ? hash : "?");
        else
            fwrite(text, 1, n_number ? n_number : 1, out);
        text += n ? n : n_number ? n_number : 1;
        free(uid);
        free(hash);
    }
    return cts_text_end(out, &masked);
}

/* Longer names are truncated in messages (dicom/header/slice.h). */
enum { LONGEST_NAME = 255 };

static void add_hidden_name(CtsNames *names, const char *text, size_t n, const char *end)
{
    if (n && !cts_grow(&names->items, names->n, NULL) &&
        asprintf(&names->items[names->n], "%.*s%s", (int)n, text, end) >= 0)
        cts_text_clean(names->items[names->n++]); /* as in messages */
}

void cts_names_add(CtsNames *names, const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    add_hidden_name(names, path, strlen(path), "");
    add_hidden_name(names, path, strlen(path), "/");
    add_hidden_name(names, name, strnlen(name, LONGEST_NAME), "");
    if (slash && slash > path) {
        add_hidden_name(names, path, (size_t)(slash - path), "");
        add_hidden_name(names, path, (size_t)(slash - path), "/");
    }
}

void cts_names_free(CtsNames *names)
{
    for (size_t i = 0; i < names->n; i++)
        free(names->items[i]);
    free(names->items);
    *names = (CtsNames){0};
}

static bool begins(const char *text, const char *with)
{
    return !strncmp(text, with, strlen(with));
}

/* Length of a name at the start of the text, which begins a word: 0 where it does not match. A file may have the name
 * of any word, so a name without slash counts only where ": " or ", frame " follows. */
static size_t name_length(const char *text, const char *name)
{
    const size_t n = strlen(name);
    const bool is_path = strchr(name, '/');
    if (!begins(text, name))
        return is_path && begins(name, text) ? strlen(text) : 0; /* a truncated path */
    if (name[n - 1] == '/') {                                    /* a path below a folder; it may contain blanks */
        const char *end = strstr(text, ": ");
        return end ? (size_t)(end - text) : strlen(text);
    }
    return begins(text + n, ": ") || begins(text + n, ", frame ") || (is_path && strchr(" :;,)", text[n])) ? n : 0;
}

static size_t longest_name(const char *text, const CtsNames *names)
{
    size_t longest = 0;
    for (size_t i = 0; i < names->n; i++) {
        const size_t n = name_length(text, names->items[i]);
        longest = n > longest ? n : longest;
    }
    return longest;
}

char *cts_redact_names(const char *text, const CtsNames *names, char **name)
{
    char *masked = NULL;
    size_t size;
    FILE *out = open_memstream(&masked, &size);
    if (name)
        *name = NULL;
    if (!out)
        return NULL;
    for (bool word = true; *text;) {
        const size_t n = word ? longest_name(text, names) : 0;
        if (n && name && !*name)
            *name = strndup(text, n);
        if (n && !begins(text + n, ": ") && !begins(text + n, ", frame "))
            fputs("(path)", out);
        else if (n)
            text += 2;
        else
            fputc(*text, out);
        word = n || strchr(" (", *text);
        text += n ? n : 1;
    }
    return cts_text_end(out, &masked);
}
