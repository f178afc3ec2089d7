/* DICOMDIR records -> file names. */
#include "dicom/header/dicom_object.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RECORDS = 0x00041220, FILE_ID = 0x00041500 };

/* A file ID is untrusted: it must name a file below the DICOMDIR's own folder. Its components are joined in place. */
static bool make_relative(char *id)
{
    char *to = id;
    for (const char *part = id, *end; part; part = *end ? end + 1 : NULL) {
        end = strchrnul(part, '\\');
        size_t n = (size_t)(end - part);
        while (n && part[n - 1] == ' ')
            n--;
        if (!n || (n == 1 && part[0] == '.') || (n == 2 && !memcmp(part, "..", 2)) || memchr(part, '/', n))
            return false;
        if (to != id)
            *to++ = '/';
        memmove(to, part, n);
        to += n;
    }
    *to = 0;
    return true;
}

CtsStatus cts_slice_read_directory(const char *path, cts_named_file_fn found, void *context, size_t *n_refused,
                                   CtsError *err)
{
    CtsDicomObject object;
    CtsElement records;
    CtsElements record;
    const char *const slash = strrchr(path, '/');
    const int n_folder = slash ? (int)(slash - path) + 1 : 0;
    *n_refused = 0;
    CtsStatus st = cts_dicom_object_open(&object, &(CtsFile){.path = path}, CTS_MAX_HEADER_BYTES, err);
    if (!st && !cts_elements_get(object.elements, RECORDS, &records))
        st = cts_fail(err, CTS_ERR_READ, "cannot be read as a DICOMDIR (name the folder instead)");
    if (st)
        cts_context(err, "%s", path);
    while (!st && cts_items_next(&records.value, &record)) {
        char id[256];
        if (!cts_elements_text(record, FILE_ID, id, sizeof id))
            continue;
        if (!make_relative(id)) {
            ++*n_refused;
            continue;
        }
        char *file;
        if (asprintf(&file, "%.*s%s", n_folder, path, id) < 0) {
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
            break;
        }
        st = found(context, file, err);
        free(file);
    }
    cts_dicom_object_close(&object);
    return st;
}
