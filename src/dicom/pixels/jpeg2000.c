/* JPEG 2000 and HTJ2K streams, decoded with OpenJPEG. */
#include "dicom/pixels/pixel_tasks.h"

#include <openjpeg.h>
#include <stdio.h>
#include <string.h>

typedef struct Source {
    const uint8_t *bytes;
    size_t n, pos;
} Source;

static OPJ_SIZE_T read_bytes(void *buffer, OPJ_SIZE_T n, void *context)
{
    Source *s = context;
    if (s->pos >= s->n)
        return (OPJ_SIZE_T)-1;
    n = n < s->n - s->pos ? n : s->n - s->pos;
    memcpy(buffer, s->bytes + s->pos, n);
    s->pos += n;
    return n;
}

static OPJ_OFF_T skip_bytes(OPJ_OFF_T n, void *context)
{
    Source *s = context;
    if (n < 0)
        return -1;
    if ((uint64_t)n > s->n - s->pos)
        n = (OPJ_OFF_T)(s->n - s->pos);
    s->pos += (size_t)n;
    return n;
}

static OPJ_BOOL seek_bytes(OPJ_OFF_T pos, void *context)
{
    Source *s = context;
    if (pos < 0 || (uint64_t)pos > s->n)
        return OPJ_FALSE;
    s->pos = (size_t)pos;
    return OPJ_TRUE;
}

typedef struct Complaint {
    unsigned n;
    char first[120];
} Complaint;

static void note(const char *text, void *context)
{
    Complaint *c = context;
    if (c->n++ == 0) {
        snprintf(c->first, sizeof c->first, "%s", text);
        c->first[strcspn(c->first, "\r\n")] = 0;
    }
}

/* The stream's own shape, before anything is allocated by it. */
static CtsStatus check_shape(const CtsFrameFormat *f, const opj_image_t *image, CtsError *err)
{
    const unsigned wanted = f->n_colours > 0 ? (unsigned)f->n_colours : 1;
    if (image->numcomps != wanted)
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream has %u components, not %u", image->numcomps, wanted);
    for (OPJ_UINT32 i = 0; i < image->numcomps; i++) {
        const opj_image_comp_t *c = &image->comps[i];
        const bool plain = !image->x0 && !image->y0 && !c->x0 && !c->y0 && c->dx == 1 && c->dy == 1 &&
                           image->x1 == c->w && image->y1 == c->h;
        if (!plain || c->w != (unsigned)f->columns || c->h != (unsigned)f->rows)
            return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream is %u x %u, the header says %d x %d", c->w, c->h,
                            f->columns, f->rows);
        if (c->prec < 1 || c->prec > (unsigned)f->bits_allocated)
            return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream has %u bits, the header allocates %d", c->prec,
                            f->bits_allocated);
    }
    return CTS_OK;
}

/* Copies one component, whose first sample goes to pixels. The stream has its own sign and precision, which writers get
 * wrong. Where the header's bits and sign give another number than the stream's, the true value is unknown, and the
 * frame is refused. Left-justified words cannot be tested so. */
static CtsStatus take_samples(const CtsFrameFormat *f, const opj_image_comp_t *c, void *pixels, CtsError *err)
{
    const size_t step = f->n_colours > 0 ? (size_t)f->n_colours : 1, n = (size_t)f->columns * (size_t)f->rows;
    const bool justified = f->high_bit != f->bits_stored - 1;
    const int32_t low = f->is_signed ? -(1 << (f->bits_stored - 1)) : 0;
    const int32_t high = low + (1 << f->bits_stored) - 1;
    if (justified && (c->prec != (unsigned)f->bits_allocated || c->sgnd))
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream has %u bits, which its HighBit (0028,0102) denies",
                        c->prec);
    /* Loops without exits vectorise. */
    int n_outside = 0;
    for (size_t i = 0; i < n; i++)
        n_outside += (c->data[i] < low) | (c->data[i] > high);
    for (size_t i = 0; n_outside && !justified && i < n; i++) {
        const int32_t v = c->data[i];
        if ((v < low || v > high) && (v & 0xFFFF) != f->padding_word)
            return cts_fail(err, CTS_ERR_PIXELS,
                            "its JPEG 2000 stream (%u bits, %ssigned) holds %d, which the header (%d bits, %ssigned) "
                            "reads as another number",
                            c->prec, c->sgnd ? "" : "un", v, f->bits_stored, f->is_signed ? "" : "un");
    }
    uint8_t *const bytes = pixels;
    uint16_t *const words = pixels;
    if (f->bits_allocated == 8)
        for (size_t i = 0; i < n; i++)
            bytes[i * step] = (uint8_t)c->data[i];
    else
        for (size_t i = 0; i < n; i++)
            words[i * step] = (uint16_t)c->data[i];
    return CTS_OK;
}

static opj_stream_t *open_source(Source *source)
{
    opj_stream_t *stream = opj_stream_create(64 << 10, OPJ_TRUE); /* buffer; changes no pixel */
    if (!stream)
        return NULL;
    opj_stream_set_read_function(stream, read_bytes);
    opj_stream_set_skip_function(stream, skip_bytes);
    opj_stream_set_seek_function(stream, seek_bytes);
    opj_stream_set_user_data(stream, source, NULL);
    opj_stream_set_user_data_length(stream, source->n);
    return stream;
}

static CtsStatus decode_image(const CtsFrameFormat *f, opj_codec_t *codec, opj_stream_t *stream, opj_image_t **image,
                              Complaint *complaint, CtsError *err)
{
    opj_dparameters_t parameters;
    opj_set_default_decoder_parameters(&parameters);
    opj_set_warning_handler(codec, note, complaint);
    opj_set_error_handler(codec, note, complaint);
    if (!opj_setup_decoder(codec, &parameters) || !opj_read_header(stream, codec, image))
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream cannot be read: %s",
                        complaint->n ? complaint->first : "no reason given");
    const CtsStatus st = check_shape(f, *image, err);
    if (st)
        return st;
    bool whole = opj_decode(codec, stream, *image) && opj_end_decompress(codec, stream) && complaint->n == 0;
    for (OPJ_UINT32 i = 0; i < (*image)->numcomps; i++)
        whole = whole && (*image)->comps[i].data;
    if (!whole)
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream is damaged: %s",
                        complaint->n ? complaint->first : "no reason given");
    return CTS_OK;
}

CtsStatus cts_jpeg2000_decode(const CtsFrameFormat *f, const uint8_t *bytes, size_t n, void *pixels, CtsError *err)
{
    /* The standard requires a bare codestream; some writers store a JP2 file. */
    static const uint8_t jp2[12] = {0, 0, 0, 12, 'j', 'P', ' ', ' ', '\r', '\n', 0x87, '\n'};
    const bool is_jp2 = n >= sizeof jp2 && memcmp(bytes, jp2, sizeof jp2) == 0;
    Source source = {bytes, n, 0};
    Complaint complaint = {0};
    opj_image_t *image = NULL;
    opj_stream_t *stream = open_source(&source);
    opj_codec_t *codec = opj_create_decompress(is_jp2 ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K);
    CtsStatus st = stream && codec ? decode_image(f, codec, stream, &image, &complaint, err)
                                   : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (OPJ_UINT32 c = 0; !st && c < image->numcomps; c++)
        st = take_samples(f, &image->comps[c], (uint8_t *)pixels + c * (size_t)(f->bits_allocated / 8), err);
    opj_image_destroy(image);
    opj_destroy_codec(codec);
    opj_stream_destroy(stream);
    return st;
}
