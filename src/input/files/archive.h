/* Zip files, and a list of them. */
#pragma once

#include "base/sandbox.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "input/files/scan.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A zip file's members, unpacked in memory by a sandbox (base/sandbox.h): their names are data, no path is ever
 * made of them, and nothing is written anywhere. */

typedef struct CtsMember {
    const char *name; /* as in the archive: for messages */
    const uint8_t *bytes;
    uint64_t n_bytes;
    bool is_bad; /* cannot be unpacked: encrypted or damaged; bytes then contains the reason, as text */
} CtsMember;

typedef struct CtsArchives {
    CtsMember *members; /* n_members, in order of name */
    int n_members, n_other;
    char *path;          /* once it is kept; owned */
    CtsSandbox unpacker; /* owns the memory; its process has ended */
    struct CtsArchives *next;
} CtsArchive;

/* True if a file begins like a zip file. */
bool cts_archive_is_zip(const char *path);

/* Unpacks all members except folders and files that are not DICOM by their first bytes (counted in n_other). They may
 * take a hundred times the file's size and 64 MiB, and half of the free memory. CTS_ERR_READ, with the reason, for a
 * damaged zip file or one that is too large. Free with cts_archives_free(). */
CtsStatus cts_archive_open(const char *path, CtsArchive **archive, CtsError *err);

/* Lists the members in the untrusted output of CTS_PIXELS_UNZIP (dicom/protocol/pixel_sandbox.h). */
CtsStatus cts_archive_list(CtsArchive *archive, const uint8_t *room, size_t n_room, CtsError *err);

/* Archives that stay in memory, and their members by path. */

/* Takes ownership of archive in any case. *archives NULL: there are none. */
CtsStatus cts_archives_add(CtsArchives **archives, const char *path, CtsArchive *archive, CtsError *err);

/* The file of this path, which stays the caller's; false when no archive has it. archives may be NULL. */
bool cts_archives_find(const CtsArchives *archives, const char *path, CtsFile *file);
