#include "input/labels/label_reading.h"

#include "base/text.h"
#include "dicom/parser/tag_scan.h"
#include "dicom/protocol/pixel_sandbox.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHARSET = 0x00080005, CLASS = 0x00080016 };
/* Largest number of bytes in front of the pixels, or inflated. Measured: segmentations have up to 1.5 kB for each
 * frame, so that this holds 700,000. */
static const uint64_t MAX_BYTES = 1u << 30;

bool cts_label_is_dicom(const uint8_t *head, size_t n, char class_uid[65])
{
    CtsMetaScan meta;
    const CtsScanResult result = cts_scan_meta(head, n, n, &meta);
    memcpy(class_uid, meta.sop_class_uid, sizeof meta.sop_class_uid);
    return result == CTS_SCAN_DONE || result == CTS_SCAN_MORE;
}

/* The data set up to the pixels' end, in memory. */
static CtsStatus inflate_all(CtsLabelDicom *o, CtsError *err)
{
    const size_t start = o->head.meta.data_offset, n = (size_t)(o->pixel_offset + o->pixel_bytes);
    size_t got = 0;
    if (o->encapsulated || n > MAX_BYTES)
        return cts_fail(err, CTS_ERR_READ, "its deflated data set is too large (store it uncompressed)");
    if (!(o->inflated = malloc(n + 1)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = cts_codec_inflate(&o->scratch.inflater, o->scratch.file + start, o->head.n - start,
                                           o->inflated, n, &got, err);
    o->source = cts_file_bytes_in_memory(o->inflated, got);
    return st;
}

CtsStatus cts_label_dicom_open(CtsLabelDicom *o, const CtsFile *file, CtsError *err)
{
    *o = (CtsLabelDicom){.scratch.max_header = MAX_BYTES};
    CtsDicomHeader *const h = &o->head;
    CtsStatus st = cts_dicom_header_open(h, file, &o->scratch, err);
    if (!st && h->kind != CTS_FILE_DICOM)
        st = cts_fail(err, CTS_ERR_READ, "is no DICOM file");
    if (!st && !h->syntax)
        st = cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is unknown (convert it with dcmconv)", h->syntax_uid);
    if (st)
        return st;
    o->syntax = h->syntax;
    o->elements = cts_dicom_header_elements(h);
    o->has_pixels = h->scan.has_pixels;
    o->encapsulated = h->scan.encapsulated;
    o->pixel_words = h->scan.pixel_words;
    o->pixel_offset = h->scan.pixel_offset;
    o->pixel_bytes = h->scan.pixel_bytes;
    o->source = h->file;
    snprintf(o->class_uid, sizeof o->class_uid, "%s", h->meta.sop_class_uid);
    cts_elements_text(o->elements, CLASS, o->class_uid, sizeof o->class_uid);
    cts_elements_text(o->elements, CHARSET, o->charset, sizeof o->charset);
    if (o->syntax->deflated && (st = inflate_all(o, err)))
        return st;
    const uint64_t left =
        o->has_pixels && o->pixel_offset < o->source.n_bytes ? o->source.n_bytes - o->pixel_offset : 0;
    if (o->encapsulated)
        o->pixel_bytes = left;
    return o->pixel_bytes <= left ? CTS_OK
                                  : cts_fail(err, CTS_ERR_READ, "cut short: its pixels need %llu bytes, %llu are left",
                                             (unsigned long long)o->pixel_bytes, (unsigned long long)left);
}

void cts_label_dicom_close(CtsLabelDicom *o)
{
    cts_dicom_header_close(&o->head);
    cts_scratch_free(&o->scratch);
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
    char *utf8 =
        ascii || strstr(o->charset, "ISO_IR 192") ? NULL : cts_dcm_utf8(raw, o->charset[0] ? o->charset : NULL);
    snprintf(text, size, "%s", utf8 ? utf8 : raw);
    free(utf8);
    cts_text_clean(text);
}
