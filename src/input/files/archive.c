#include "input/files/archive.h"

#include "base/file_bytes.h"
#include "base/mem.h"
#include "dicom/protocol/pixel_sandbox.h"
#include <stdlib.h>
#include <string.h>

enum {
    RATIO = 100,                  /* limit of unpacked bytes: CT packs three to one, an empty phantom fifty to one */
    EXTRA = 64 << 20,             /* added for small files: 128 slices of 512 x 512 of one grey level */
    UNPACKING_MEMORY = 256 << 20, /* of the process: libzip's lists of up to CTS_MAX_MEMBERS */
    UNPACKING_CPU_S = 120         /* and 1 s for each 4 MiB; measured: zlib unpacks 250 MB/s, in 120 s 30 GB */
};

bool cts_archive_is_zip(const char *path)
{
    uint8_t start[4];
    CtsFileBytes file;
    if (cts_file_bytes_open(&file, &(CtsFile){.path = path}, NULL) || file.fd < 0)
        return false;
    const bool is_zip = file.n_bytes >= 22 && !cts_file_bytes_read(&file, start, sizeof start, 0, NULL) &&
                        (memcmp(start, "PK\3\4", 4) == 0 || memcmp(start, "PK\5\6", 4) == 0);
    cts_file_bytes_close(&file);
    return is_zip;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const CtsMember *)a)->name, ((const CtsMember *)b)->name);
}

/* The unpacker's output is as untrusted as the file: every length is checked. */
CtsStatus cts_archive_list(CtsArchive *a, const uint8_t *bytes, size_t n, CtsError *err)
{
    for (size_t pos = 0;;) {
        CtsMemberRecord r;
        if (pos > n || n - pos < sizeof r)
            break;
        memcpy(&r, bytes + pos, sizeof r);
        pos += sizeof r;
        if (r.n_name == 0) {
            if (a->n_members)
                qsort(a->members, (size_t)a->n_members, sizeof *a->members, by_name);
            return CTS_OK;
        }
        if (r.n_name > CTS_MEMBER_MAX_NAME || n - pos < (size_t)r.n_name + 1 || bytes[pos + r.n_name] ||
            r.n_bytes > n - pos - r.n_name - 1 || a->n_members >= CTS_MAX_MEMBERS)
            break;
        const CtsMember m = {(const char *)bytes + pos, bytes + pos + r.n_name + 1, r.n_bytes, r.is_bad != 0};
        if (m.is_bad && (m.n_bytes == 0 || m.bytes[m.n_bytes - 1]))
            break;
        pos = cts_member_aligned(pos + r.n_name + 1 + r.n_bytes);
        if (m.n_bytes == 0) {
            a->n_other++;
            continue;
        }
        if (cts_grow(&a->members, a->n_members, err))
            return CTS_ERR_MEMORY;
        a->members[a->n_members++] = m;
    }
    return cts_fail(err, CTS_ERR_READ, "cannot be unpacked");
}

static CtsStatus read_archive(CtsArchive *a, const CtsFileBytes *file, CtsError *err)
{
    const uint64_t free_bytes = cts_memory_available();
    const uint64_t n = file->n_bytes;
    uint64_t limit = n * RATIO + EXTRA;
    if (free_bytes && (n > free_bytes / 2 || limit > free_bytes / 2 - n))
        limit = n > free_bytes / 2 ? 0 : free_bytes / 2 - n;
    if (limit < CTS_MEMBER_LOOK)
        return cts_fail(err, CTS_ERR_MEMORY, "a zip file of %llu MiB cannot be held in memory (unpack it)",
                        (unsigned long long)(n >> 20));
    uint8_t *stream;
    const void *bytes;
    a->unpacker = cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_UNZIP, "unpacker");
    a->unpacker.memory_limit = UNPACKING_MEMORY;
    a->unpacker.cpu_limit_s = UNPACKING_CPU_S + (int)(n >> 22);
    CtsStatus st = cts_sandbox_room(&a->unpacker, (size_t)n, (size_t)limit, &stream, err);
    if (!st)
        st = cts_file_bytes_read(file, stream, (size_t)n, 0, err);
    if (!st) {
        cts_sandbox_send(&a->unpacker, NULL, 0, stream, (size_t)n, (size_t)limit);
        st = cts_sandbox_take(&a->unpacker, &bytes, err);
    }
    if (st == CTS_ERR_PIXELS)
        st = err->status = CTS_ERR_READ;
    cts_sandbox_end(&a->unpacker);
    return st ? st : cts_archive_list(a, bytes, (size_t)limit, err);
}

CtsStatus cts_archive_open(const char *path, CtsArchive **archive, CtsError *err)
{
    CtsFileBytes file;
    CtsError why = {0};
    CtsStatus st = cts_file_bytes_open(&file, &(CtsFile){.path = path}, &why);
    *archive = NULL;
    if (!st && file.fd < 0)
        st = cts_fail(&why, CTS_ERR_READ, "is no regular file");
    if (!st && !(*archive = calloc(1, sizeof **archive)))
        st = cts_fail(&why, CTS_ERR_MEMORY, "out of memory");
    if (!st)
        st = read_archive(*archive, &file, &why);
    cts_file_bytes_close(&file);
    if (!st)
        return CTS_OK;
    cts_archives_free(archive);
    return cts_fail(err, st, "%s: %s", path, why.text);
}

CtsStatus cts_archives_add(CtsArchives **archives, const char *path, CtsArchive *archive, CtsError *err)
{
    if (!(archive->path = strdup(path))) {
        cts_archives_free(&archive);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    archive->next = *archives;
    *archives = archive;
    return CTS_OK;
}

bool cts_archives_find(const CtsArchives *archives, const char *path, CtsFile *file)
{
    for (const CtsArchive *kept = archives; kept; kept = kept->next) {
        const size_t n = strlen(kept->path);
        if (strncmp(path, kept->path, n) || path[n] != '/')
            continue;
        const CtsMember wanted = {.name = path + n + 1};
        const CtsMember *member = bsearch(&wanted, kept->members, (size_t)kept->n_members, sizeof wanted, by_name);
        if (!member || member->is_bad)
            continue;
        *file = (CtsFile){.path = path, .memory = member->bytes, .n_memory = member->n_bytes};
        return true;
    }
    return false;
}

void cts_archives_free(CtsArchives **archives)
{
    for (CtsArchive *a = *archives, *next; a; a = next) {
        next = a->next;
        cts_sandbox_stop(&a->unpacker);
        free(a->members);
        free(a->path);
        free(a);
    }
    *archives = NULL;
}
