/* Zip files: one, and those that a list keeps. */
#ifndef CTS_FILES_ARCHIVE_H
#define CTS_FILES_ARCHIVE_H

#include "base/sandbox.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "input/files/scan.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A zip file's members, unpacked in memory by a sandbox (base/sandbox.h): their names are data, no path is ever
 * made of them, and nothing is written anywhere. */

enum { CTS_MAX_MEMBERS = 200000 };

typedef struct CtsMember {
    const char *name; /* as the archive has it: for messages */
    const uint8_t *bytes;
    uint64_t n_bytes;
    bool is_bad; /* cannot be unpacked: encrypted, damaged; bytes then says why, as text */
} CtsMember;

/* For qsort() and bsearch(). */
int cts_member_by_name(const void *a, const void *b);

typedef struct CtsArchive {
    CtsMember *members; /* n_members, in order of name */
    int n_members, n_other;
    CtsSandbox unpacker; /* keeps the memory; its child is gone */
} CtsArchive;

/* Whether a file begins as a zip file does. */
bool cts_archive_is_zip(const char *path);

/* Unpack all members but folders and what plainly is no DICOM (counted in n_other). They may take a hundred times the
 * file's size and 64 MiB, and half of the memory that is free. CTS_ERR_READ, with the reason, when it is no sound zip
 * file or holds more. */
CtsStatus cts_archive_open(const char *path, CtsArchive **archive, CtsError *err);
void cts_archive_free(CtsArchive **archive);

/* The two halves of opening one, on a room of n_room bytes (4096 or more): what the child does, and what the program
 * makes of it, trusting none of it. */
CtsStatus cts_archive_unpack(const void *order, const uint8_t *zip, size_t n, void *room, size_t n_room, CtsError *err);
CtsStatus cts_archive_list(const uint8_t *room, size_t n_room, CtsArchive **archive, CtsError *err);

/* Archives that stay in memory, and their members by path. */

/* Takes archive over, in any case. *archives is made where it is NULL. */
CtsStatus cts_archives_add(CtsArchives **archives, const char *path, CtsArchive *archive, CtsError *err);

/* The file of this path, which stays the caller's; false when no archive has it. archives may be NULL. */
bool cts_archives_find(const CtsArchives *archives, const char *path, CtsFile *file);

#endif
