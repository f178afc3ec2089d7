#include "input/files/file_header.h"

#include "base/parallel.h"
#include <string.h>

/* The packing program of a file that is not DICOM, by its first bytes. */
static const char *packer_of(const uint8_t *bytes, size_t n)
{
    static const struct {
        const char *name, *magic;
    } packers[] = {{"gzip", "\x1f\x8b\x08"},
                   {"bzip2", "BZh"},
                   {"xz", "\xfd"
                          "7zXZ"},
                   {"zstd", "\x28\xb5\x2f\xfd"},
                   {"zip", "PK\3\4"}};
    for (size_t i = 0; i < sizeof packers / sizeof *packers; i++)
        if (n >= strlen(packers[i].magic) && memcmp(bytes, packers[i].magic, strlen(packers[i].magic)) == 0)
            return packers[i].name;
    return NULL;
}

static CtsStatus read_nifti_header(const CtsFile *source, const CtsFileBytes *file, CtsNiftiForm form,
                                   CtsHeaderRead *result)
{
    result->kind = CTS_FILE_NIFTI;
    /* In a folder it may be a mask or a picture of anything. */
    if (source->named)
        return cts_nifti_slices(source, file, form, &result->object, &result->why);
    result->object.packed = "NIfTI";
    return CTS_OK;
}

/* Opens a file and queues its header; cts_header_finish() completes the result. */
static void add_file_header(CtsHeaderReader *reader, const CtsFile *source, CtsNiftiForm form, CtsHeaderRead *result)
{
    CtsFileBytes file;
    const uint8_t *bytes;
    size_t n;
    *result = (CtsHeaderRead){.kind = CTS_FILE_NOT_DICOM};
    CtsStatus st = cts_header_begin(reader, source, &file, &bytes, &n, &result->why);
    if (!st && n && cts_nifti_slices_are(source->path, bytes, n))
        st = read_nifti_header(source, &file, form, result);
    else if (!st && n && !cts_header_add(reader, source, &file, n, result))
        result->object.packed = packer_of(bytes, n);
    cts_file_bytes_close(&file);
    if (!st)
        return;
    cts_object_free(&result->object);
    result->kind = CTS_FILE_UNREADABLE;
}

typedef struct HeaderReading {
    const CtsFile *files;
    CtsNiftiForm form;
    CtsHeaderReader *readers; /* of each thread */
    CtsHeaderRead *results;
} HeaderReading;

static void read_some_headers(void *context, int worker, size_t first, size_t end)
{
    const HeaderReading *const r = context;
    for (size_t i = first; i < end; i++)
        add_file_header(&r->readers[worker], &r->files[i], r->form, &r->results[i]);
}

void cts_file_headers_read(const CtsFile *files, size_t n, CtsNiftiForm form, CtsHeaderReader *readers, int n_threads,
                           CtsHeaderRead *results)
{
    enum { FEW = 100 }; /* files for one thread: a reader's process starts in the time of some 30 headers */
    HeaderReading reading = {files, form, readers, results};
    cts_parallel(n < FEW ? 1 : n_threads, n, 8, read_some_headers, &reading);
    for (int t = 0; t < n_threads; t++)
        cts_header_finish(&readers[t]);
}
