#include "input/labels/label_reading.h"

#include "base/mem.h"
#include "base/text.h"
#include "dicom/codec/pixels.h"
#include "dicom/header/utf8.h"
#include "dicom/protocol/dicom_begin.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHARSET = 0x00080005, CLASS = 0x00080016 };
/* Largest number of bytes in front of the pixels, or inflated. Measured: segmentations have up to 1.5 kB for each
 * frame, so that this holds 170,000. */
static const uint64_t MAX_BYTES = 1u << 28;

bool cts_label_is_dicom(const uint8_t *head, size_t n, char class_uid[65])
{
    CtsMetaScan meta;
    const CtsScanResult result = cts_scan_meta(head, n, n, &meta);
    memcpy(class_uid, meta.sop_class_uid, sizeof meta.sop_class_uid);
    return result == CTS_SCAN_DONE || result == CTS_SCAN_MORE;
}

/* The pixels of a deflated data set, in memory. */
static CtsStatus inflate_pixels(CtsLabelDicom *o, CtsError *err)
{
    const CtsFrameFormat all = {.syntax = o->head.syntax,
                                .columns = (int)o->pixels.n_bytes,
                                .rows = 1,
                                .bits_allocated = 8,
                                .n_before = o->pixels.offset};
    const CtsFileBytes *const file = &o->head.file;
    CtsSandbox inflater = cts_codec_make();
    const void *pixels;
    if (o->pixels.encapsulated || o->pixels.n_bytes > MAX_BYTES)
        return cts_fail(err, CTS_ERR_READ, "its deflated data set is too large (store it uncompressed)");
    CtsStatus st = cts_codec_submit(&inflater, &all, file, o->head.facts.data_offset, file->n_bytes, err);
    if (!st && !(st = cts_sandbox_take(&inflater, &pixels, err)) &&
        !(o->inflated = malloc((size_t)o->pixels.n_bytes + 1)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st) {
        memcpy(o->inflated, pixels, (size_t)o->pixels.n_bytes);
        o->source = cts_file_bytes_in_memory(o->inflated, o->pixels.n_bytes);
        o->pixels.offset = 0;
    }
    cts_sandbox_stop(&inflater);
    return st;
}

CtsStatus cts_label_dicom_open(CtsLabelDicom *o, const CtsFile *file, CtsError *err)
{
    const CtsHeaderFacts *const facts = &o->head.facts;
    *o = (CtsLabelDicom){.inflated = NULL};
    CtsStatus st = cts_dicom_object_open(&o->head, file, MAX_BYTES, err);
    if (!st && !o->head.syntax)
        st =
            cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is unknown (convert it with dcmconv)", facts->syntax_uid);
    if (st)
        return st;
    o->pixels = facts->pixels;
    o->source = o->head.file;
    if (!cts_elements_text(o->head.elements, CLASS, o->class_uid, sizeof o->class_uid))
        cts_elements_text(o->head.elements, CTS_TAG_META_CLASS, o->class_uid, sizeof o->class_uid);
    cts_elements_text(o->head.elements, CHARSET, o->charset, sizeof o->charset);
    if (o->head.syntax->deflated && o->pixels.n_bytes && (st = inflate_pixels(o, err)))
        return st;
    const uint64_t left =
        o->pixels.found && o->pixels.offset < o->source.n_bytes ? o->source.n_bytes - o->pixels.offset : 0;
    if (o->pixels.encapsulated)
        o->pixels.n_bytes = left;
    return o->pixels.n_bytes <= left
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "cut short: its pixels need %llu bytes, %llu are left",
                          (unsigned long long)o->pixels.n_bytes, (unsigned long long)left);
}

void cts_label_dicom_close(CtsLabelDicom *o)
{
    cts_dicom_object_close(&o->head);
    free(o->inflated);
    *o = (CtsLabelDicom){.head.file.fd = -1};
}

void cts_label_dicom_text(const CtsLabelDicom *o, CtsElements elements, uint32_t tag, char *text, size_t size)
{
    char raw[512];
    bool ascii = true;
    cts_elements_text(elements, tag, raw, sizeof raw);
    for (const char *p = raw; *p; p++)
        ascii &= (unsigned char)*p < 0x80 && *p != 0x1B;
    char *utf8 = ascii || strstr(o->charset, "ISO_IR 192") ? NULL : cts_dcm_utf8(raw, o->charset);
    snprintf(text, size, "%s", utf8 ? utf8 : raw);
    free(utf8);
    cts_text_clean(text);
}
