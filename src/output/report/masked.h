/* Messages for what is kept: a UID leads to the patient in the archive, its hash does not; names of files and folders
 * are often the patient's. */
#ifndef CTS_REPORT_MASKED_H
#define CTS_REPORT_MASKED_H

#include "base/site_key.h"
#include <stddef.h>

/* The first 16 hexadecimal digits of the UID's HMAC-SHA256, without a key (NULL) of its SHA-256; NULL without memory.
 * Free both with free(). */
char *cts_uid_hash(const CtsKey *key, const char *uid);
/* The text with every UID in it as "uid:HASH", without a key as "uid:?", but for those of the standard itself; NULL
 * without memory. */
char *cts_without_uids(const CtsKey *key, const char *text);

/* Names of input files. Zero-initialise; free with cts_names_free(). */
typedef struct CtsNames {
    char **items;
    size_t n;
} CtsNames;

/* The path, its folder, and its name alone. Without memory less is known. */
void cts_names_add(CtsNames *names, const char *path);
void cts_names_free(CtsNames *names);
/* The text without "NAME: " and "NAME, frame N: " wherever a known file is named so, and with other paths to it as
 * "(path)"; NULL without memory. *name, unless name is NULL: the first one that is left out, or NULL. Free both. */
char *cts_without_names(const char *text, const CtsNames *names, char **name);

#endif
