/* OpenEXR read back through OpenEXRCore: one scanline part with R G B, A and Z if there, or Y. */
#include "output/export/format.h"

#include "base/mem.h"
#include "ctsplat/bounds.h"
#include "output/image/samples.h"
#include <math.h>
#include <openexr.h>
#include <string.h>
#include <sys/stat.h>

/* No compression of OpenEXR's shrinks more: a file that promises more pixels is cut short or a trap. */
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

static CtsStatus refuse(ExrReader *r, const char *why)
{
    if (!r->status)
        r->status = cts_fail(r->err, CTS_ERR_READ, "%s: not an OpenEXR picture that can be read: %s", r->path, why);
    return r->status;
}

static CtsStatus check(ExrReader *r, exr_result_t code)
{
    return code ? refuse(r, exr_get_default_error_message(code)) : r->status;
}

static CtsStatus find_channels(ExrReader *r)
{
    const exr_attr_chlist_t *list = NULL;
    if (check(r, exr_get_channels(r->file, 0, &list)))
        return r->status;
    for (int i = 0; i < list->num_channels; i++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[i];
        const char *place = entry->name.length == 1 ? memchr(channel_names, entry->name.str[0], N_CHANNELS) : NULL;
        if (!place)
            continue;
        if (entry->x_sampling != 1 || entry->y_sampling != 1 || entry->pixel_type == EXR_PIXEL_UINT)
            return refuse(r, "a channel is subsampled or holds integers");
        r->present[place - channel_names] = true;
    }
    const bool colour = r->present[RED] && r->present[GREEN] && r->present[BLUE];
    r->present[LUMA] = r->present[LUMA] && !colour;
    return colour || r->present[LUMA] ? CTS_OK : refuse(r, "it has neither R, G and B nor Y");
}

static CtsStatus read_header(ExrReader *r)
{
    int n_parts = 0;
    exr_storage_t storage;
    exr_attr_box2i_t data, display;
    if (check(r, exr_get_count(r->file, &n_parts)) || check(r, exr_get_storage(r->file, 0, &storage)) ||
        check(r, exr_get_data_window(r->file, 0, &data)) || check(r, exr_get_display_window(r->file, 0, &display)))
        return r->status;
    if (n_parts != 1 || storage != EXR_STORAGE_SCANLINE)
        return refuse(r, "it is not one part of scan lines");
    if (memcmp(&data, &display, sizeof data) != 0)
        return refuse(r, "its data window is not its display window");
    const int64_t width = (int64_t)data.max.x - data.min.x + 1, height = (int64_t)data.max.y - data.min.y + 1;
    if (width < 1 || height < 1 || width > CTS_MAX_SIDE || height > CTS_MAX_SIDE)
        return refuse(r, "its size is beyond what a picture can have");
    r->width = (int)width;
    r->height = (int)height;
    r->y0 = data.min.y;
    if (find_channels(r))
        return r->status;
    return check(r, exr_get_scanlines_per_chunk(r->file, 0, &r->lines_per_chunk));
}

static CtsStatus allocate(ExrReader *r)
{
    struct stat about;
    if (stat(r->path, &about) == 0 &&
        (uint64_t)r->width * (uint64_t)r->height * 2 > (uint64_t)about.st_size * MAX_RATIO)
        return refuse(r, "it is too short for its size in pixels");
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
    if (check(r, exr_read_scanline_chunk_info(r->file, 0, r->y0 + y, &chunk)) ||
        check(r, r->started ? exr_decoding_update(r->file, 0, &chunk, &r->pipe)
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
    if (!r->started && check(r, exr_decoding_choose_default_routines(r->file, 0, &r->pipe)))
        return r->status;
    r->started = true;
    return check(r, exr_decoding_run(r->file, 0, &r->pipe));
}

/* Linear light to display values, the way back of what the writer does. */
static CtsStatus fill_pixels(ExrReader *r, int y, size_t n)
{
    CtsPicture *p = r->picture;
    const size_t first = (size_t)y * r->width;
    for (size_t i = 0; i < n; i++) {
        float *v = p->pixels + (first + i) * p->n_channels;
        const double alpha = p->has_alpha ? r->planes[ALPHA][i] : 1;
        if (isnan(alpha))
            return refuse(r, "a pixel is not a number");
        for (int c = 0; c < (p->n_channels == 1 ? 1 : 3); c++) {
            const float linear = r->planes[r->present[LUMA] ? LUMA : c][i];
            if (isnan(linear))
                return refuse(r, "a pixel is not a number");
            v[c] = alpha > 0 ? (float)(alpha * cts_linear_to_srgb(linear / alpha)) : 0;
        }
        if (p->n_channels == 4)
            v[3] = (float)alpha;
    }
    if (p->depth_mm)
        memcpy(p->depth_mm + first, r->planes[DEPTH], n * sizeof(float));
    return CTS_OK;
}

/* Alpha of 1 everywhere is what the writer says of a picture over a background. */
static bool lets_through(const CtsPicture *p)
{
    const size_t n = (size_t)p->width * p->height;
    for (size_t i = 0; i < n; i++)
        if (p->pixels[4 * i + 3] != 1)
            return true;
    return false;
}

/* As the writer's in exr.c. */
static void say_nothing(exr_const_context_t file, exr_result_t code, const char *message)
{
    (void)file;
    (void)code;
    (void)message;
}

static CtsStatus read_all(ExrReader *r)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = say_nothing;
    setup.user_data = r;
    setup.max_image_width = setup.max_image_height = CTS_MAX_SIDE;
    setup.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    if (check(r, exr_start_read(&r->file, r->path, &setup)) || read_header(r) || allocate(r))
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

CtsStatus cts_exr_read(const char *path, CtsPicture **picture, CtsError *err)
{
    ExrReader r = {.path = path, .err = err, .pipe = EXR_DECODE_PIPELINE_INITIALIZER};
    read_all(&r);
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
