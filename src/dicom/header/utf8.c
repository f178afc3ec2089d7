/* Decoding of text in any DICOM character set. */
#include "dicom/header/utf8.h"
#include "base/text.h"
#include <iconv.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_CHARACTERS = 64 }; /* of DICOM's texts of one line: LO has 64, and each group of PN */

/* ASCII in a single-byte set or UTF-8 (ISO_IR 100 to 192), all of which hold ASCII unchanged: the usual case. */
static bool is_same_in_utf8(const char *text, const char *charset)
{
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c >= 0x80 || *c == 0x1B)
            return false;
    return strncmp(charset, "ISO_IR 1", 8) == 0 && strlen(charset) == 10;
}

/* Sets with two bytes per character, which not every build of DCMTK supports (PS3.3 C.12.1.1.2). An escape sequence
 * selects a set; in `code`, an iconv encoding, the same bytes have their upper bit set, and a prefix byte where it
 * selects the set. */
static const struct {
    const char *term, *escape, *code;
    char in_front; /* 0: none */
} wide_sets[] = {{"ISO 2022 IR 87", "$B", "EUC-JP", 0},
                 {"ISO 2022 IR 87", "$@", "EUC-JP", 0},
                 {"ISO 2022 IR 159", "$(D", "EUC-JP", (char)0x8F},
                 {"ISO 2022 IR 149", "$)C", "EUC-KR", 0},
                 {"ISO 2022 IR 58", "$)A", "GB2312", 0}};
enum { N_WIDE = sizeof wide_sets / sizeof *wide_sets, ESCAPE = 0x1B };

/* The text in the code without escape sequences; to be freed with free(). NULL: it has others than these. */
static char *without_escapes(const char *text, const char *code)
{
    static const char *const narrow[] = {"(B", "(J", ")I"}; /* ASCII; Roman and katakana of JIS X 0201 */
    static const char katakana = (char)0x8E;
    char *const out = malloc(3 * strlen(text) + 1);
    size_t n = 0;
    int wide = -1;
    for (const char *p = text; out && *p;) {
        const int before = wide;
        size_t n_escape = 0;
        for (int i = 0; *p == ESCAPE && i < N_WIDE && !n_escape; i++)
            if (!strcmp(wide_sets[i].code, code) && !strncmp(p + 1, wide_sets[i].escape, strlen(wide_sets[i].escape))) {
                n_escape = strlen(wide_sets[i].escape) + 1;
                wide = wide_sets[i].escape[1] == ')' ? -1 : i; /* sets in the upper half need no state */
            }
        for (size_t i = 0; *p == ESCAPE && i < sizeof narrow / sizeof *narrow && !n_escape; i++)
            if (!strncmp(p + 1, narrow[i], strlen(narrow[i]))) {
                n_escape = strlen(narrow[i]) + 1;
                wide = narrow[i][0] == '(' ? -1 : before;
            }
        p += n_escape;
        if (n_escape)
            continue;
        if (*p == ESCAPE) {
            free(out);
            return NULL;
        }
        if (wide >= 0 && (p[0] & 0x7F) > ' ' && (p[1] & 0x7F) > ' ') {
            if (wide_sets[wide].in_front)
                out[n++] = wide_sets[wide].in_front;
            out[n++] = (char)(*p++ | 0x80);
            out[n++] = (char)(*p++ | 0x80);
            continue;
        }
        if ((*p & 0x80) && !strcmp(code, "EUC-JP"))
            out[n++] = katakana;
        out[n++] = *p++;
    }
    if (out)
        out[n] = 0;
    return out;
}

static char *convert(const char *text, const char *code)
{
    char *from = (char *)text;
    size_t n_from = strlen(text), n_to = 3 * n_from;
    char *const utf8 = malloc(n_to + 1), *to = utf8;
    const iconv_t converter = iconv_open("UTF-8", code);
    const bool known = converter != (iconv_t)-1;
    const bool done = utf8 && known && iconv(converter, &from, &n_from, &to, &n_to) != (size_t)-1;
    if (known)
        iconv_close(converter);
    if (done) {
        *to = 0;
        return utf8;
    }
    free(utf8);
    return NULL;
}

/* NULL: not in these sets. */
static char *wide_to_utf8(const char *text, const char *charset)
{
    char *utf8 = NULL;
    for (int i = 0; i < N_WIDE && !utf8; i++) {
        const char *const named = strstr(charset, wide_sets[i].term);
        char *const plain = named ? without_escapes(text, wide_sets[i].code) : NULL;
        utf8 = plain ? convert(plain, wide_sets[i].code) : NULL;
        free(plain);
    }
    return utf8;
}

/* Sets with one byte per character, and two with more that have no escape sequence: the end of their defined term, the
 * escape sequence that selects them, and their iconv encoding. */
static const struct {
    const char *term, *escape, *code;
} sets[] = {{"IR 100", "-A", "ISO-8859-1"},
            {"IR 101", "-B", "ISO-8859-2"},
            {"IR 109", "-C", "ISO-8859-3"},
            {"IR 110", "-D", "ISO-8859-4"},
            {"IR 144", "-L", "ISO-8859-5"},
            {"IR 127", "-G", "ISO-8859-6"},
            {"IR 126", "-F", "ISO-8859-7"},
            {"IR 138", "-H", "ISO-8859-8"},
            {"IR 148", "-M", "ISO-8859-9"},
            {"IR 203", "-b", "ISO-8859-15"},
            {"IR 13", ")I", "JIS_X0201"},
            {"IR 166", "-T", "TIS-620"},
            {"IR 192", "%G", "UTF-8"},
            {"GB18030", "GB", "GB18030"},
            {"GBK", "GB", "GBK"},
            {"IR 6", "(B", "ASCII"},
            {"", "(J", "ASCII"}};
enum { N_SETS = sizeof sets / sizeof *sets };

/* The encoding of a character set's first value; NULL: not known. */
static const char *first_code(const char *charset)
{
    size_t n = strcspn(charset, "\\");
    while (n && charset[n - 1] == ' ')
        n--;
    for (int i = 0; i < N_SETS; i++) {
        const size_t n_term = strlen(sets[i].term);
        const bool is_it = n >= n_term && !memcmp(charset + n - n_term, sets[i].term, n_term);
        if (is_it && (n == n_term || (n_term && (!strncmp(charset, "ISO_", 4) || !strncmp(charset, "ISO 2022 ", 9)))))
            return sets[i].code;
    }
    return NULL;
}

/* Converts the text between its escape sequences, each of which selects a set. */
static char *narrow_to_utf8(const char *text, const char *charset)
{
    const char *code = first_code(charset);
    char *const all = calloc(3, strlen(text) + 1);
    bool good = all && code;
    while (good && *text) {
        char *const part = strndup(text, strcspn(text, "\x1b")), *utf8 = part ? convert(part, code) : NULL;
        if ((good = utf8))
            strcat(all, utf8);
        text += part ? strlen(part) : 0;
        free(part);
        free(utf8);
        if (!good || !*text)
            break;
        code = NULL;
        for (int i = 0; i < N_SETS && !code; i++)
            if (!strncmp(text + 1, sets[i].escape, 2))
                code = sets[i].code;
        good = code != NULL;
        text += good ? 3 : 0;
    }
    if (good)
        return all;
    free(all);
    return NULL;
}

char *cts_dcm_convert(const char *text, const char *charset)
{
    char *const wide = wide_to_utf8(text, charset);
    return wide ? wide : narrow_to_utf8(text, charset);
}

char *cts_dcm_utf8(const char *text, const char *charset)
{
    const bool foreign = charset && charset[0] && !is_same_in_utf8(text, charset);
    char *utf8 = foreign ? cts_dcm_convert(text, charset) : NULL;
    if (!utf8 && !(utf8 = strdup(text)))
        return NULL;
    cts_text_clean(utf8);
    char *end = utf8;
    bool safe;
    for (int i = 0; i < MAX_CHARACTERS && *end; i++)
        end += cts_text_step(end, strlen(end), &safe);
    *end = 0;
    return utf8;
}
