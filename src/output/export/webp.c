/* WebP by libwebp: 8 bits, with alpha; the frames of a rotation are one animated file. */
#include "output/export/format.h"

#include "base/mem.h"
#include "output/image/samples.h"
#include <webp/encode.h>
#include <webp/mux.h>

/* METHOD: libwebp's fastest; its others take three times as long for a tenth fewer bytes of a render. */
enum { METHOD = 0 };

typedef struct WebpWriter {
    WebPConfig config;
    WebPAnimEncoder *frames; /* of more than one */
    uint8_t *rgba;           /* the current frame */
    int n_rows, n_frames;    /* received so far */
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

static int put_bytes(const uint8_t *bytes, size_t n, const WebPPicture *picture)
{
    CtsError err = {0};
    return cts_temp_write(picture->custom_ptr, bytes, n, &err) == CTS_OK;
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
    if (!WebPPictureInit(&picture))
        return fail_webp(job, "another version than it was built with", err);
    picture.width = job->head.width;
    picture.height = job->head.height;
    picture.use_argb = w->frames != NULL;
    picture.writer = put_bytes;
    picture.custom_ptr = job->temp;
    const bool done = WebPPictureImportRGBA(&picture, w->rgba, 4 * job->head.width) &&
                      (w->frames ? WebPAnimEncoderAdd(w->frames, &picture, time_ms(job, w->n_frames), &w->config)
                                 : WebPEncode(&w->config, &picture));
    const WebPEncodingError why = picture.error_code;
    WebPPictureFree(&picture);
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

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    WebpWriter *const w = job->state;
    WebPData file;
    if (!w->frames)
        return CTS_OK;
    WebPDataInit(&file);
    CtsStatus st = CTS_OK;
    if (!WebPAnimEncoderAdd(w->frames, NULL, time_ms(job, w->n_frames), NULL) ||
        !WebPAnimEncoderAssemble(w->frames, &file))
        st = fail_webp(job, WebPAnimEncoderGetError(w->frames), err);
    else
        st = cts_temp_write(job->temp, file.bytes, file.size, err);
    WebPDataClear(&file);
    return st;
}

static void release(CtsExportJob *job)
{
    WebpWriter *const w = job->state;
    WebPAnimEncoderDelete(w->frames);
    cts_free(&w->rgba);
}

const CtsFormat cts_format_webp = {
    .info = {"webp", "WebP, 8 bits a channel; a rotation is one animated file", .many_frames = true, .has_alpha = true},
    .max_side = WEBP_MAX_DIMENSION,
    .state_bytes = sizeof(WebpWriter),
    .begin = begin,
    .rows = add_rows,
    .finish = finish,
    .close = release,
};
