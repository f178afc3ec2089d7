#include "ctsplat/series.h"

#include "base/cpu.h"
#include "base/parallel.h"
#include "dicom/header/slice.h"
#include "input/files/file_header.h"
#include "input/files/scan.h"
#include "input/series/single_slices.h"
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Headers that are read together before any is handed on: work for many threads, in little memory. Changes no result.
 */
enum { GROUP = 256 };

typedef struct FoundFile {
    CtsFile file;
    char *path;
    char *archive; /* path of the zip file that it is a member of, or NULL */
    CtsHeaderRead header;
} FoundFile;

typedef struct ArchiveSearch {
    const CtsArchiveSearch *asked;
    CtsArchiveCounts *counts;
    CtsScan scan;
    FoundFile group[GROUP];
    int n;
    int n_threads;
    CtsHeaderReader *readers; /* of each thread */
    bool in_directory;        /* files come from a DICOMDIR, which must not refer to another */
} ArchiveSearch;

static void read_headers(void *context, int worker, size_t first, size_t end)
{
    ArchiveSearch *const s = context;
    for (size_t i = first; i < end; i++)
        cts_file_header_add(&s->readers[worker], &s->group[i].file, CTS_NIFTI_FORM_AUTO, &s->group[i].header);
}

static CtsStatus flush(ArchiveSearch *s, CtsError *err);

static CtsStatus add_file(void *context, const CtsFile *file, const char *archive, CtsError *err)
{
    ArchiveSearch *const s = context;
    FoundFile *const f = &s->group[s->n];
    *f = (FoundFile){.file = *file, .archive = archive ? strdup(archive) : NULL};
    f->file.named &= !s->in_directory;
    f->file.path = f->path = strdup(file->path);
    s->n++;
    if (!f->path || (archive && !f->archive))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return s->n == GROUP ? flush(s, err) : CTS_OK;
}

static void free_found(FoundFile *f)
{
    cts_object_free(&f->header.object);
    free(f->path);
    free(f->archive);
}

/* An archive changes as a whole. */
static void report_archive(const FoundFile *f, CtsArchiveFile *file)
{
    struct stat info;
    if (f->archive && !stat(f->archive, &info))
        file->mtime_ns = (int64_t)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
}

static CtsStatus add_named_file(void *context, const char *path, CtsError *err)
{
    return add_file(context, &(CtsFile){.path = path}, NULL, err);
}

/* The files that a DICOMDIR names, into the next group. */
static CtsStatus follow_dicomdir(ArchiveSearch *s, const char *path, CtsError *err)
{
    CtsDirectoryCounts counts;
    char why[PATH_MAX + 100];
    s->in_directory = true;
    const CtsStatus st = cts_directory_files(path, add_named_file, s, &counts, err);
    s->in_directory = false;
    if (st || !counts.n_missing)
        return st;
    snprintf(why, sizeof why, CTS_DIRECTORY_MISSING_TEXT, path, counts.n_missing);
    s->counts->n_unreadable += counts.n_missing;
    return s->asked->found(s->asked->context,
                           &(CtsArchiveFile){.path = "", .why = why, .series_uid = "", .sop_uid = ""}, err);
}

static CtsStatus hand_on(ArchiveSearch *s, const FoundFile *f, char **directory, CtsError *err)
{
    CtsArchiveFile file = {.path = f->file.path, .series_uid = "", .sop_uid = ""};
    CtsSlicePlace place;
    s->counts->n_files++;
    if (f->header.object.n_slices) {
        const CtsSlice *slice = f->header.object.slices[0];
        file.series_uid = slice->series_uid;
        file.sop_uid = slice->sop_uid;
        file.study_uid = slice->identity[CTS_STUDY_UID];
        file.has_number = slice->has_instance && !slice->n_frames;
        file.instance_number = slice->instance_number;
        file.place = f->header.object.n_slices == 1 && cts_slice_place(slice, &place) ? &place : NULL;
        file.is_alone = f->header.kind == CTS_FILE_NIFTI;
        file.bytes = slice->file_bytes;
        file.mtime_ns = slice->mtime_ns;
        report_archive(f, &file);
        file.n_voxels = (uint64_t)slice->rows * (uint64_t)slice->columns * (uint64_t)f->header.object.n_slices;
        return s->asked->found(s->asked->context, &file, err);
    }
    if (f->header.why.status == CTS_ERR_MEMORY || f->header.why.status == CTS_ERR_INTERNAL) {
        *err = f->header.why;
        return err->status;
    }
    if (f->header.kind == CTS_FILE_UNREADABLE) {
        file.why = f->header.why.text;
        report_archive(f, &file);
        s->counts->n_unreadable++;
        return s->asked->found(s->asked->context, &file, err);
    }
    s->counts->n_not_ct++;
    s->counts->n_objects += f->header.kind == CTS_FILE_DICOM && f->header.object.kind != CTS_OBJECT_DIRECTORY;
    s->counts->n_packed += f->header.object.packed != NULL;
    if (f->header.object.kind == CTS_OBJECT_LABELS) {
        file.labels_of = f->header.object.study_uid;
        return s->asked->found(s->asked->context, &file, err);
    }
    if (f->file.named && f->header.object.kind == CTS_OBJECT_DIRECTORY && !*directory &&
        !(*directory = strdup(f->file.path)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return CTS_OK;
}

/* Reads the queued files and passes them on in order. */
static CtsStatus flush(ArchiveSearch *s, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *directory = NULL;
    const int n = s->n;
    if (s->asked->stop && *s->asked->stop)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    else
        cts_parallel(cts_file_header_threads((size_t)n, s->n_threads), (size_t)n, 8, read_headers, s);
    for (int t = 0; t < s->n_threads; t++)
        cts_header_finish(&s->readers[t]);
    s->n = 0;
    for (int i = 0; i < n; i++) {
        if (!st)
            st = hand_on(s, &s->group[i], &directory, err);
        free_found(&s->group[i]);
    }
    for (int t = 0; t < s->n_threads; t++)
        cts_string_pool_free(&s->readers[t].texts);
    if (!st && directory)
        st = follow_dicomdir(s, directory, err);
    free(directory);
    return st;
}

/* A folder that cannot be listed counts like a file that cannot be read. */
static CtsStatus report_folders(const ArchiveSearch *s, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < s->scan.diagnostics.n && !st; i++) {
        const CtsArchiveFile file = {
            .path = "", .why = s->scan.diagnostics.items[i].text, .series_uid = "", .sop_uid = ""};
        st = s->asked->found(s->asked->context, &file, err);
    }
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
    if (!st)
        st = report_folders(s, err);
    for (int i = 0; i < s->n; i++)
        free_found(&s->group[i]);
    for (int t = 0; s->readers && t < s->n_threads; t++)
        cts_header_reader_free(&s->readers[t]);
    cts_diagnostics_free(&s->scan.diagnostics);
    free(s->readers);
    free(s);
    return st;
}
