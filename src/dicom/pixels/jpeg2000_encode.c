/* One frame as a JPEG 2000 code stream without loss, by OpenJPEG. */
#include "dicom/pixels/pixel_tasks.h"

#include <openjpeg.h>
#include <stdio.h>
#include <string.h>

/* The code stream; an encoder may seek backwards in it. */
typedef struct Stream {
    uint8_t *bytes;
    size_t n, at, capacity;
} Stream;

static OPJ_SIZE_T stream_write(void *bytes, OPJ_SIZE_T n, void *context)
{
    Stream *s = context;
    if (n > s->capacity - s->at)
        return (OPJ_SIZE_T)-1;
    memcpy(s->bytes + s->at, bytes, n);
    s->at += n;
    s->n = s->n > s->at ? s->n : s->at;
    return n;
}

static OPJ_BOOL stream_seek(OPJ_OFF_T at, void *context)
{
    Stream *s = context;
    if (at < 0 || (size_t)at > s->n)
        return OPJ_FALSE;
    s->at = (size_t)at;
    return OPJ_TRUE;
}

static OPJ_OFF_T stream_skip(OPJ_OFF_T n, void *context)
{
    Stream *s = context;
    return stream_seek((OPJ_OFF_T)s->at + n, context) ? n : -1;
}

static void keep_message(const char *message, void *context)
{
    char *first = context;
    if (!*first)
        snprintf(first, 120, "%.*s", (int)strcspn(message, "\r\n"), message);
}

static opj_image_t *image_of(const CtsEncodeOrder *frame, const void *samples)
{
    const int n_components = frame->grey ? 1 : 3;
    const size_t n = (size_t)frame->width * frame->height;
    opj_image_cmptparm_t component = {
        .dx = 1, .dy = 1, .w = (OPJ_UINT32)frame->width, .h = (OPJ_UINT32)frame->height, .prec = frame->grey ? 16 : 8};
    opj_image_cmptparm_t components[3] = {component, component, component};
    opj_image_t *image =
        opj_image_create((OPJ_UINT32)n_components, components, frame->grey ? OPJ_CLRSPC_GRAY : OPJ_CLRSPC_SRGB);
    if (!image)
        return NULL;
    image->x1 = component.w;
    image->y1 = component.h;
    const uint16_t *words = samples;
    const uint8_t *bytes = samples;
    for (int c = 0; c < n_components; c++)
        for (size_t i = 0; i < n; i++)
            image->comps[c].data[i] = frame->grey ? words[i] : bytes[i * 3 + c];
    return image;
}

static void set_parameters(const CtsEncodeOrder *frame, opj_cparameters_t *p)
{
    opj_set_default_encoder_parameters(p);
    p->tcp_numlayers = 1;
    p->tcp_rates[0] = 0; /* without loss */
    p->cp_disto_alloc = 1;
    p->irreversible = 0;
    p->tcp_mct = !frame->grey;
    p->cp_comment = (char *)"ctsplat"; /* the default is OpenJPEG's version, which would make files depend on it */
    const int side = frame->width < frame->height ? frame->width : frame->height;
    while (p->numresolution > 1 && side >> (p->numresolution - 1) == 0)
        p->numresolution--;
}

static bool encode(const CtsEncodeOrder *frame, opj_image_t *image, Stream *s, char why[120])
{
    opj_cparameters_t parameters;
    opj_codec_t *codec = opj_create_compress(OPJ_CODEC_J2K);
    opj_stream_t *stream = opj_stream_create(1 << 20, OPJ_FALSE);
    bool done = false;
    if (codec && stream) {
        opj_set_error_handler(codec, keep_message, why);
        opj_stream_set_user_data(stream, s, NULL);
        opj_stream_set_write_function(stream, stream_write);
        opj_stream_set_seek_function(stream, stream_seek);
        opj_stream_set_skip_function(stream, stream_skip);
        set_parameters(frame, &parameters);
        done = opj_setup_encoder(codec, &parameters, image);
        if (done && frame->n_threads > 1)
            opj_codec_set_threads(codec, frame->n_threads);
        done = done && opj_start_compress(codec, image, stream) && opj_encode(codec, stream) &&
               opj_end_compress(codec, stream);
    }
    if (stream)
        opj_stream_destroy(stream);
    if (codec)
        opj_destroy_codec(codec);
    return done;
}

CtsStatus cts_pixels_encode(const void *order, const uint8_t *samples, size_t n, void *answer, size_t n_answer,
                            CtsError *err)
{
    CtsEncodeOrder frame;
    char why[120] = "";
    Stream s = {.bytes = (uint8_t *)answer + sizeof s.n, .capacity = n_answer - sizeof s.n};
    memcpy(&frame, order, sizeof frame);
    opj_image_t *image = image_of(&frame, samples);
    (void)n;
    if (!image)
        return cts_fail(err, CTS_ERR_OUTPUT, "out of memory");
    const bool done = encode(&frame, image, &s, why);
    opj_image_destroy(image);
    memcpy(answer, &s.n, sizeof s.n);
    return done ? CTS_OK : cts_fail(err, CTS_ERR_OUTPUT, "%s", *why ? why : "OpenJPEG gives no reason");
}
