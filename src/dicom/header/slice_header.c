#include "dicom/header/dicom_header.h"

static void check_pixels(const CtsDicomHeader *h, CtsSlice *slice)
{
    const CtsSyntax *syntax = slice->syntax;
    slice->data_offset = h->meta.data_offset;
    slice->pixel_offset = h->scan.pixel_offset;
    slice->pixel_bytes = h->scan.pixel_bytes;
    slice->pixel_words = h->scan.pixel_words;
    slice->file_bytes = h->file.n_bytes;
    slice->mtime_ns = h->file.mtime_ns;
    if (syntax && (syntax->loss == CTS_LOSSY || (syntax->loss == CTS_MAYBE_LOSSY && !slice->declared_lossless)))
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
    if (h->scan.float_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "%sFloat Pixel Data (7FE0,%04X) is no CT Image Storage pixel data",
                        h->scan.float_pixels == 0x7FE00009 ? "Double " : "", h->scan.float_pixels & 0xFFFF);
    else if (!h->scan.has_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData (7FE0,0010) is missing");
    else if (h->scan.encapsulated != cts_syntax_encapsulated(syntax))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData is %scompressed, but its transfer syntax is %s",
                        h->scan.encapsulated ? "" : "not ", syntax->name);
}

/* Sets the fields common to all slices of the file. */
static CtsStatus complete(const CtsDicomHeader *h, const CtsFile *source, CtsObject *object, CtsError *err)
{
    bool usable = object->n_slices > 0;
    const char *syntax_uid = cts_string_pool_share(&h->scratch->texts, h->syntax_uid, 64);
    if (!syntax_uid)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < object->n_slices; i++) {
        CtsSlice *s = object->slices[i];
        s->syntax = h->syntax;
        s->syntax_uid = syntax_uid;
        s->class_uid = object->class_uid;
        s->odd |= h->odd;
        s->memory = source->memory;
        s->path = source->path;
        /* Faults of a frame are its own; but without a size no frame's offset is known. */
        const bool sized = s->rows > 0 && s->columns > 0 && (s->bits_allocated == 8 || s->bits_allocated == 16);
        const bool sound = !s->fault || (s->n_frames && sized);
        check_pixels(h, s);
        usable &= sound && s->syntax && s->syntax->codec != CTS_CODEC_NONE && h->scan.has_pixels &&
                  h->scan.encapsulated == cts_syntax_encapsulated(s->syntax);
    }
    if (usable && h->scan.encapsulated)
        return cts_place_fragments(&h->file, object->slices, object->n_slices, err);
    if (usable)
        cts_place_native(&h->file, object->slices, object->n_slices);
    return CTS_OK;
}

CtsStatus cts_dicom_header_object(const CtsDicomHeader *h, const CtsFile *source, CtsObject *object, CtsError *err)
{
    const CtsStatus st = cts_dcm_read_object(&h->data_set, &h->scratch->texts, h->meta.sop_class_uid, object, err);
    return st ? st : complete(h, source, object, err);
}

CtsFileKind cts_slice_read_header(const CtsFile *source, CtsScratch *scratch, CtsObject *object, uint64_t *bytes_read,
                                  CtsError *err)
{
    CtsDicomHeader h;
    CtsStatus st = cts_dicom_header_open(&h, source, scratch, err);
    if (!st && h.kind == CTS_FILE_DICOM)
        st = cts_dicom_header_object(&h, source, object, err);
    *bytes_read += h.n;
    cts_dicom_header_close(&h);
    if (!st)
        return h.kind;
    cts_object_free(object);
    return CTS_FILE_UNREADABLE;
}
