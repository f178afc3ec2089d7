/* Text of any DICOM character set, safe to show. */
#include "base/text.h"
#include "input/header/dcm_readers.h"
#include <stdlib.h>
#include <string.h>

enum { MAX_CHARACTERS = 64 };

/* ASCII in a single-byte set or UTF-8 (ISO_IR 100 to 192), all of which hold ASCII unchanged: the usual case. */
static bool is_same_in_utf8(const char *text, const char *charset)
{
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c >= 0x80 || *c == 0x1B)
            return false;
    return strncmp(charset, "ISO_IR 1", 8) == 0 && strlen(charset) == 10;
}

char *cts_dcm_utf8(const char *text, const char *charset)
{
    const bool foreign = charset && charset[0] && !is_same_in_utf8(text, charset);
    const CtsDcmReaders *dcm = NULL;
    char *utf8 = foreign && !cts_dcm_readers(&dcm, NULL) ? dcm->convert(text, charset) : NULL;
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
