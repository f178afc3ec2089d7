#include "dicom/header/header_reader.h"
#include "dicom/header/pixel_places.h"

static void check_pixels(const CtsHeaderFacts *f, CtsSlice *slice)
{
    const CtsSyntax *syntax = slice->syntax;
    slice->data_offset = f->data_offset;
    slice->pixel_offset = f->pixel_offset;
    slice->pixel_bytes = f->pixel_bytes;
    slice->pixel_words = f->pixel_words;
    if (syntax && (syntax->loss == CTS_LOSSY || (syntax->loss == CTS_MAYBE_LOSSY && !slice->declared_lossless)))
        slice->deviations |= CTS_DEVIATION_LOSSY;
    if (!syntax)
        cts_slice_fault(slice, CTS_ERR_SYNTAX, "transfer syntax %s is unknown (convert it with gdcmconv --raw)",
                        slice->syntax_uid);
    else if (syntax->codec >= CTS_CODEC_NONE)
        cts_slice_fault(
            slice, CTS_ERR_SYNTAX,
            "transfer syntax %s (%s): %s (fetch the series again as Explicit VR Little Endian, or export it so "
            "where it can be displayed)",
            syntax->uid, syntax->name,
            syntax->codec == CTS_CODEC_NONE ? "cannot be decoded by this build"
                                            : "its pixels are on a server, not in the file");
    if (slice->fault)
        return;
    if (f->float_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "%sFloat Pixel Data (7FE0,%04X) is no pixel data of slices",
                        f->float_pixels == 0x7FE00009 ? "Double " : "", f->float_pixels & 0xFFFF);
    else if (!f->has_pixels)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData (7FE0,0010) is missing");
    else if (f->encapsulated != cts_syntax_encapsulated(syntax))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData is %scompressed, but its transfer syntax is %s",
                        f->encapsulated ? "" : "not ", syntax->name);
}

static CtsStatus place_frames(const CtsHeaderFacts *f, const CtsPendingHeader *pending, const CtsObject *object,
                              CtsError *err)
{
    CtsFileBytes file = {.n_bytes = pending->n_file};
    if (!f->encapsulated) {
        cts_place_native(&file, object->slices, object->n_slices);
        return CTS_OK;
    }
    CtsStatus st = cts_slice_open(object->slices[0], &file, err);
    if (!st)
        st = cts_place_fragments(&file, object->slices, object->n_slices, err);
    cts_file_bytes_close(&file);
    return st;
}

CtsStatus cts_header_complete(const CtsHeaderFacts *f, const CtsPendingHeader *file, CtsStringPool *texts,
                              CtsObject *object, CtsError *err)
{
    bool usable = object->n_slices > 0;
    const char *syntax_uid = cts_string_pool_share(texts, f->syntax_uid, 64);
    const CtsSyntax *const syntax = cts_syntax_find(f->syntax_uid);
    object->class_name = cts_string_pool_share(texts, f->class_name, sizeof f->class_name);
    if (!syntax_uid || !object->class_name)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < object->n_slices; i++) {
        CtsSlice *s = object->slices[i];
        s->syntax = syntax;
        s->syntax_uid = syntax_uid;
        s->class_uid = object->class_uid;
        s->deviations |= f->deviations;
        s->memory = file->source->memory;
        s->path = file->source->path;
        s->file_bytes = file->n_file;
        s->mtime_ns = file->mtime_ns;
        /* Faults of a frame are its own; but without a size no frame's offset is known. */
        const bool sized = s->rows > 0 && s->columns > 0 && (s->bits_allocated == 8 || s->bits_allocated == 16);
        const bool sound = !s->fault || (s->n_frames && sized);
        check_pixels(f, s);
        usable &= sound && s->syntax && s->syntax->codec < CTS_CODEC_NONE && f->has_pixels &&
                  f->encapsulated == cts_syntax_encapsulated(s->syntax);
    }
    return usable ? place_frames(f, file, object, err) : CTS_OK;
}
