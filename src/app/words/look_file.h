/* A look file: what the options of labels say, as JSON. */
#ifndef CTS_WORDS_LOOK_FILE_H
#define CTS_WORDS_LOOK_FILE_H

#include "ctsplat/state.h"

/* Its words; names are static, texts the look's own. */
typedef struct CtsLook {
    CtsWord *words;
    char **texts;
    int n;
} CtsLook;

/* Of a file, or of the JSON itself. Free with cts_look_free(), also after a failure. */
CtsStatus cts_look_read(const char *file_or_json, CtsLook *look, CtsError *err);
void cts_look_free(CtsLook *look);

#endif
