/* Members of a zip file, by libzip. */
#include "dicom/pixels/pixel_tasks.h"

#include "dicom/protocol/dicom_begin.h"
#include <string.h>
#include <zip.h>

enum { MAX_READ = 64 << 20 }; /* of one call */

/* The answer. */
typedef struct Writer {
    uint8_t *bytes;
    size_t n, pos;
} Writer;

/* Unpack one member behind its name; a text instead where that fails. False when there is no room. */
static bool unpack(Writer *w, zip_t *zip, zip_uint64_t index, const char *name)
{
    const size_t n_name = strnlen(name, CTS_MEMBER_MAX_NAME), start = w->pos + sizeof(CtsMemberRecord) + n_name + 1;
    CtsMemberRecord r = {0, (uint32_t)n_name, 0};
    if (start + CTS_MEMBER_LOOK > w->n)
        return false;
    memcpy(w->bytes + w->pos + sizeof r, name, n_name);
    w->bytes[start - 1] = 0;
    size_t end = start;
    zip_file_t *file = zip_fopen_index(zip, index, 0);
    const char *why = file ? NULL : zip_strerror(zip);
    while (file && !why) {
        const size_t room = w->n - end;
        const zip_int64_t got = zip_fread(file, w->bytes + end, room < MAX_READ ? room : MAX_READ);
        if (got < 0)
            why = zip_file_strerror(file);
        if (got <= 0)
            break;
        const bool first = end == start;
        end += (size_t)got;
        if (end == w->n)
            return false;
        CtsMetaScan scan;
        if (first && cts_scan_meta(w->bytes + start, end - start, UINT64_MAX, &scan) == CTS_SCAN_NOT_DICOM)
            end = start;
        if (first && end == start)
            break;
    }
    if (why) {
        const size_t n_why = strnlen(why, CTS_MEMBER_LOOK - 1);
        memcpy(w->bytes + start, why, n_why);
        w->bytes[start + n_why] = 0;
        end = start + n_why + 1;
        r.is_bad = 1;
    }
    if (file)
        zip_fclose(file);
    r.n_bytes = end - start;
    memcpy(w->bytes + w->pos, &r, sizeof r);
    w->pos = cts_member_aligned(end);
    return true;
}

static CtsStatus unpack_members(Writer *w, zip_t *zip, CtsError *err)
{
    const zip_int64_t n_members = zip_get_num_entries(zip, 0);
    if (n_members > CTS_MAX_MEMBERS)
        return cts_fail(err, CTS_ERR_PIXELS, "holds more than %d files", CTS_MAX_MEMBERS);
    for (zip_int64_t i = 0; i < n_members; i++) {
        const char *name = zip_get_name(zip, (zip_uint64_t)i, ZIP_FL_ENC_RAW);
        if (!name || !*name || name[strlen(name) - 1] == '/')
            continue;
        if (!unpack(w, zip, (zip_uint64_t)i, name))
            return cts_fail(err, CTS_ERR_PIXELS, "holds more than %zu MiB (unpack it, and name the folder)",
                            w->n >> 20);
    }
    const CtsMemberRecord end = {0};
    memcpy(w->bytes + w->pos, &end, sizeof end);
    return CTS_OK;
}

CtsStatus cts_pixels_unzip(const void *order, const uint8_t *stream, size_t n, void *room, size_t n_room, CtsError *err)
{
    (void)order;
    Writer w = {room, n_room - sizeof(CtsMemberRecord) - CTS_MEMBER_ALIGNMENT, 0};
    zip_error_t why;
    zip_error_init(&why);
    zip_source_t *source = zip_source_buffer_create(stream, n, 0, &why);
    zip_t *zip = source ? zip_open_from_source(source, ZIP_RDONLY | ZIP_CHECKCONS, &why) : NULL;
    if (!zip) {
        cts_fail(err, CTS_ERR_PIXELS, "is no sound zip file: %s", zip_error_strerror(&why));
        zip_source_free(source);
        zip_error_fini(&why);
        return CTS_ERR_PIXELS;
    }
    const CtsStatus st = unpack_members(&w, zip, err);
    zip_discard(zip);
    return st;
}
