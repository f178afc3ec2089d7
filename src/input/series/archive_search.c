#include "ctsplat/series.h"

#include "base/cpu.h"
#include "base/string_pool.h"
#include "dicom/header/slice.h"
#include "input/files/file_header.h"
#include "input/files/scan.h"
#include "input/series/series_check.h"
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Headers that are read together before any is handed on: work for many threads, in little memory. Changes no result.
 */
enum { GROUP = 256 };

typedef struct ArchiveSearch {
    const CtsArchiveSearch *asked;
    CtsArchiveCounts *counts;
    CtsScan scan;
    CtsFile files[GROUP]; /* n */
    CtsHeaderRead headers[GROUP];
    const char *archives[GROUP]; /* path of the zip file that each is a member of, or NULL */
    CtsStringPool paths;         /* of both */
    size_t n;
    int n_threads;
    CtsHeaderReader *readers; /* of each thread */
    bool in_directory;        /* files come from a DICOMDIR, which must not refer to another */
} ArchiveSearch;

static CtsStatus flush(ArchiveSearch *s, CtsError *err);

static CtsStatus add_file(void *context, const CtsFile *file, const char *archive, CtsError *err)
{
    ArchiveSearch *const s = context;
    CtsFile *const f = &s->files[s->n];
    *f = *file;
    f->named &= !s->in_directory;
    f->path = cts_string_pool_add(&s->paths, file->path, strlen(file->path));
    s->archives[s->n] = archive ? cts_string_pool_share(&s->paths, archive, strlen(archive)) : NULL;
    if (!f->path || (archive && !s->archives[s->n]))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return ++s->n == GROUP ? flush(s, err) : CTS_OK;
}

/* An archive changes as a whole. */
static void report_archive(const char *archive, CtsArchiveFile *file)
{
    struct stat info;
    if (archive && !stat(archive, &info))
        file->mtime_ns = (int64_t)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
}

/* A folder that cannot be listed, or a DICOMDIR that names too much, counts like a file that cannot be read. */
static CtsStatus report_fault(const ArchiveSearch *s, const char *why, CtsError *err)
{
    return s->asked->found(s->asked->context,
                           &(CtsArchiveFile){.path = "", .why = why, .series_uid = "", .sop_uid = ""}, err);
}

/* The files that a DICOMDIR names, into the next group. */
static CtsStatus follow_dicomdir(ArchiveSearch *s, const char *path, CtsError *err)
{
    CtsDirectoryCounts counts;
    char why[PATH_MAX + 100];
    s->in_directory = true;
    const CtsStatus st = cts_directory_files(path, add_file, s, &counts, err);
    s->in_directory = false;
    if (st || !counts.n_missing)
        return st;
    snprintf(why, sizeof why, CTS_DIRECTORY_MISSING_TEXT, path, counts.n_missing);
    s->counts->n_unreadable += counts.n_missing;
    return report_fault(s, why, err);
}

static CtsStatus hand_on(ArchiveSearch *s, size_t i, char **directory, CtsError *err)
{
    const CtsHeaderRead *const header = &s->headers[i];
    const CtsObject *const object = &header->object;
    CtsArchiveFile file = {.path = s->files[i].path, .series_uid = "", .sop_uid = ""};
    CtsSlicePlace place;
    s->counts->n_files++;
    if (object->n_slices) {
        const CtsSlice *slice = object->slices[0];
        file.series_uid = slice->series_uid;
        file.sop_uid = slice->sop_uid;
        file.study_uid = slice->identity[CTS_STUDY_UID];
        file.has_number = slice->has_instance && !slice->n_frames;
        file.instance_number = slice->instance_number;
        file.place = object->n_slices == 1 && cts_slice_place(slice, &place) ? &place : NULL;
        file.is_alone = object->kind == CTS_OBJECT_NIFTI;
        file.bytes = slice->file_bytes;
        file.mtime_ns = slice->mtime_ns;
        report_archive(s->archives[i], &file);
        file.n_voxels = (uint64_t)slice->rows * (uint64_t)slice->columns * (uint64_t)object->n_slices;
        return s->asked->found(s->asked->context, &file, err);
    }
    if (header->why.status == CTS_ERR_MEMORY || header->why.status == CTS_ERR_INTERNAL)
        return cts_fail(err, header->why.status, "%s", header->why.text);
    if (header->why.status) {
        file.why = header->why.text;
        report_archive(s->archives[i], &file);
        s->counts->n_unreadable++;
        return s->asked->found(s->asked->context, &file, err);
    }
    s->counts->n_not_ct++;
    s->counts->n_objects += object->class_name && object->kind != CTS_OBJECT_DIRECTORY;
    s->counts->n_packed += object->packed != NULL;
    if (object->kind == CTS_OBJECT_LABELS) {
        file.labels_of = object->study_uid;
        return s->asked->found(s->asked->context, &file, err);
    }
    if (s->files[i].named && object->kind == CTS_OBJECT_DIRECTORY && !*directory &&
        !(*directory = strdup(s->files[i].path)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return CTS_OK;
}

/* Reads the queued files and passes them on in order. */
static CtsStatus flush(ArchiveSearch *s, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *directory = NULL;
    const size_t n = s->n;
    memset(s->headers, 0, sizeof s->headers);
    if (s->asked->stop && *s->asked->stop)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    else
        cts_file_headers_read(s->files, n, CTS_NIFTI_FORM_AUTO, s->readers, s->n_threads, s->headers);
    s->n = 0;
    for (size_t i = 0; i < n; i++) {
        if (!st)
            st = hand_on(s, i, &directory, err);
        cts_object_free(&s->headers[i].object);
    }
    cts_string_pool_free(&s->paths);
    for (int t = 0; t < s->n_threads; t++)
        cts_string_pool_free(&s->readers[t].texts);
    if (!st && directory)
        st = follow_dicomdir(s, directory, err);
    free(directory);
    return st;
}

CtsStatus cts_archive_search(const CtsArchiveSearch *asked, CtsArchiveCounts *counts, CtsError *err)
{
    *counts = (CtsArchiveCounts){0};
    ArchiveSearch *s = calloc(1, sizeof *s);
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    s->asked = asked;
    s->counts = counts;
    s->scan = (CtsScan){.found = add_file, .context = s, .kept = asked->archives};
    s->n_threads = cts_threads(asked->n_threads);
    s->readers = calloc((size_t)s->n_threads, sizeof *s->readers);
    CtsStatus st = s->readers ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    /* Path by path, so that no group holds two DICOMDIRs that were named. */
    for (int i = 0; i < asked->n_paths && !st; i++) {
        st = cts_scan_each(&s->scan, &asked->paths[i], 1, err);
        while (!st && s->n)
            st = flush(s, err);
    }
    counts->n_files += (uint64_t)s->scan.n_special + (uint64_t)s->scan.n_other;
    counts->n_not_ct += (uint64_t)s->scan.n_special + (uint64_t)s->scan.n_other;
    counts->n_unreadable += (uint64_t)s->scan.n_unreadable;
    for (size_t i = 0; i < s->scan.diagnostics.n && !st; i++)
        st = report_fault(s, s->scan.diagnostics.items[i].text, err);
    cts_string_pool_free(&s->paths);
    for (int t = 0; s->readers && t < s->n_threads; t++)
        cts_header_reader_free(&s->readers[t]);
    cts_diagnostics_free(&s->scan.diagnostics);
    free(s->readers);
    free(s);
    return st;
}
