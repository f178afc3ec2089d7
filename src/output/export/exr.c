/* OpenEXR through OpenEXRCore: scene-linear half floats with premultiplied alpha (1 over a background), and depth as
 * float. Read back: one scanline part with R G B, A and Z if there, or Y. */
#include "output/export/format.h"

#include "base/mem.h"
#include "base/vec3.h"
#include "ctsplat/bounds.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { ZIP_LEVEL = 4 }; /* 1 to 2 % more bytes than OpenEXR 3.1's level of 6, in about half the time */

typedef struct ExrWriter {
    const CtsExportJob *job;
    exr_context_t file;
    int lines_per_chunk;
    CtsError *err;    /* of the current call */
    CtsStatus status; /* the first failure */
} ExrWriter;

/* Keeps the library from printing. It is called with the file's lock held, so calling the library here would deadlock;
 * the code returned by the failing call is used instead. */
static void say_nothing(exr_const_context_t file, exr_result_t code, const char *message)
{
    (void)file;
    (void)code;
    (void)message;
}

static int64_t on_write(exr_const_context_t file, void *user_data, const void *bytes, uint64_t n, uint64_t offset,
                        exr_stream_error_func_ptr_t error)
{
    ExrWriter *w = user_data;
    (void)file;
    (void)error;
    const CtsStatus st = cts_temp_write_at(w->job->temp, bytes, n, offset, w->status ? NULL : w->err);
    w->status = w->status ? w->status : st;
    return st ? -1 : (int64_t)n;
}

static bool failed(ExrWriter *w, exr_result_t code)
{
    if (code != EXR_ERR_SUCCESS && !w->status) /* on_write has not set an error already */
        w->status =
            cts_fail(w->err, CTS_ERR_OUTPUT, "%s: OpenEXR: %s", w->job->path, exr_get_default_error_message(code));
    return code != EXR_ERR_SUCCESS;
}

/* World (LPS, mm) to camera: x to the right, y up, z along the view from the camera plane on, where depth is 0.
 * EXR multiplies row vectors: p' = p M. */
static void world_to_camera(const CtsPictureInfo *info, double m[4][4])
{
    const double *axes[3] = {info->right_lps, info->up_lps, info->forward_lps};
    memset(m, 0, 16 * sizeof m[0][0]);
    for (int a = 0; a < 3; a++) {
        for (int k = 0; k < 3; k++)
            m[k][a] = axes[a][k];
        m[3][a] = (a == 2 ? info->camera_mm : 0) - cts_dot3(axes[a], info->centre_lps);
    }
    m[3][3] = 1;
}

/* The camera's x and y scaled so that (0, 0) is the picture's upper left corner and (1, 1) the lower right one. */
static void camera_to_ndc(const CtsExportHead *head, double m[4][4])
{
    const double sx = 1 / (head->width * head->info.mm_per_pixel);
    const double sy = -1 / (head->height * head->info.mm_per_pixel);
    for (int k = 0; k < 4; k++) {
        m[k][0] = m[k][0] * sx + (k == 3 ? 0.5 : 0);
        m[k][1] = m[k][1] * sy + (k == 3 ? 0.5 : 0);
    }
}

static exr_result_t set_matrix(exr_context_t file, const char *name, double m[4][4])
{
    exr_attr_m44f_t matrix;
    for (int i = 0; i < 16; i++)
        matrix.m[i] = (float)m[i / 4][i % 4];
    return exr_attr_set_m44f(file, 0, name, &matrix);
}

static exr_result_t set_camera(exr_context_t file, const CtsExportHead *head)
{
    const CtsPictureInfo *info = &head->info;
    double m[4][4];
    exr_result_t rv = EXR_ERR_SUCCESS;
    if (!(info->mm_per_pixel > 0) || info->tiles[0])
        return rv;
    world_to_camera(info, m);
    if ((rv = set_matrix(file, "worldToCamera", m)) ||
        (rv = exr_attr_set_float(file, 0, "ctsplat.mm_per_pixel", (float)info->mm_per_pixel)) ||
        (rv = exr_attr_set_float(file, 0, "xDensity", (float)(25.4 / info->mm_per_pixel))))
        return rv;
    camera_to_ndc(head, m);
    return set_matrix(file, "worldToNDC", m);
}

/* The error estimate is known when the header is already written: a text of fixed length stands in for it. */
static const char no_error[] = "not estimated          ";
_Static_assert(sizeof no_error == CTS_ERROR_TEXT, "the text of an error estimate fits");

static CtsStatus patch_error(const CtsExportJob *job, CtsError *err)
{
    enum { ATTRIBUTES_MAX = 1 << 13 };
    static const char begin[] = "ctsplat.error\0string"; /* then four bytes of length */
    char head[ATTRIBUTES_MAX], text[CTS_ERROR_TEXT], padded[CTS_ERROR_TEXT];
    const ssize_t n = pread(cts_temp_fd(job->temp), head, sizeof head, 0);
    const char *const at = n > 0 ? memmem(head, (size_t)n, begin, sizeof begin) : NULL;
    if (!at)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: its header cannot be read again", job->path);
    cts_describe_error(job->rmse, text);
    snprintf(padded, sizeof padded, "%-*s", CTS_ERROR_TEXT - 1, text);
    return cts_temp_write_at(job->temp, padded, CTS_ERROR_TEXT - 1, (uint64_t)(at - head) + sizeof begin + 4, err);
}

static exr_result_t set_texts(exr_context_t file, const CtsPictureInfo *info)
{
    const CtsPhrase window = cts_describe_window(info);
    char date_text[32];
    struct tm date;
    exr_result_t rv;
    if ((rv = exr_attr_set_string(file, 0, "software", "ctsplat " CTS_VERSION)) ||
        (rv = exr_attr_set_string(file, 0, "comments", "not for diagnostic use")) ||
        (rv = exr_attr_set_string(file, 0, "ctsplat.view", cts_describe_view(info).text)) ||
        (rv = exr_attr_set_string(file, 0, "ctsplat.error", no_error)) ||
        (info->tiles[0] && (rv = exr_attr_set_string(file, 0, "ctsplat.tiles", info->tiles))) ||
        (info->preset[0] && (rv = exr_attr_set_string(file, 0, "ctsplat.preset", info->preset))) ||
        (info->occlusion > 0 && (rv = exr_attr_set_float(file, 0, "ctsplat.occlusion", (float)info->occlusion))) ||
        (window.text[0] && (rv = exr_attr_set_string(file, 0, "ctsplat.window", window.text))))
        return rv;
    if (cts_date_now(&date)) {
        strftime(date_text, sizeof date_text, "%Y:%m:%d %H:%M:%S", &date);
        if (!(rv = exr_attr_set_string(file, 0, "capDate", date_text)))
            rv = exr_attr_set_float(file, 0, "utcOffset", 0);
    }
    return rv;
}

static exr_result_t write_header(ExrWriter *w)
{
    static const exr_attr_chromaticities_t rec709 = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
    const CtsExportHead *head = &w->job->head;
    exr_context_t file = w->file;
    int part;
    exr_result_t rv;
    if ((rv = exr_add_part(file, "picture", EXR_STORAGE_SCANLINE, &part)) ||
        (rv = exr_initialize_required_attr_simple(file, 0, head->width, head->height, EXR_COMPRESSION_ZIP)))
        return rv;
    static const char *const names[] = {"A", "B", "G", "R", "Z"};
    for (int c = 0; c < 5; c++) {
        const bool depth = c == 4;
        if (depth && !head->has_depth)
            continue;
        rv = exr_add_channel(file, 0, names[c], depth ? EXR_PIXEL_FLOAT : EXR_PIXEL_HALF,
                             depth ? EXR_PERCEPTUALLY_LINEAR : EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
        if (rv)
            return rv;
    }
    if ((rv = exr_attr_set_chromaticities(file, 0, "chromaticities", &rec709)) || (rv = set_texts(file, &head->info)) ||
        (rv = set_camera(file, head)))
        return rv;
    if ((rv = exr_write_header(file)))
        return rv;
    return exr_get_scanlines_per_chunk(file, 0, &w->lines_per_chunk);
}

/* Rows from y on, as linear RGBA; colours are divided by alpha, made linear, and multiplied by alpha again. */
static void linear_rows(const CtsPicture *p, int y, int n_rows, float *rgba)
{
    const size_t n = (size_t)n_rows * p->width;
    const float *v = p->pixels + (size_t)y * p->width * p->n_channels;
    for (size_t i = 0; i < n; i++, v += p->n_channels, rgba += 4) {
        if (p->n_channels == 1) {
            rgba[0] = rgba[1] = rgba[2] = (float)cts_srgb_to_linear(v[0]);
            rgba[3] = 1;
            continue;
        }
        const double alpha = p->has_alpha ? v[3] : 1;
        for (int c = 0; c < 3; c++)
            rgba[c] = alpha > 0 ? (float)(alpha * cts_srgb_to_linear(v[c] / alpha)) : 0;
        rgba[3] = (float)alpha;
    }
}

static void point_channels(const CtsPicture *p, int y, const float *rgba, exr_encode_pipeline_t *pipe)
{
    for (int c = 0; c < pipe->channel_count; c++) {
        exr_coding_channel_info_t *channel = &pipe->channels[c];
        const char *place = strchr("RGBA", channel->channel_name[0]);
        const float *from = place ? rgba + (place - "RGBA") : p->depth_mm + (size_t)y * p->width;
        const int step = place ? 4 : 1;
        channel->encode_from_ptr = (const uint8_t *)from;
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = (int16_t)sizeof(float);
        channel->user_pixel_stride = (int32_t)(step * sizeof(float));
        channel->user_line_stride = (int32_t)((size_t)p->width * step * sizeof(float));
    }
}

static exr_result_t compress_chunk(exr_context_t file, const CtsPicture *band, int y, const float *rgba,
                                   exr_encode_pipeline_t *pipe)
{
    exr_chunk_info_t chunk;
    exr_result_t rv = exr_write_scanline_chunk_info(file, 0, band->first_row + y, &chunk);
    if (rv || (rv = exr_encoding_initialize(file, 0, &chunk, pipe)))
        return rv;
    point_channels(band, y, rgba, pipe);
    if ((rv = exr_encoding_choose_default_routines(file, 0, pipe)))
        return rv;
    pipe->yield_until_ready_fn = NULL;
    pipe->write_fn = NULL;
    return exr_encoding_run(file, 0, pipe);
}

static CtsStatus pack_chunk(const CtsExportJob *job, const CtsPicture *band, CtsPackedRows *rows)
{
    const ExrWriter *const w = job->state;
    exr_encode_pipeline_t pipe = EXR_ENCODE_PIPELINE_INITIALIZER;
    float *rgba;
    CtsStatus st = cts_alloc_array(&rgba, (size_t)rows->n_rows * (size_t)band->width * 4, NULL);
    if (st)
        return st;
    linear_rows(band, rows->y, rows->n_rows, rgba);
    st = compress_chunk(w->file, band, rows->y, rgba, &pipe) ? CTS_ERR_OUTPUT : CTS_OK;
    if (!st && !(st = cts_alloc_bytes(&rows->bytes, pipe.compressed_bytes, 1, NULL))) {
        rows->n_bytes = pipe.compressed_bytes;
        memcpy(rows->bytes, pipe.compressed_buffer, rows->n_bytes);
    }
    exr_encoding_destroy(w->file, &pipe);
    cts_free(&rgba);
    return st;
}

static CtsStatus write_packed_chunk(CtsExportJob *job, const CtsPicture *band, const CtsPackedRows *rows, CtsError *err)
{
    ExrWriter *const w = job->state;
    w->err = err;
    failed(w, exr_write_scanline_chunk(w->file, 0, band->first_row + rows->y, rows->bytes, rows->n_bytes));
    return w->status;
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    ExrWriter *w = job->state;
    *w = (ExrWriter){.job = job, .err = err};
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = say_nothing;
    setup.user_data = w;
    setup.write_fn = on_write;
    setup.zip_level = ZIP_LEVEL;
    if (failed(w, exr_start_write(&w->file, job->path, EXR_WRITE_FILE_DIRECTLY, &setup)) || failed(w, write_header(w)))
        return w->status;
    return CTS_BAND_ROWS % w->lines_per_chunk
               ? cts_fail(err, CTS_ERR_INTERNAL, "%s: chunks of %d lines", job->path, w->lines_per_chunk)
               : CTS_OK;
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    const ExrWriter *const w = job->state;
    return cts_export_packed(job, band, &(CtsRowPacking){w->lines_per_chunk, pack_chunk, write_packed_chunk}, err);
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    ExrWriter *w = job->state;
    w->err = err;
    failed(w, exr_finish(&w->file)); /* the table of chunks is written here */
    return w->status || job->rmse < 0 ? w->status : patch_error(job, err);
}

static void release(CtsExportJob *job)
{
    ExrWriter *w = job->state;
    w->err = NULL;
    if (w->file)
        exr_finish(&w->file);
}

/* The largest ratio of OpenEXR's compressions: a file that claims more pixels is truncated or malicious. */
enum { MAX_RATIO = 65536, N_CHANNELS = 6 };

/* In the order of the places in a chunk's buffer. */
static const char channel_names[N_CHANNELS] = "RGBAZY";
enum { RED, GREEN, BLUE, ALPHA, DEPTH, LUMA };

typedef struct ExrReader {
    const char *path;
    exr_context_t file;
    exr_decode_pipeline_t pipe;
    bool started;
    bool present[N_CHANNELS];
    int width, height, y0, lines_per_chunk;
    float *planes[N_CHANNELS]; /* of one chunk */
    CtsPicture *picture;
    CtsError *err;
    CtsStatus status;
} ExrReader;

static CtsStatus refuse_exr(ExrReader *r, const char *why)
{
    if (!r->status)
        r->status = cts_fail(r->err, CTS_ERR_READ, "%s: not an OpenEXR picture that can be read: %s", r->path, why);
    return r->status;
}

static CtsStatus check_exr(ExrReader *r, exr_result_t code)
{
    return code ? refuse_exr(r, exr_get_default_error_message(code)) : r->status;
}

static CtsStatus find_channels(ExrReader *r)
{
    const exr_attr_chlist_t *list = NULL;
    if (check_exr(r, exr_get_channels(r->file, 0, &list)))
        return r->status;
    for (int i = 0; i < list->num_channels; i++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[i];
        const char *place = entry->name.length == 1 ? memchr(channel_names, entry->name.str[0], N_CHANNELS) : NULL;
        if (!place)
            continue;
        if (entry->x_sampling != 1 || entry->y_sampling != 1 || entry->pixel_type == EXR_PIXEL_UINT)
            return refuse_exr(r, "a channel is subsampled or holds integers");
        r->present[place - channel_names] = true;
    }
    const bool colour = r->present[RED] && r->present[GREEN] && r->present[BLUE];
    r->present[LUMA] = r->present[LUMA] && !colour;
    return colour || r->present[LUMA] ? CTS_OK : refuse_exr(r, "it has neither R, G and B nor Y");
}

static CtsStatus read_exr_header(ExrReader *r)
{
    int n_parts = 0;
    exr_storage_t storage;
    exr_attr_box2i_t data, display;
    if (check_exr(r, exr_get_count(r->file, &n_parts)) || check_exr(r, exr_get_storage(r->file, 0, &storage)) ||
        check_exr(r, exr_get_data_window(r->file, 0, &data)) ||
        check_exr(r, exr_get_display_window(r->file, 0, &display)))
        return r->status;
    if (n_parts != 1 || storage != EXR_STORAGE_SCANLINE)
        return refuse_exr(r, "it is not one part of scan lines");
    if (memcmp(&data, &display, sizeof data) != 0)
        return refuse_exr(r, "its data window is not its display window");
    const int64_t width = (int64_t)data.max.x - data.min.x + 1, height = (int64_t)data.max.y - data.min.y + 1;
    if (width < 1 || height < 1 || width > CTS_MAX_SIDE || height > CTS_MAX_SIDE)
        return refuse_exr(r, "its size is beyond what a picture can have");
    r->width = (int)width;
    r->height = (int)height;
    r->y0 = data.min.y;
    if (find_channels(r))
        return r->status;
    return check_exr(r, exr_get_scanlines_per_chunk(r->file, 0, &r->lines_per_chunk));
}

static CtsStatus allocate(ExrReader *r)
{
    struct stat about;
    if (stat(r->path, &about) == 0 &&
        (uint64_t)r->width * (uint64_t)r->height * 2 > (uint64_t)about.st_size * MAX_RATIO)
        return refuse_exr(r, "it is too short for its size in pixels");
    const size_t n = (size_t)r->width * r->lines_per_chunk;
    const bool grey = r->present[LUMA] && !r->present[ALPHA];
    if ((r->status = cts_picture_new(&r->picture, r->width, r->height, grey ? 1 : 4, r->err)))
        return r->status;
    r->picture->has_alpha = r->present[ALPHA];
    for (int c = 0; c < N_CHANNELS; c++)
        if (r->present[c] && (r->status = cts_alloc_array(&r->planes[c], n, r->err)))
            return r->status;
    if (r->present[DEPTH])
        r->status = cts_alloc_array(&r->picture->depth_mm, (size_t)r->width * r->height, r->err);
    return r->status;
}

static CtsStatus decode_chunk(ExrReader *r, int y)
{
    exr_chunk_info_t chunk;
    if (check_exr(r, exr_read_scanline_chunk_info(r->file, 0, r->y0 + y, &chunk)) ||
        check_exr(r, r->started ? exr_decoding_update(r->file, 0, &chunk, &r->pipe)
                                : exr_decoding_initialize(r->file, 0, &chunk, &r->pipe)))
        return r->status;
    for (int c = 0; c < r->pipe.channel_count; c++) {
        exr_coding_channel_info_t *channel = &r->pipe.channels[c];
        const char *name = channel->channel_name;
        const char *place = name[0] && !name[1] ? memchr(channel_names, name[0], N_CHANNELS) : NULL;
        channel->decode_to_ptr = place ? (uint8_t *)r->planes[place - channel_names] : NULL;
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = (int16_t)sizeof(float);
        channel->user_pixel_stride = (int32_t)sizeof(float);
        channel->user_line_stride = (int32_t)(r->width * sizeof(float));
    }
    if (!r->started && check_exr(r, exr_decoding_choose_default_routines(r->file, 0, &r->pipe)))
        return r->status;
    r->started = true;
    return check_exr(r, exr_decoding_run(r->file, 0, &r->pipe));
}

/* Linear light to display values, the inverse of the writer's conversion. */
static CtsStatus fill_pixels(ExrReader *r, int y, size_t n)
{
    CtsPicture *p = r->picture;
    const size_t first = (size_t)y * r->width;
    for (size_t i = 0; i < n; i++) {
        float *v = p->pixels + (first + i) * p->n_channels;
        const double alpha = p->has_alpha ? r->planes[ALPHA][i] : 1;
        if (isnan(alpha))
            return refuse_exr(r, "a pixel is not a number");
        for (int c = 0; c < (p->n_channels == 1 ? 1 : 3); c++) {
            const float linear = r->planes[r->present[LUMA] ? LUMA : c][i];
            if (isnan(linear))
                return refuse_exr(r, "a pixel is not a number");
            v[c] = alpha > 0 ? (float)(alpha * cts_linear_to_srgb(linear / alpha)) : 0;
        }
        if (p->n_channels == 4)
            v[3] = (float)alpha;
    }
    if (p->depth_mm)
        memcpy(p->depth_mm + first, r->planes[DEPTH], n * sizeof(float));
    return CTS_OK;
}

/* The writer gives a picture over a background an alpha of 1 everywhere. */
static bool lets_through(const CtsPicture *p)
{
    const size_t n = (size_t)p->width * p->height;
    for (size_t i = 0; i < n; i++)
        if (p->pixels[4 * i + 3] != 1)
            return true;
    return false;
}

static CtsStatus read_exr_file(ExrReader *r)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = say_nothing;
    setup.user_data = r;
    setup.max_image_width = setup.max_image_height = CTS_MAX_SIDE;
    setup.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    if (check_exr(r, exr_start_read(&r->file, r->path, &setup)) || read_exr_header(r) || allocate(r))
        return r->status;
    for (int y = 0; y < r->height && !r->status; y += r->lines_per_chunk) {
        const int n_rows = r->height - y < r->lines_per_chunk ? r->height - y : r->lines_per_chunk;
        if (decode_chunk(r, y) == CTS_OK)
            fill_pixels(r, y, (size_t)n_rows * r->width);
    }
    if (!r->status && r->picture->has_alpha)
        r->picture->has_alpha = lets_through(r->picture);
    return r->status;
}

static CtsStatus read_exr(const char *path, CtsPicture **picture, CtsError *err)
{
    ExrReader r = {.path = path, .err = err, .pipe = EXR_DECODE_PIPELINE_INITIALIZER};
    read_exr_file(&r);
    if (r.file) {
        exr_decoding_destroy(r.file, &r.pipe);
        exr_finish(&r.file);
    }
    for (int c = 0; c < N_CHANNELS; c++)
        cts_free(&r.planes[c]);
    if (r.status)
        cts_picture_free(&r.picture);
    *picture = r.picture;
    return r.status;
}

const CtsFormat cts_format_exr = {
    .info = {"exr", "OpenEXR", "application/octet-stream", .has_depth = true, .has_alpha = true, .read_back = true},
    .magic = "\x76\x2f\x31\x01",
    CTS_FORMAT_STEPS(ExrWriter),
    .read = read_exr,
};
