#include "dicom/header/dicom_header.h"

#include "dicom/protocol/pixel_sandbox.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    FIRST_READ = 16 << 10,        /* measured: holds 376 of the headers of 379 files whole */
    MAX_DEFLATED_FILE = 16 << 20, /* read whole for its header; a slice of 512 x 512 is 0.5 MB */
    FIRST_INFLATE = 64 << 10      /* holds most headers; doubled where it does not */
};

void cts_scratch_free(CtsScratch *scratch)
{
    free(scratch->file);
    free(scratch->inflated);
    cts_string_pool_free(&scratch->texts);
    cts_sandbox_free(&scratch->inflater);
    *scratch = (CtsScratch){0};
}

static CtsStatus read_up_to(CtsDicomHeader *h, uint64_t n, CtsError *err)
{
    if (n > h->file.n_bytes)
        n = h->file.n_bytes;
    if (n <= h->n)
        return CTS_OK;
    CtsStatus st = cts_bytes_reserve(&h->scratch->file, &h->scratch->file_capacity, (size_t)n, err);
    if (!st)
        st = cts_file_bytes_read(&h->file, h->scratch->file + h->n, (size_t)n - h->n, h->n, err);
    if (!st)
        h->n = (size_t)n;
    return st;
}

static size_t max_header(const CtsDicomHeader *h)
{
    return h->scratch->max_header ? h->scratch->max_header : CTS_MAX_HEADER_BYTES;
}

static CtsStatus scan_plain(CtsDicomHeader *h, CtsError *err)
{
    for (;;) {
        const CtsScanResult result = cts_scan_data(h->scratch->file, h->n, h->file.n_bytes, h->meta.data_offset,
                                                   h->data_set.native, max_header(h), &h->scan);
        if (result == CTS_SCAN_BAD)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s", h->scan.why);
        if (result == CTS_SCAN_DONE)
            break;
        if (h->n >= h->file.n_bytes)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: its header does not end");
        /* Read ahead, so that a long header costs few calls. */
        const uint64_t want = h->scan.need > 4 * (uint64_t)h->n ? h->scan.need : 4 * (uint64_t)h->n;
        const CtsStatus st = read_up_to(h, want, err);
        if (st)
            return st;
    }
    h->data_set.bytes = h->scratch->file + h->meta.data_offset;
    h->data_set.n = h->scan.header_end - h->meta.data_offset;
    return CTS_OK;
}

/* The data set's first `want` bytes, inflated in a sandbox and copied, so that they cannot change while they are
 * parsed. */
static CtsStatus inflate_head(const CtsDicomHeader *h, size_t want, size_t *got, CtsError *err)
{
    CtsScratch *s = h->scratch;
    const size_t start = h->meta.data_offset;
    const CtsStatus st = cts_bytes_reserve(&s->inflated, &s->inflated_capacity, want, err);
    return st ? st : cts_codec_inflate(&s->inflater, s->file + start, h->n - start, s->inflated, want, got, err);
}

/* A deflated data set is inflated only up to its pixels, within the header limit. */
static CtsStatus scan_deflated(CtsDicomHeader *h, CtsError *err)
{
    CtsScratch *s = h->scratch;
    if (h->file.n_bytes > MAX_DEFLATED_FILE)
        return cts_fail(err, CTS_ERR_READ, "is a deflated file of more than 16 MiB (inflate it with dcmconv +te)");
    CtsStatus st = read_up_to(h, h->file.n_bytes, err);
    for (size_t want = FIRST_INFLATE; !st; want *= 2) {
        size_t got = 0;
        if (want > CTS_MAX_HEADER_BYTES)
            return cts_fail(err, CTS_ERR_READ, "more than 64 MiB precede the pixels");
        if ((st = inflate_head(h, want, &got, err)))
            break;
        const CtsScanResult result = cts_scan_data(s->inflated, got, got < want ? got : UINT64_MAX, 0,
                                                   h->data_set.native, CTS_MAX_HEADER_BYTES, &h->scan);
        if (result == CTS_SCAN_BAD || (result == CTS_SCAN_MORE && got < want))
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s",
                            result == CTS_SCAN_BAD ? h->scan.why : "its header does not end");
        if (result == CTS_SCAN_DONE) {
            h->data_set.bytes = s->inflated;
            h->data_set.n = h->scan.header_end;
            return CTS_OK;
        }
    }
    return st;
}

/* The encoding of the data set: by its meta header, else by detection. */
static CtsStatus find_syntax(CtsDicomHeader *h, CtsError *err)
{
    if (!h->meta.has_preamble)
        h->odd |= CTS_ODD_NO_PREAMBLE;
    h->syntax_uid = h->meta.syntax_uid;
    h->syntax = cts_syntax_find(h->syntax_uid);
    if (!*h->syntax_uid) {
        h->odd |= CTS_ODD_NO_SYNTAX;
        h->syntax = cts_scan_guess(h->scratch->file + h->meta.data_offset, h->n - h->meta.data_offset);
        if (!h->syntax)
            return cts_fail(err, CTS_ERR_READ, "has no transfer syntax, and its data set fits none");
        h->syntax_uid = h->syntax->uid;
    }
    h->data_set.scan = &h->scan;
    /* One that is unknown hides the pixels, hardly ever the header. */
    const CtsSyntax *looks =
        h->syntax ? h->syntax : cts_scan_guess(h->scratch->file + h->meta.data_offset, h->n - h->meta.data_offset);
    h->data_set.native =
        looks ? cts_syntax_native(looks->explicit_vr, looks->big_endian) : cts_syntax_native(true, false);
    return CTS_OK;
}

/* Apparent damage is in fact an unknown encoding. */
static CtsStatus unknown_syntax(const CtsDicomHeader *h, CtsError *err)
{
    if (!*h->syntax_uid)
        return CTS_ERR_READ;
    return cts_fail(err, CTS_ERR_READ, "transfer syntax %s is unknown (convert it with gdcmconv --raw)", h->syntax_uid);
}

static CtsStatus read_whole_header(CtsDicomHeader *h, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsScanResult result;
    while ((result = cts_scan_meta(h->scratch->file, h->n, h->file.n_bytes, &h->meta)) == CTS_SCAN_MORE) {
        if (h->n >= h->file.n_bytes)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: its meta header does not end");
        if ((st = read_up_to(h, h->meta.need, err)))
            return st;
    }
    if (result == CTS_SCAN_NOT_DICOM)
        return CTS_OK;
    if (result == CTS_SCAN_BAD)
        return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s", h->meta.why);
    if ((st = find_syntax(h, err)) ||
        (st = h->syntax && h->syntax->deflated ? scan_deflated(h, err) : scan_plain(h, err)))
        return st == CTS_ERR_READ && !h->syntax ? unknown_syntax(h, err) : st;
    h->kind = CTS_FILE_DICOM;
    return CTS_OK;
}

CtsStatus cts_dicom_header_open(CtsDicomHeader *h, const CtsFile *source, CtsScratch *scratch, CtsError *err)
{
    CtsStatus st = CTS_OK;
    *h = (CtsDicomHeader){.file = {.fd = -1}, .kind = CTS_FILE_NOT_DICOM, .scratch = scratch};
    if (source->memory)
        h->file = cts_file_bytes_in_memory(source->memory, source->n_memory);
    else
        st = cts_file_bytes_open(&h->file, source->path, err);
    if (st || h->file.fd < 0 || (st = read_up_to(h, FIRST_READ, err)))
        return st;
    return read_whole_header(h, err);
}

void cts_dicom_header_close(CtsDicomHeader *h)
{
    cts_file_bytes_close(&h->file);
}

CtsElements cts_dicom_header_elements(const CtsDicomHeader *h)
{
    const CtsDataSet *const set = &h->data_set;
    return (CtsElements){.at = set->bytes,
                         .end = set->bytes + set->n,
                         .explicit_vr = set->native->explicit_vr,
                         .big_endian = set->native->big_endian};
}

CtsStatus cts_slice_header_open(CtsSliceHeader *h, const CtsSlice *slice, CtsError *err)
{
    CtsFileBytes now;
    *h = (CtsSliceHeader){.head.file.fd = -1};
    CtsStatus st = cts_slice_open(slice, &now, err);
    cts_file_bytes_close(&now);
    if (!st)
        st = cts_dicom_header_open(&h->head, &(CtsFile){slice->path, false, slice->memory, slice->file_bytes},
                                   &h->scratch, err);
    return st ? cts_context(err, "%s", slice->path) : st;
}

void cts_slice_header_close(CtsSliceHeader *h)
{
    cts_dicom_header_close(&h->head);
    cts_scratch_free(&h->scratch);
}

CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err)
{
    CtsScratch scratch = {0};
    CtsDicomHeader head;
    *ids = (CtsDcmIds){0};
    CtsStatus st = cts_dicom_header_open(&head, &(CtsFile){.path = path}, &scratch, err);
    if (!st && head.kind != CTS_FILE_DICOM)
        st = cts_fail(err, CTS_ERR_READ, "is no DICOM file");
    if (!st) {
        cts_elements_text(cts_dicom_header_elements(&head), 0x00080016, ids->class_uid, sizeof ids->class_uid);
        cts_elements_text(cts_dicom_header_elements(&head), 0x00080018, ids->sop_uid, sizeof ids->sop_uid);
        snprintf(ids->syntax_uid, sizeof ids->syntax_uid, "%s", head.syntax_uid);
    }
    cts_dicom_header_close(&head);
    cts_scratch_free(&scratch);
    return st ? cts_context(err, "%s", path) : st;
}
