/* A lossless JPEG 2000 stream of one grey picture, by OpenJPEG; for raw2ct and for tests. */
#pragma once

#include <openjpeg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct Jpeg2000 {
    int columns, rows, bits, n_components;
    bool is_signed, in_jp2; /* in_jp2: inside the boxes of a JP2 file */
} Jpeg2000;

typedef struct Jpeg2000Bytes {
    uint8_t *data;
    size_t n, pos;
} Jpeg2000Bytes;

static inline OPJ_SIZE_T jpeg2000_write(void *buffer, OPJ_SIZE_T n, void *context)
{
    Jpeg2000Bytes *b = (Jpeg2000Bytes *)context;
    if (b->pos + n > b->n) {
        uint8_t *grown = (uint8_t *)realloc(b->data, b->pos + n);
        if (!grown)
            return (OPJ_SIZE_T)-1;
        b->data = grown;
        b->n = b->pos + n;
    }
    memcpy(b->data + b->pos, buffer, n);
    b->pos += n;
    return n;
}

static inline OPJ_OFF_T jpeg2000_skip(OPJ_OFF_T n, void *context)
{
    ((Jpeg2000Bytes *)context)->pos += (size_t)n;
    return n;
}

static inline OPJ_BOOL jpeg2000_seek(OPJ_OFF_T pos, void *context)
{
    ((Jpeg2000Bytes *)context)->pos = (size_t)pos;
    return OPJ_TRUE;
}

/* The stream of samples (columns * rows, the same for every component); its bytes are the caller's. n is 0 when
 * OpenJPEG refuses. */
static inline Jpeg2000Bytes jpeg2000_stream(const Jpeg2000 *p, const int32_t *samples)
{
    Jpeg2000Bytes bytes = {NULL, 0, 0};
    opj_image_cmptparm_t parts[4];
    opj_cparameters_t settings;
    memset(parts, 0, sizeof parts);
    for (int c = 0; c < p->n_components && c < 4; c++) {
        parts[c].dx = parts[c].dy = 1;
        parts[c].w = (OPJ_UINT32)p->columns;
        parts[c].h = (OPJ_UINT32)p->rows;
        parts[c].prec = (OPJ_UINT32)p->bits;
        parts[c].sgnd = p->is_signed;
    }
    opj_image_t *image = opj_image_create((OPJ_UINT32)p->n_components, parts, OPJ_CLRSPC_GRAY);
    opj_codec_t *codec = opj_create_compress(p->in_jp2 ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K);
    opj_stream_t *stream = opj_stream_create(64 << 10, OPJ_FALSE);
    image->x1 = (OPJ_UINT32)p->columns;
    image->y1 = (OPJ_UINT32)p->rows;
    for (int c = 0; c < p->n_components && c < 4; c++)
        memcpy(image->comps[c].data, samples, (size_t)p->columns * (size_t)p->rows * sizeof *samples);
    opj_set_default_encoder_parameters(&settings);
    settings.numresolution = 3;
    settings.tcp_numlayers = 1;
    settings.cp_disto_alloc = 1;
    char comment[] = "made up";
    settings.cp_comment = comment; /* without OpenJPEG's version, so that the bytes repeat */
    opj_stream_set_write_function(stream, jpeg2000_write);
    opj_stream_set_skip_function(stream, jpeg2000_skip);
    opj_stream_set_seek_function(stream, jpeg2000_seek);
    opj_stream_set_user_data(stream, &bytes, NULL);
    if (!opj_setup_encoder(codec, &settings, image) || !opj_start_compress(codec, image, stream) ||
        !opj_encode(codec, stream) || !opj_end_compress(codec, stream))
        bytes.n = 0;
    opj_stream_destroy(stream);
    opj_destroy_codec(codec);
    opj_image_destroy(image);
    return bytes;
}

#ifdef __cplusplus
}
#endif
