/* Redaction of messages for logs and journals: a UID identifies the patient in the archive, its hash does not; names of
 * files and folders often contain the patient's. */
#pragma once

#include "base/site_key.h"
#include <stddef.h>

/* The first 16 hexadecimal digits of the UID's HMAC-SHA256, without a key (NULL) of its SHA-256; NULL without memory.
 * Free both with free(). */
char *cts_uid_hash(const CtsKey *key, const char *uid);
/* The text with every UID replaced by "uid:HASH", without a key by "uid:?", except those of the standard itself; NULL
 * without memory. */
char *cts_redact_uids(const CtsKey *key, const char *text);

/* Names of input files. Zero-initialise; free with cts_names_free(). */
typedef struct CtsNames {
    char **items;
    size_t n;
} CtsNames;

/* Adds the path, its folder, and its name. Without memory some are missing. */
void cts_names_add(CtsNames *names, const char *path);
void cts_names_free(CtsNames *names);
/* The text without "NAME: " and "NAME, frame N: " for known files, and with other paths to them as "(path)"; NULL
 * without memory. *name, unless name is NULL: the first one removed, or NULL. Free both. */
char *cts_redact_names(const char *text, const CtsNames *names, char **name);
