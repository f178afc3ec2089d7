#include "base/text.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

size_t cts_text_code(const char *text, size_t n, unsigned *code)
{
    const unsigned char *const p = (const unsigned char *)text;
    const size_t length = p[0] < 0x80                   ? 1
                          : p[0] >= 0xC2 && p[0] < 0xE0 ? 2
                          : p[0] >= 0xE0 && p[0] < 0xF0 ? 3
                          : p[0] >= 0xF0 && p[0] < 0xF5 ? 4
                                                        : 0;
    if (length == 0 || length > n)
        return 0;
    *code = length == 1 ? p[0] : p[0] & (0xFFu >> (length + 1));
    for (size_t i = 1; i < length; i++) {
        if ((p[i] & 0xC0) != 0x80)
            return 0;
        *code = *code << 6 | (p[i] & 0x3F);
    }
    const bool overlong = (length == 3 && *code < 0x800) || (length == 4 && *code < 0x10000);
    return overlong || *code > 0x10FFFF || (*code >= 0xD800 && *code < 0xE000) ? 0 : length;
}

static bool unsafe(unsigned code)
{
    return code < 0x20 || (code >= 0x7F && code < 0xA0) || (code >= 0x200E && code <= 0x200F) ||
           (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

size_t cts_text_step(const char *p, size_t n, bool *safe)
{
    unsigned code = 0;
    const size_t length = cts_text_code(p, n, &code);
    *safe = length && !unsafe(code);
    return length ? length : 1;
}

void cts_text_append(char *text, size_t size, const char *separator, const char *format, ...)
{
    va_list args;
    size_t n = strlen(text);
    if (n)
        strncat(text, separator, size - n - 1);
    n = strlen(text);
    va_start(args, format);
    vsnprintf(text + n, size - n, format, args);
    va_end(args);
}

void cts_text_clean(char *text)
{
    size_t n = strlen(text), used;
    char *out = text;
    for (const char *p = text; n > 0; p += used, n -= used) {
        bool safe;
        used = cts_text_step(p, n, &safe);
        memmove(out, safe ? p : "?", safe ? used : 1);
        out += safe ? used : 1;
    }
    *out = 0;
}

bool cts_text_rgb(const char *text, double rgb[3])
{
    if (text[0] != '#' || strspn(text + 1, "0123456789abcdefABCDEF") < 6)
        return false;
    for (int c = 0; c < 3; c++)
        rgb[c] = (double)strtoul((const char[]){text[1 + 2 * c], text[2 + 2 * c], 0}, NULL, 16) / 255;
    return true;
}

bool cts_text_lists(const char *list, const char *word)
{
    const size_t n = strlen(word);
    for (; *list; list += strspn(list, ",")) {
        const size_t length = strcspn(list, ",");
        if (length == n && !strncasecmp(list, word, n))
            return true;
        list += length;
    }
    return false;
}

static const char *after_character(const char *at, const char *end)
{
    do
        at++;
    while (at < end && (*at & 0xc0) == 0x80);
    return at;
}

/* Goes back to the last * where the rest does not match. */
bool cts_text_matches(const CtsPattern *pattern, const char *text, size_t n)
{
    const char *p = pattern->text, *const p_end = p + pattern->n, *const end = text + n, *star = NULL, *retry = NULL;
    while (text < end) {
        const unsigned char k = p < p_end ? (unsigned char)*p : 0, v = (unsigned char)*text;
        const bool is_mark = k == '?' && pattern->has_marks;
        if (k == '*') {
            star = ++p;
            retry = text;
        } else if (p < p_end && (is_mark || k == v || (pattern->ignores_case && toupper(k) == toupper(v)))) {
            p++;
            text = is_mark ? after_character(text, end) : text + 1;
        } else if (star) {
            p = star;
            text = retry = after_character(retry, end);
        } else {
            return false;
        }
    }
    while (p < p_end && *p == '*')
        p++;
    return p == p_end;
}

bool cts_uid_is_valid(const char *uid)
{
    const size_t n = strlen(uid);
    return n > 0 && n <= 64 && strspn(uid, "0123456789.") == n && uid[0] != '.' && uid[n - 1] != '.' &&
           !strstr(uid, "..");
}

char *cts_text_end(FILE *stream, char **text)
{
    const bool whole = stream && !ferror(stream);
    const bool closed = stream && !fclose(stream);
    if (whole && closed)
        return *text;
    if (stream)
        free(*text);
    return *text = NULL;
}
