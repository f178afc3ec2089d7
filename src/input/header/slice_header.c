#define _GNU_SOURCE
#include "base/sandbox.h"
#include "input/files/file_bytes.h"
#include "input/files/scan.h"
#include "input/files/tag_scan.h"
#include "input/header/dcm_readers.h"
#include "input/header/nifti_slices.h"
#include "input/header/pixel_places.h"

#include <stdlib.h>
#include <string.h>

enum {
    FIRST_READ = 16 << 10, /* holds most headers whole */
    MAX_DEFLATED_FILE = 16 << 20,
    FIRST_INFLATE = 64 << 10
};

void cts_scratch_free(CtsScratch *scratch)
{
    free(scratch->file);
    free(scratch->inflated);
    cts_texts_free(&scratch->texts);
    cts_sandbox_free(&scratch->inflater);
    *scratch = (CtsScratch){0};
}

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

/* How a deflated data set begins: a size_t, then so many bytes of it, as many as there are or find room. */
static CtsStatus inflate_apart(const void *order, const uint8_t *stream, size_t n, void *head, size_t n_head,
                               CtsError *err)
{
    size_t got = 0;
    (void)order;
    const CtsStatus st = cts_inflate(stream, n, 0, (uint8_t *)head + sizeof got, n_head - sizeof got, &got, err);
    memcpy(head, &got, sizeof got);
    return st;
}

/* The data set's first `want` bytes, inflated by a process of its own and copied: they stay as they are when they are
 * looked at. */
static CtsStatus inflate_head(Head *h, const Framing *f, size_t want, size_t *got, CtsError *err)
{
    CtsScratch *s = h->scratch;
    const size_t n = h->n - f->meta.data_offset, n_head = want + sizeof *got;
    uint8_t *stream;
    const void *head;
    CtsStatus st = cts_sandbox_new(&s->inflater, inflate_apart, "decoder", 1, err);
    if (st || (st = cts_sandbox_room(s->inflater, n, n_head, &stream, err)))
        return st;
    memcpy(stream, s->file + f->meta.data_offset, n);
    cts_sandbox_send(s->inflater, NULL, 0, stream, n, n_head);
    if ((st = cts_sandbox_take(s->inflater, &head, err)))
        return st;
    memcpy(got, head, sizeof *got);
    *got = *got < want ? *got : want;
    if (!(st = cts_bytes_reserve(&s->inflated, &s->inflated_capacity, *got, err)) && *got)
        memcpy(s->inflated, (const uint8_t *)head + sizeof *got, *got);
    return st;
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
        if ((st = inflate_head(h, f, want, &got, err)))
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
    const char *uid = f->meta.syntax_uid;
    slice->syntax = cts_syntax_find(f->meta.syntax_uid);
    if (!f->meta.syntax_uid[0]) {
        slice->odd |= CTS_ODD_NO_SYNTAX;
        slice->syntax = cts_scan_guess(h->scratch->file + f->meta.data_offset, h->n - f->meta.data_offset);
        if (!slice->syntax)
            return cts_fail(err, CTS_ERR_READ, "has no transfer syntax, and its data set fits none");
        uid = slice->syntax->uid;
    }
    if (!(slice->syntax_uid = cts_texts_share(&h->scratch->texts, uid, 64)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    f->native = slice->syntax ? cts_syntax_native(slice->syntax->explicit_vr, slice->syntax->big_endian)
                              : cts_syntax_native(true, false);
    return CTS_OK;
}

static void check_pixels(const Head *h, const Framing *f, CtsSlice *slice)
{
    const CtsSyntax *syntax = slice->syntax;
    slice->data_offset = f->meta.data_offset;
    slice->pixel_offset = f->data.pixel_offset;
    slice->pixel_bytes = f->data.pixel_bytes;
    slice->pixel_words = f->data.pixel_words;
    slice->file_bytes = h->file.n_bytes;
    slice->mtime_ns = h->file.mtime_ns;
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
        cts_slice_fault(slice, CTS_ERR_PIXELS, "%sFloat Pixel Data (7FE0,%04X) is no CT Image Storage pixel data",
                        f->data.float_pixels == 0x7FE00009 ? "Double " : "", f->data.float_pixels & 0xFFFF);
    else if (!f->data.has_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData (7FE0,0010) is missing");
    else if (f->data.encapsulated != cts_syntax_encapsulated(syntax))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData is %scompressed, but its transfer syntax is %s",
                        f->data.encapsulated ? "" : "not ", syntax->name);
}

/* What the file says of all its slices alike. */
static CtsStatus complete(const Head *h, const Framing *f, const CtsSlice *common, const CtsFile *source,
                          CtsObject *object, CtsError *err)
{
    bool usable = object->n_slices > 0;
    for (int i = 0; i < object->n_slices; i++) {
        CtsSlice *s = object->slices[i];
        s->syntax = common->syntax;
        s->syntax_uid = common->syntax_uid;
        s->odd |= common->odd;
        s->memory = source->memory;
        s->path = source->path;
        /* What a frame's own values are worth is its own matter; without a size nothing can be placed. */
        const bool sized = s->rows > 0 && s->columns > 0 && (s->bits_allocated == 8 || s->bits_allocated == 16);
        const bool sound = !s->fault || (s->n_frames && sized);
        check_pixels(h, f, s);
        usable &= sound && s->syntax && s->syntax->codec != CTS_CODEC_NONE && f->data.has_pixels &&
                  f->data.encapsulated == cts_syntax_encapsulated(s->syntax);
    }
    if (usable && f->data.encapsulated)
        return cts_place_fragments(&h->file, object->slices, object->n_slices, err);
    if (!usable)
        return CTS_OK;
    cts_place_native(&h->file, object->slices, object->n_slices);
    for (int i = 0; i < object->n_slices && !common->syntax->deflated; i++) {
        CtsSlice *s = object->slices[i];
        if (!s->fault && s->pixel_offset + s->pixel_bytes <= h->n)
            cts_slice_see_pixels(s, h->scratch->file + s->pixel_offset, &h->scratch->texts);
    }
    return CTS_OK;
}

/* What a file that is no DICOM was packed with, by its first bytes. */
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

/* Open, recognise and scan; *kind is CTS_FILE_DICOM when f is filled. */
static CtsStatus open_and_scan(Head *h, const CtsFile *source, Framing *f, CtsSlice *slice, CtsFileKind *kind,
                               CtsError *err)
{
    *kind = CTS_FILE_NOT_DICOM;
    CtsStatus st = CTS_OK;
    if (source->memory)
        h->file = cts_file_bytes_in_memory(source->memory, source->n_memory);
    else
        st = cts_file_bytes_open(&h->file, source->path, err);
    if (st || h->file.fd < 0)
        return st;
    if ((st = read_up_to(h, FIRST_READ, err)))
        return st;
    if (cts_nifti_slices_are(source->path, h->scratch->file, h->n)) {
        *kind = CTS_FILE_NIFTI;
        return CTS_OK;
    }
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

/* The slices of a data set that has been scanned, as DCMTK or the scan tells them. */
static CtsStatus read_slices(const Framing *f, CtsTexts *texts, CtsSlice *common, CtsObject *object, CtsError *err)
{
    char class_uid[65];
    memcpy(class_uid, f->meta.sop_class_uid, sizeof class_uid);
    CtsStatus st = cts_dcm_read_header(f->data_set, f->n_data_set, &f->data, f->native, texts, class_uid, common, err);
    object->kind = common->kind;
    object->study_uid = common->kind == CTS_OBJECT_LABELS ? common->identity[CTS_STUDY_UID] : NULL;
    if (!st && !(object->class_uid = cts_texts_share(texts, class_uid, sizeof class_uid)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsDcmReaders *dcm = NULL;
    if (!st && common->kind == CTS_OBJECT_ENHANCED) {
        st = cts_dcm_readers(&dcm, err);
        return st ? st
                  : dcm->read_frames(f->data_set, f->n_data_set, f->native, texts, &object->slices, &object->n_slices,
                                     err);
    }
    if (st || common->kind != CTS_OBJECT_CT)
        return st;
    object->slices = malloc(sizeof *object->slices);
    CtsSlice *slice = malloc(sizeof *slice);
    if (!object->slices || !slice) {
        free(slice);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    *slice = *common;
    object->slices[object->n_slices++] = slice;
    common->fault_text = NULL; /* moved */
    return CTS_OK;
}

CtsFileKind cts_slice_read_header(const CtsFile *source, CtsScratch *scratch, CtsObject *object, uint64_t *bytes_read,
                                  CtsError *err)
{
    Head h = {.file = {.fd = -1}, .scratch = scratch, .bytes_read = bytes_read};
    Framing f;
    CtsFileKind kind;
    CtsSlice common = {0};
    CtsStatus st = open_and_scan(&h, source, &f, &common, &kind, err);
    if (!st && kind == CTS_FILE_DICOM && !(st = read_slices(&f, &scratch->texts, &common, object, err)))
        st = complete(&h, &f, &common, source, object, err);
    /* In a folder it may be a mask or a picture of anything. */
    if (!st && kind == CTS_FILE_NIFTI && source->named)
        st = cts_nifti_slices(source, &h.file, object, err);
    else if (kind == CTS_FILE_NIFTI)
        object->packed = "NIfTI";
    else if (!st && kind == CTS_FILE_NOT_DICOM && h.n)
        object->packed = packer_of(scratch->file, h.n);
    cts_slice_clear(&common);
    cts_file_bytes_close(&h.file);
    if (!st)
        return kind;
    cts_object_free(object);
    return CTS_FILE_UNREADABLE;
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
    const CtsFile source = {.path = path};
    uint64_t bytes_read = 0;
    Head h = {.file = {.fd = -1}, .scratch = scratch, .bytes_read = &bytes_read};
    Framing f;
    CtsFileKind kind;
    CtsSlice slice = {0};
    *files = NULL;
    *n_files = 0;
    CtsStatus st = open_and_scan(&h, &source, &f, &slice, &kind, err);
    if (!st && kind != CTS_FILE_DICOM)
        st = cts_fail(err, CTS_ERR_READ, "is not a DICOMDIR");
    const CtsDcmReaders *dcm = NULL;
    if (!st && !(st = cts_dcm_readers(&dcm, err)))
        st = dcm->directory(f.data_set, f.n_data_set, f.native, files, n_files, n_refused, err);
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
