#include "input/labels/plain_object.h"

#include "base/mem.h"
#include "base/text.h"
#include "input/files/tag_scan.h"
#include "input/header/dcm_read.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_BYTES = 1 << 20, PIXELS = 0x7FE00010, CHARSET = 0x00080005, CLASS = 0x00080016 };
static const uint64_t MOST_BYTES = 1u << 30; /* in front of the pixels, or inflated */

bool cts_plain_is_dicom(const uint8_t *head, size_t n, char class_uid[65])
{
    CtsMetaScan meta;
    const CtsScanResult result = cts_scan_meta(head, n, n, &meta);
    memcpy(class_uid, meta.sop_class_uid, sizeof meta.sop_class_uid);
    return result == CTS_SCAN_DONE || result == CTS_SCAN_MORE;
}

/* Walks what is there of the header. True at its end: the pixels, or the end of the data set. */
static bool walk(CtsPlainObject *o, size_t start, size_t n)
{
    CtsElements rest = {.at = o->header + start, .end = o->header + n, .explicit_vr = o->syntax->explicit_vr};
    CtsElement e;
    o->elements = rest;
    while (rest.at < rest.end) {
        CtsRawElement raw;
        const uint8_t *const here = rest.at;
        if (cts_read_element(here, (size_t)(rest.end - here), rest.explicit_vr, false, &raw) && raw.tag == PIXELS) {
            o->has_pixels = true;
            o->encapsulated = raw.length == UINT32_MAX;
            o->pixel_offset = (uint64_t)(here - o->header) + raw.n_bytes;
            o->pixel_bytes = raw.length;
            o->elements.end = here;
            return true;
        }
        if (!cts_elements_next(&rest, &e)) {
            /* Up to 7 bytes of padding may follow the last element. */
            o->elements.end = here;
            return n >= o->source.n_bytes && rest.end - here < 8;
        }
    }
    return n >= o->source.n_bytes;
}

static CtsStatus inflate_all(CtsPlainObject *o, size_t start, CtsError *err)
{
    CtsStatus st;
    uint8_t *deflated = NULL, *inflated = NULL;
    size_t deflated_room = 0, room = 0, got = 0;
    const size_t n = (size_t)o->file->n_bytes - start;
    if ((st = cts_bytes_reserve(&deflated, &deflated_room, n, err)) ||
        (st = cts_file_bytes_read(o->file, deflated, n, start, err)))
        goto end;
    for (size_t wanted = 4 * n + 4096; !st; wanted *= 4) {
        if (wanted > MOST_BYTES)
            st = cts_fail(err, CTS_ERR_READ, "its deflated data set is too large (store it uncompressed)");
        else if (!(st = cts_bytes_reserve(&inflated, &room, wanted, err)))
            st = cts_inflate(deflated, n, 0, inflated, wanted, &got, err);
        if (!st && got < wanted)
            break;
    }
end:
    free(deflated);
    free(o->header);
    o->header = inflated;
    o->source = cts_file_bytes_in_memory(inflated, got);
    return st;
}

static CtsStatus read_header(CtsPlainObject *o, size_t start, CtsError *err)
{
    for (uint64_t n = FIRST_BYTES;; n *= 2) {
        CtsStatus st;
        n = n < o->file->n_bytes ? n : o->file->n_bytes;
        if (n > MOST_BYTES)
            return cts_fail(err, CTS_ERR_READ, "more than 1 GiB stands before its pixels");
        if ((st = cts_bytes_reserve(&o->header, &o->capacity, (size_t)n, err)) ||
            (st = cts_file_bytes_read(o->file, o->header, (size_t)n, 0, err)))
            return st;
        if (walk(o, start, (size_t)n))
            return CTS_OK;
        if (n == o->file->n_bytes)
            return cts_fail(err, CTS_ERR_READ, "is damaged or cut short: an element reaches past its end");
    }
}

/* Transfer syntax, and where the data set begins. */
static CtsStatus read_meta(CtsPlainObject *o, size_t *start, CtsError *err)
{
    CtsStatus st;
    CtsMetaScan meta;
    CtsScanResult result = CTS_SCAN_MORE;
    for (size_t n = 4096; result == CTS_SCAN_MORE; n = meta.need) {
        n = n < o->file->n_bytes ? n : (size_t)o->file->n_bytes;
        if ((st = cts_bytes_reserve(&o->header, &o->capacity, n, err)) ||
            (st = cts_file_bytes_read(o->file, o->header, n, 0, err)))
            return st;
        result = cts_scan_meta(o->header, n, o->file->n_bytes, &meta);
        if (result == CTS_SCAN_DONE)
            o->syntax = meta.syntax_uid[0] ? cts_syntax_find(meta.syntax_uid)
                                           : cts_scan_guess(o->header + meta.data_offset, n - meta.data_offset);
    }
    if (result != CTS_SCAN_DONE)
        return cts_fail(err, CTS_ERR_READ, "%s", meta.why[0] ? meta.why : "is no DICOM file");
    snprintf(o->syntax_uid, sizeof o->syntax_uid, "%s", meta.syntax_uid);
    snprintf(o->class_uid, sizeof o->class_uid, "%s", meta.sop_class_uid);
    *start = meta.data_offset;
    if (!o->syntax || o->syntax->big_endian)
        return cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is not read for labels (convert it with dcmconv)",
                        meta.syntax_uid[0] ? meta.syntax_uid : "unknown");
    return CTS_OK;
}

CtsStatus cts_plain_open(CtsPlainObject *o, const CtsFileBytes *file, CtsError *err)
{
    size_t start = 0;
    *o = (CtsPlainObject){.file = file, .source = *file};
    CtsStatus st = read_meta(o, &start, err);
    if (st)
        return st;
    if (!o->syntax->deflated)
        st = read_header(o, start, err);
    else if (!(st = inflate_all(o, start, err)) && !walk(o, 0, (size_t)o->source.n_bytes))
        st = cts_fail(err, CTS_ERR_READ, "its deflated data set is damaged");
    if (!st && !cts_elements_are_sound(o->elements))
        st = cts_fail(err, CTS_ERR_READ, "its data set is damaged: a sequence cannot be followed");
    if (st)
        return st;
    cts_elements_text(o->elements, CLASS, o->class_uid, sizeof o->class_uid);
    cts_elements_text(o->elements, CHARSET, o->charset, sizeof o->charset);
    const uint64_t left = o->has_pixels ? o->source.n_bytes - o->pixel_offset : 0;
    if (o->encapsulated)
        o->pixel_bytes = left;
    return o->pixel_bytes <= left ? CTS_OK
                                  : cts_fail(err, CTS_ERR_READ, "cut short: its pixels need %llu bytes, %llu are left",
                                             (unsigned long long)o->pixel_bytes, (unsigned long long)left);
}

void cts_plain_close(CtsPlainObject *o)
{
    free(o->header);
    *o = (CtsPlainObject){0};
}

void cts_plain_text(const CtsPlainObject *o, CtsElements elements, uint32_t tag, char *text, size_t size)
{
    char raw[512];
    bool ascii = true;
    cts_elements_text(elements, tag, raw, sizeof raw);
    for (const char *p = raw; *p; p++)
        ascii &= (unsigned char)*p < 0x80 && *p != 0x1B;
    char *utf8 =
        ascii || strstr(o->charset, "ISO_IR 192") ? NULL : cts_dcm_utf8(raw, o->charset[0] ? o->charset : NULL);
    snprintf(text, size, "%s", utf8 ? utf8 : raw);
    free(utf8);
    cts_text_clean(text);
}
