/* Decoding of text in any DICOM character set. */
#include "dicom/header/utf8.h"
#include "base/text.h"
#include <iconv.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_CHARACTERS = 64, ESCAPE = 0x1B }; /* of DICOM's texts of one line: LO has 64, and each group of PN */

/* Character sets (PS3.3 C.12.1.1.2), which not every build of DCMTK supports: the end of their defined term, the escape
 * sequence that selects them, and their iconv encoding. They are for bytes below 0x80, for those from 0x80 on, or for
 * all; of LOW_WIDE, with two bytes a character, the escape sequence is a part of the encoding. */
typedef struct CharacterSet {
    const char *term, *escape, *code;
    enum { LOW, LOW_WIDE, HIGH, ALL } bytes;
} CharacterSet;
static const CharacterSet sets[] = {
    {"", "(B", "ASCII", LOW},
    {"IR 6", "(J", "ASCII", LOW}, /* Roman letters of JIS X 0201 */
    {"IR 87", "$B", "ISO-2022-JP-2", LOW_WIDE},
    {"IR 87", "$@", "ISO-2022-JP-2", LOW_WIDE},
    {"IR 159", "$(D", "ISO-2022-JP-2", LOW_WIDE},
    {"IR 149", "$)C", "EUC-KR", HIGH},
    {"IR 58", "$)A", "GB2312", HIGH},
    {"IR 100", "-A", "ISO-8859-1", HIGH},
    {"IR 101", "-B", "ISO-8859-2", HIGH},
    {"IR 109", "-C", "ISO-8859-3", HIGH},
    {"IR 110", "-D", "ISO-8859-4", HIGH},
    {"IR 144", "-L", "ISO-8859-5", HIGH},
    {"IR 127", "-G", "ISO-8859-6", HIGH},
    {"IR 126", "-F", "ISO-8859-7", HIGH},
    {"IR 138", "-H", "ISO-8859-8", HIGH},
    {"IR 148", "-M", "ISO-8859-9", HIGH},
    {"IR 203", "-b", "ISO-8859-15", HIGH},
    {"IR 13", ")I", "SHIFT_JIS", HIGH}, /* katakana are its single bytes */
    {"IR 166", "-T", "TIS-620", HIGH},
    {"IR 192", "%G", "UTF-8", ALL},
    {"GB18030", "GB", "GB18030", ALL},
    {"GBK", "GB", "GBK", ALL},
};
enum { N_SETS = sizeof sets / sizeof *sets };

/* The set of a defined term of n characters, such as ISO_IR 100 or ISO 2022 IR 100; NULL: not known. */
static const CharacterSet *set_of_term(const char *term, size_t n)
{
    const size_t n_prefix = !strncmp(term, "ISO_", 4) ? 4 : !strncmp(term, "ISO 2022 ", 9) ? 9 : 0;
    while (n && term[n - 1] == ' ')
        n--;
    for (int i = 0; i < N_SETS && n >= n_prefix; i++)
        if (strlen(sets[i].term) == n - n_prefix && !memcmp(sets[i].term, term + n_prefix, n - n_prefix))
            return &sets[i];
    return NULL;
}

/* The set of bytes from 0x80 on in front of any escape sequence: the first one of the attribute that has such bytes. */
static const CharacterSet *first_set(const char *charset)
{
    const CharacterSet *set = NULL;
    for (const char *term = charset, *end; term; term = *end ? end + 1 : NULL) {
        end = strchrnul(term, '\\');
        const CharacterSet *const one = set_of_term(term, (size_t)(end - term));
        if (term == charset || (one && set->bytes < HIGH))
            set = one;
        if (!set)
            return NULL;
    }
    return set;
}

static const CharacterSet *set_of_escape(const char *text)
{
    for (int i = 0; i < N_SETS; i++)
        if (!strncmp(text, sets[i].escape, strlen(sets[i].escape)))
            return &sets[i];
    return NULL;
}

/* Appends n bytes of the text as UTF-8. */
static bool append_run(char *utf8, const CharacterSet *set, const char *text, size_t n)
{
    char *from = NULL, *to = utf8 + strlen(utf8);
    const iconv_t converter = iconv_open("UTF-8", set->code);
    if (converter == (iconv_t)-1)
        return false;
    const bool wide = set->bytes == LOW_WIDE;
    const int n_all = asprintf(&from, "%s%s%.*s", wide ? "\x1b" : "", wide ? set->escape : "", (int)n, text);
    char *at = from;
    size_t n_from = n_all < 0 ? 0 : (size_t)n_all, n_to = 3 * n;
    const bool done = n_all >= 0 && iconv(converter, &at, &n_from, &to, &n_to) != (size_t)-1;
    *to = 0;
    iconv_close(converter);
    if (n_all >= 0)
        free(from);
    return done;
}

char *cts_dcm_convert(const char *text, const char *charset)
{
    const CharacterSet *low = &sets[0], *high = first_set(charset);
    char *const utf8 = calloc(3, strlen(text) + 1);
    bool done = utf8 && high;
    while (done && *text) {
        const int kind = *text & 0x80;
        size_t n = 0;
        if (*text == ESCAPE) {
            const CharacterSet *const set = set_of_escape(text + 1);
            if ((done = set))
                *(set->bytes < HIGH ? &low : &high) = set;
            n = done ? strlen(set->escape) + 1 : 0;
        } else {
            while (text[n] && text[n] != ESCAPE && (high->bytes == ALL || (text[n] & 0x80) == kind))
                n++;
            done = append_run(utf8, high->bytes == ALL || kind ? high : low, text, n);
        }
        text += n;
    }
    if (done)
        return utf8;
    free(utf8);
    return NULL;
}

char *cts_dcm_utf8(const char *text, const char *charset)
{
    char *utf8 = charset[0] ? cts_dcm_convert(text, charset) : NULL;
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
