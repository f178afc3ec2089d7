#define _GNU_SOURCE
#include "dicom/dcm_read.h"
#include "dicom/file_bytes.h"
#include "dicom/slice.h"
#include "dicom/tag_scan.h"

#include <stdlib.h>
#include <string.h>

enum {
    FIRST_READ = 16 << 10, /* holds most headers whole */
    MAX_DEFLATED_FILE = 16 << 20,
    FIRST_INFLATE = 64 << 10
};

/* The part of a file that has been read, from its start. */
typedef struct Head {
    CtsFileBytes file;
    CtsScratch *scratch;
    size_t n;
    uint64_t *bytes_read;
} Head;

static CtsStatus read_up_to(Head *h, uint64_t n, CtsError *err)
{
    if (n > h->file.n_bytes)
        n = h->file.n_bytes;
    if (n <= h->n)
        return CTS_OK;
    CtsStatus st = cts_bytes_reserve(&h->scratch->file, &h->scratch->file_capacity, (size_t)n, err);
    if (!st)
        st = cts_file_bytes_read(&h->file, h->scratch->file + h->n, (size_t)n - h->n, h->n, err);
    if (!st) {
        *h->bytes_read += n - h->n;
        h->n = (size_t)n;
    }
    return st;
}

/* What a look at the file's framing gave, and where its data set is in memory. */
typedef struct Framing {
    CtsMetaScan meta;
    CtsDataScan data;
    const CtsSyntax *native; /* how the elements are encoded */
    const uint8_t *data_set;
    size_t n_data_set; /* up to the pixels */
} Framing;

static CtsStatus scan_plain(Head *h, Framing *f, CtsError *err)
{
    for (;;) {
        const CtsScanResult result =
            cts_scan_data(h->scratch->file, h->n, h->file.n_bytes, f->meta.data_offset, f->native, &f->data);
        if (result == CTS_SCAN_BAD)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s", f->data.why);
        if (result == CTS_SCAN_DONE)
            break;
        if (h->n >= h->file.n_bytes)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: its header does not end");
        /* Read ahead, so that a long header costs few calls. */
        const uint64_t want = f->data.need > 4 * (uint64_t)h->n ? f->data.need : 4 * (uint64_t)h->n;
        const CtsStatus st = read_up_to(h, want, err);
        if (st)
            return st;
    }
    f->data_set = h->scratch->file + f->meta.data_offset;
    f->n_data_set = f->data.header_end - f->meta.data_offset;
    return CTS_OK;
}

/* A deflated data set is inflated only as far as its pixels, and never past the header limit. */
static CtsStatus scan_deflated(Head *h, Framing *f, CtsError *err)
{
    CtsScratch *s = h->scratch;
    if (h->file.n_bytes > MAX_DEFLATED_FILE)
        return cts_fail(err, CTS_ERR_READ, "is a deflated file of more than 16 MiB (inflate it with dcmconv +te)");
    CtsStatus st = read_up_to(h, h->file.n_bytes, err);
    for (size_t want = FIRST_INFLATE; !st; want *= 2) {
        size_t got = 0;
        if (want > CTS_MAX_HEADER_BYTES)
            return cts_fail(err, CTS_ERR_READ, "more than 64 MiB stand before the pixels");
        if ((st = cts_bytes_reserve(&s->inflated, &s->inflated_capacity, want, err)) ||
            (st = cts_inflate(s->file + f->meta.data_offset, h->n - f->meta.data_offset, 0, s->inflated, want, &got,
                              err)))
            break;
        const CtsScanResult result =
            cts_scan_data(s->inflated, got, got < want ? got : UINT64_MAX, 0, f->native, &f->data);
        if (result == CTS_SCAN_BAD || (result == CTS_SCAN_MORE && got < want))
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s",
                            result == CTS_SCAN_BAD ? f->data.why : "its header does not end");
        if (result == CTS_SCAN_DONE) {
            f->data_set = s->inflated;
            f->n_data_set = f->data.header_end;
            return CTS_OK;
        }
    }
    return st;
}

/* How the data set is encoded: as its meta header says, else as it looks. */
static CtsStatus find_syntax(const Head *h, Framing *f, CtsSlice *slice, CtsError *err)
{
    if (!f->meta.has_preamble)
        slice->odd |= CTS_ODD_NO_PREAMBLE;
    memcpy(slice->syntax_uid, f->meta.syntax_uid, sizeof slice->syntax_uid);
    slice->syntax = cts_syntax_find(f->meta.syntax_uid);
    if (!f->meta.syntax_uid[0]) {
        slice->odd |= CTS_ODD_NO_SYNTAX;
        slice->syntax = cts_scan_guess(h->scratch->file + f->meta.data_offset, h->n - f->meta.data_offset);
        if (!slice->syntax)
            return cts_fail(err, CTS_ERR_READ, "has no transfer syntax, and its data set fits none");
        memcpy(slice->syntax_uid, slice->syntax->uid, strlen(slice->syntax->uid) + 1);
    }
    f->native = slice->syntax ? cts_syntax_native(slice->syntax->explicit_vr, slice->syntax->big_endian)
                              : cts_syntax_native(true, false);
    return CTS_OK;
}

/* Walk the fragments by their lengths: the last one must be followed by the delimiter. The first item is the offset
 * table, which is often wrong and never needed. */
static void check_fragments(const Head *h, CtsSlice *slice)
{
    uint64_t pos = slice->pixel_offset, first = 0;
    for (int n = 0;; n++) {
        uint8_t item[8];
        if (h->file.n_bytes < 8 || pos > h->file.n_bytes - 8 || cts_file_bytes_read(&h->file, item, 8, pos, NULL)) {
            cts_slice_fault(slice, CTS_ERR_PIXELS, "truncated: its compressed pixels have no end");
            return;
        }
        const uint32_t length = item[4] | (uint32_t)item[5] << 8 | (uint32_t)item[6] << 16 | (uint32_t)item[7] << 24;
        if (n == 1)
            first = pos;
        if (memcmp(item, "\xfe\xff\xdd\xe0", 4) == 0)
            break;
        pos += 8;
        if (memcmp(item, "\xfe\xff\x00\xe0", 4) != 0 || length > h->file.n_bytes - pos) {
            cts_slice_fault(slice, CTS_ERR_PIXELS,
                            "truncated or damaged: a fragment of its compressed pixels does not fit");
            return;
        }
        pos += length;
    }
    if (!first || first == pos)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "its compressed pixels hold no fragment");
    slice->pixel_offset = first;
    slice->pixel_bytes = pos - first;
}

static void check_native_size(const Head *h, CtsSlice *slice)
{
    const uint64_t row = (uint64_t)slice->columns * (uint64_t)(slice->bits_allocated / 8);
    const uint64_t frame = row * (uint64_t)slice->rows, have = slice->pixel_bytes;
    if (have < frame)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData needs %llu bytes, and holds %llu", (unsigned long long)frame,
                        (unsigned long long)have);
    else if (have > frame + row && have % frame == 0)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData holds %llu frames, not one",
                        (unsigned long long)(have / frame));
    else if (have > frame + row)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData needs %llu bytes, and holds %llu", (unsigned long long)frame,
                        (unsigned long long)have);
    const uint64_t end = h->file.n_bytes - slice->pixel_offset;
    if (!slice->syntax->deflated && (slice->pixel_offset > h->file.n_bytes || end < frame))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "truncated: PixelData needs %llu bytes, %llu left",
                        (unsigned long long)frame,
                        (unsigned long long)(slice->pixel_offset > h->file.n_bytes ? 0 : end));
}

static void check_pixels(const Head *h, const Framing *f, CtsSlice *slice)
{
    const CtsSyntax *syntax = slice->syntax;
    slice->data_offset = f->meta.data_offset;
    slice->pixel_offset = f->data.pixel_offset;
    slice->pixel_bytes = f->data.pixel_bytes;
    slice->pixel_words = f->data.pixel_words;
    if (syntax && (syntax->loss == CTS_LOSSY || (syntax->loss == CTS_MAYBE_LOSSY && !slice->told_lossless)))
        slice->odd |= CTS_ODD_LOSSY;
    if (!syntax)
        cts_slice_fault(slice, CTS_ERR_SYNTAX, "transfer syntax %s is unknown (convert it with gdcmconv --raw)",
                        slice->syntax_uid);
    else if (syntax->codec == CTS_CODEC_NONE)
        cts_slice_fault(slice, CTS_ERR_SYNTAX,
                        "transfer syntax %s (%s) cannot be decoded by this build (convert it with gdcmconv --raw)",
                        syntax->uid, syntax->name);
    if (slice->fault)
        return;
    if (f->data.float_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "Float Pixel Data (7FE0,0008) is no CT Image Storage pixel data");
    else if (!f->data.has_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData (7FE0,0010) is missing");
    else if (f->data.encapsulated != cts_syntax_encapsulated(syntax))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData is %scompressed, but its transfer syntax is %s",
                        f->data.encapsulated ? "" : "not ", syntax->name);
    else if (f->data.encapsulated)
        check_fragments(h, slice);
    else
        check_native_size(h, slice);
}

/* Open, recognise and scan; *kind is CTS_FILE_DICOM when f is filled. */
static CtsStatus open_and_scan(Head *h, const char *path, Framing *f, CtsSlice *slice, CtsFileKind *kind, CtsError *err)
{
    *kind = CTS_FILE_NOT_DICOM;
    CtsStatus st = cts_file_bytes_open(&h->file, path, err);
    if (st || h->file.fd < 0)
        return st;
    if ((st = read_up_to(h, FIRST_READ, err)))
        return st;
    CtsScanResult result;
    while ((result = cts_scan_meta(h->scratch->file, h->n, h->file.n_bytes, &f->meta)) == CTS_SCAN_MORE) {
        if (h->n >= h->file.n_bytes)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: its meta header does not end");
        if ((st = read_up_to(h, f->meta.need, err)))
            return st;
    }
    if (result == CTS_SCAN_NOT_DICOM)
        return CTS_OK;
    if (result == CTS_SCAN_BAD)
        return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s", f->meta.why);
    if ((st = find_syntax(h, f, slice, err)))
        return st;
    if ((st = slice->syntax && slice->syntax->deflated ? scan_deflated(h, f, err) : scan_plain(h, f, err)))
        return st;
    *kind = CTS_FILE_DICOM;
    return CTS_OK;
}

CtsFileKind cts_slice_read_header(const char *path, CtsScratch *scratch, CtsSlice *slice, uint64_t *bytes_read,
                                  CtsError *err)
{
    Head h = {.file = {.fd = -1}, .scratch = scratch, .bytes_read = bytes_read};
    Framing f;
    CtsFileKind kind;
    CtsStatus st = open_and_scan(&h, path, &f, slice, &kind, err);
    if (!st && kind == CTS_FILE_DICOM)
        st = cts_dcm_read_header(f.data_set, f.n_data_set, &f.data, f.native, f.meta.sop_class_uid, slice, err);
    if (!st && kind == CTS_FILE_DICOM && (slice->kind == CTS_OBJECT_CT || slice->kind == CTS_OBJECT_ENHANCED)) {
        slice->file_bytes = h.file.n_bytes;
        slice->mtime_ns = h.file.mtime_ns;
        if (!(slice->path = strdup(path)))
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        if (!st && slice->kind == CTS_OBJECT_CT)
            check_pixels(&h, &f, slice);
    }
    cts_file_bytes_close(&h.file);
    return st ? CTS_FILE_UNREADABLE : kind;
}

/* folder of `directory` + '/' + file; where that is missing, the lower-case name that some CD drives show. */
static char *file_beside(const char *directory, const char *file)
{
    const char *slash = strrchr(directory, '/');
    const size_t n = slash ? (size_t)(slash - directory) + 1 : 0;
    char *path = malloc(n + strlen(file) + 1);
    if (!path)
        return NULL;
    memcpy(path, directory, n);
    memcpy(path + n, file, strlen(file) + 1);
    CtsFileBytes probe;
    if (cts_file_bytes_open(&probe, path, NULL))
        for (char *c = path + n; *c; c++)
            if (*c >= 'A' && *c <= 'Z')
                *c = (char)(*c - 'A' + 'a');
    cts_file_bytes_close(&probe);
    return path;
}

CtsStatus cts_slice_read_directory(const char *path, CtsScratch *scratch, char ***files, size_t *n_files,
                                   size_t *n_refused, CtsError *err)
{
    uint64_t bytes_read = 0;
    Head h = {.file = {.fd = -1}, .scratch = scratch, .bytes_read = &bytes_read};
    Framing f;
    CtsFileKind kind;
    CtsSlice slice = {0};
    *files = NULL;
    *n_files = 0;
    CtsStatus st = open_and_scan(&h, path, &f, &slice, &kind, err);
    if (!st && kind != CTS_FILE_DICOM)
        st = cts_fail(err, CTS_ERR_READ, "is not a DICOMDIR");
    if (!st)
        st = cts_dcm_directory(f.data_set, f.n_data_set, f.native, files, n_files, n_refused, err);
    for (size_t i = 0; !st && i < *n_files; i++) {
        char *whole = file_beside(path, (*files)[i]);
        if (!whole) {
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
            break;
        }
        free((*files)[i]);
        (*files)[i] = whole;
    }
    cts_file_bytes_close(&h.file);
    return st;
}
