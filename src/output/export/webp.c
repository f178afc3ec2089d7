/* WebP by libwebp: 8 bits, with alpha; the frames of a rotation are one animated file. */
#include "output/export/format.h"

#include "base/mem.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <stdio.h>
#include <webp/encode.h>
#include <webp/mux.h>

/* METHOD: libwebp's fastest; its others take three times as long for a tenth fewer bytes of a render. */
enum { METHOD = 0 };

typedef struct WebpWriter {
    WebPConfig config;
    WebPAnimEncoder *frames; /* of more than one */
    uint8_t *rgba;           /* the current frame */
    int n_frames;            /* received so far */
    WebPData file;           /* when it is encoded */
} WebpWriter;

static CtsStatus fail_webp(const CtsExportJob *job, const char *what, CtsError *err)
{
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: libwebp: %s", job->path, what);
}

static CtsStatus begin_animation(const CtsExportJob *job, WebpWriter *w, CtsError *err)
{
    WebPAnimEncoderOptions options;
    if (!WebPAnimEncoderOptionsInit(&options))
        return fail_webp(job, "another version than it was built with", err);
    options.kmin = options.kmax =
        1; /* each frame by itself: all of a turning body changes, and looking for more is slow */
    w->frames = WebPAnimEncoderNew(job->head.width, job->head.height, &options);
    return w->frames ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    const int quality = job->settings.quality;
    WebpWriter *w = job->state;
    if (!WebPConfigPreset(&w->config, WEBP_PRESET_DEFAULT, (float)(quality ? quality : CTS_QUALITY_DEFAULT)))
        return fail_webp(job, "another version than it was built with", err);
    w->config.method = METHOD;
    const CtsStatus st = cts_alloc_array(&w->rgba, (size_t)job->head.width * (size_t)job->head.height * 4, err);
    return st || job->head.n_frames == 1 ? st : begin_animation(job, w, err);
}

/* Time of a frame in milliseconds, rounded, so that rates that do not divide a second cause no drift. */
static int time_ms(const CtsExportJob *job, int frame)
{
    const int rate = job->settings.frame_rate ? job->settings.frame_rate : CTS_FRAME_RATE_DEFAULT;
    return (int)((int64_t)frame * 1000 / rate);
}

static CtsStatus add_frame(const CtsExportJob *job, WebpWriter *w, CtsError *err)
{
    WebPPicture picture;
    WebPMemoryWriter encoded;
    WebPMemoryWriterInit(&encoded);
    if (!WebPPictureInit(&picture))
        return fail_webp(job, "another version than it was built with", err);
    picture.width = job->head.width;
    picture.height = job->head.height;
    picture.use_argb = w->frames != NULL;
    picture.writer = WebPMemoryWrite;
    picture.custom_ptr = &encoded;
    const bool done = WebPPictureImportRGBA(&picture, w->rgba, 4 * job->head.width) &&
                      (w->frames ? WebPAnimEncoderAdd(w->frames, &picture, time_ms(job, w->n_frames), &w->config)
                                 : WebPEncode(&w->config, &picture));
    const WebPEncodingError why = picture.error_code;
    WebPPictureFree(&picture);
    if (!w->frames)
        w->file = (WebPData){encoded.mem, encoded.size}; /* freed by release() */
    if (done)
        return CTS_OK;
    return why == VP8_ENC_ERROR_OUT_OF_MEMORY || why == VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY
               ? cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path)
               : cts_fail(err, CTS_ERR_OUTPUT, "%s: libwebp could not write it (error %d)", job->path, why);
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    WebpWriter *const w = job->state;
    for (int y = 0; y < band->height; y++)
        cts_samples_row8(band, y, 4, w->rgba + (size_t)(band->first_row + y) * (size_t)band->width * 4);
    if (band->first_row + band->height < job->head.height)
        return CTS_OK;
    const CtsStatus st = add_frame(job, w, err);
    w->n_frames++;
    return st;
}

/* The file with its error estimate as XMP, in place of the one without. */
static CtsStatus add_error(const CtsExportJob *job, WebPData *file, CtsError *err)
{
    char error[CTS_ERROR_TEXT], text[400];
    WebPData whole;
    cts_describe_error(job->rmse, error);
    const int n = snprintf(
        text, sizeof text,
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">"
        "<rdf:Description rdf:about=\"\" xmlns:ctsplat=\"urn:ctsplat:\" ctsplat:error=\"%s\"/></rdf:RDF></x:xmpmeta>",
        error);
    const WebPData xmp = {(const uint8_t *)text, (size_t)n};
    WebPMux *const mux = WebPMuxCreate(file, 0);
    WebPDataInit(&whole);
    const bool done =
        mux && WebPMuxSetChunk(mux, "XMP ", &xmp, 0) == WEBP_MUX_OK && WebPMuxAssemble(mux, &whole) == WEBP_MUX_OK;
    WebPMuxDelete(mux);
    WebPDataClear(file);
    *file = whole;
    return done ? CTS_OK : fail_webp(job, "the error estimate could not be added", err);
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    WebpWriter *const w = job->state;
    CtsStatus st = CTS_OK;
    if (w->frames && (!WebPAnimEncoderAdd(w->frames, NULL, time_ms(job, w->n_frames), NULL) ||
                      !WebPAnimEncoderAssemble(w->frames, &w->file)))
        st = fail_webp(job, WebPAnimEncoderGetError(w->frames), err);
    if (!st && job->rmse >= 0)
        st = add_error(job, &w->file, err);
    return st ? st : cts_temp_write(job->temp, w->file.bytes, w->file.size, err);
}

static void release(CtsExportJob *job)
{
    WebpWriter *const w = job->state;
    WebPAnimEncoderDelete(w->frames);
    WebPDataClear(&w->file);
    cts_free(&w->rgba);
}

const CtsFormat cts_format_webp = {
    .info = {"webp", "WebP, 8 bits a channel; a rotation is one animated file", "image/webp", .many_frames = true,
             .has_alpha = true},
    .max_side = WEBP_MAX_DIMENSION,
    CTS_FORMAT_STEPS(WebpWriter),
};
