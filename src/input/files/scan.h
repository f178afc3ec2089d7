/* Paths and folders -> files that may be slices. */
#pragma once

#include "base/file_bytes.h"
#include "base/string_pool.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "dicom/header/slice.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Called with a file, which is there for as long as the call; archive is the path of the zip file that it is a member
 * of, or NULL. */
typedef CtsStatus (*cts_file_fn)(void *context, const CtsFile *file, const char *archive, CtsError *err);

/* Callback and counters of a search. Zero-initialise; free the findings. */
typedef struct CtsScan {
    cts_file_fn found;
    void *context;
    struct CtsArchives **kept;          /* receives the named archives, which own the bytes of their members */
    const struct CtsArchives *archives; /* unpacked before, whose members may be named; or NULL */
    int n_special;                      /* sockets, devices, links to folders and the like: never opened */
    int n_unreadable;                   /* folders that cannot be listed; findings name them */
    int n_other;                        /* members of archives that are plainly no DICOM */
    CtsDiagnostics diagnostics;
} CtsScan;

typedef struct CtsFileList {
    CtsFile *items; /* their paths are among the texts */
    CtsStringPool texts;
    size_t n;
    struct CtsArchives *archives; /* zip files named as paths */
    CtsScan scan;                 /* the search that found them, for its counts and findings */
} CtsFileList;

/* Calls found for each file when it is met, in the folders' own order; a path may occur twice. Needs memory for one
 * folder's list of subfolders. Otherwise as cts_scan_paths(). */
CtsStatus cts_scan_each(CtsScan *scan, const char *const *paths, int n_paths, CtsError *err);

/* Files in order of name, folder by folder, each path once. Links to folders are not followed, folders deeper than 32
 * not entered. A zip file that is named counts as a folder. CTS_ERR_READ when one of paths itself cannot be read. */
CtsStatus cts_scan_paths(const struct CtsArchives *archives, const char *const *paths, int n_paths, CtsFileList *list,
                         CtsError *err);

/* Calls found with the files that a DICOMDIR names, in its order, for as long as that succeeds: by their names or,
 * where these changed on the way to this disk, by names that differ in case and ending alone. */
typedef struct CtsDirectoryCounts {
    size_t n_refused; /* names that lead out of its folder */
    size_t n_missing;
} CtsDirectoryCounts;
CtsStatus cts_directory_files(const char *path, cts_file_fn found, void *context, CtsDirectoryCounts *counts,
                              CtsError *err);
#define CTS_DIRECTORY_MISSING_TEXT "%s: %zu of its files are not there (name their folder instead of the DICOMDIR)"

/* Adds one file, whose path is copied, to a CtsFileList (cts_file_fn). */
CtsStatus cts_file_list_add(void *list, const CtsFile *file, const char *archive, CtsError *err);
void cts_file_list_free(CtsFileList *list);
