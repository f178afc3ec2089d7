/* 16-bit PNG through libpng. */
#include "export/format.h"

#include "base/mem.h"
#include "image/describe.h"
#include "image/samples.h"
#include <math.h>
#include <png.h>
#include <string.h>
#include <zlib.h>

/* Where libpng's callbacks find what belongs to this file. */
typedef struct PngWriter {
    const CtsExportJob *job;
    CtsError *err;
    CtsStatus status;
    int n_samples; /* 1 grey, 3 RGB, 4 RGBA */
    uint16_t *samples;
    uint8_t *row;
} PngWriter;

static void on_write(png_structp png, png_bytep data, size_t n)
{
    PngWriter *w = png_get_io_ptr(png);
    w->status = cts_temp_write(w->job->temp, data, n, w->err);
    if (w->status)
        png_longjmp(png, 1);
}

static void on_flush(png_structp png)
{
    (void)png;
}

static void on_write_error(png_structp png, png_const_charp message)
{
    PngWriter *w = png_get_error_ptr(png);
    w->status = cts_fail(w->err, CTS_ERR_OUTPUT, "%s: libpng: %s", w->job->path, message);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static bool is_ascii(const char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text > 126)
            return false;
    return true;
}

/* Who made the picture, of what, and what it is not for. No dates: the same picture gives the same bytes. */
static void put_texts(png_structp png, png_infop info, const CtsPictureInfo *about)
{
    char preset[sizeof about->preset], view[80], scale[32], window[80];
    snprintf(preset, sizeof preset, "%s", about->preset);
    cts_describe_view(about, view, sizeof view);
    cts_describe_number(about->mm_per_pixel, 9, scale, sizeof scale);
    const bool has_window = cts_describe_window(about, window, sizeof window);
    const struct {
        const char *key;
        char *text;
        bool present;
    } lines[] = {
        {"Software", (char[]){"ctsplat " CTS_VERSION}, true},
        {"Disclaimer", (char[]){"not for diagnostic use"}, true},
        {"ctsplat:preset", preset, preset[0] != 0},
        {"ctsplat:view", view, true},
        {"ctsplat:mm_per_pixel", scale, about->mm_per_pixel > 0},
        {"ctsplat:window", window, has_window},
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        png_text text = {.key = (char[80]){0}, .text = lines[i].text};
        snprintf(text.key, 80, "%s", lines[i].key);
        text.compression = is_ascii(lines[i].text) ? PNG_TEXT_COMPRESSION_NONE : PNG_ITXT_COMPRESSION_NONE;
        if (lines[i].present)
            png_set_text(png, info, &text, 1);
    }
}

static void put_header(png_structp png, png_infop info, const PngWriter *w)
{
    static const int colour_types[] = {[1] = PNG_COLOR_TYPE_GRAY, [3] = PNG_COLOR_TYPE_RGB, [4] = PNG_COLOR_TYPE_RGBA};
    const CtsPicture *picture = w->job->frames[0];
    png_set_IHDR(png, info, (png_uint_32)picture->width, (png_uint_32)picture->height, 16, colour_types[w->n_samples],
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    const double pixels_per_m = picture->info.mm_per_pixel > 0 ? floor(1000 / picture->info.mm_per_pixel + 0.5) : 0;
    if (pixels_per_m >= 1 && pixels_per_m <= PNG_UINT_31_MAX)
        png_set_pHYs(png, info, (png_uint_32)pixels_per_m, (png_uint_32)pixels_per_m, PNG_RESOLUTION_METER);
    put_texts(png, info, &picture->info);
}

/* Kept apart from the rest: nothing local changes between setjmp and a longjmp back. */
static void write_all(png_structp png, png_infop info, PngWriter *w)
{
    const CtsPicture *picture = w->job->frames[0];
    const size_t n = (size_t)picture->width * w->n_samples;
    if (setjmp(png_jmpbuf(png)))
        return;
    png_set_write_fn(png, w, on_write, on_flush);
    png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    put_header(png, info, w);
    /* The low bytes of a render are noise: run lengths and Huffman codes find what a long search would, far sooner. */
    png_set_compression_level(png, 1);
    png_set_compression_strategy(png, Z_RLE);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_compression_buffer_size(png, 1 << 18);
    png_write_info(png, info);
    for (int y = 0; y < picture->height; y++) {
        cts_samples_row16(picture, y, w->n_samples, w->samples);
        for (size_t i = 0; i < n; i++) {
            w->row[2 * i] = (uint8_t)(w->samples[i] >> 8);
            w->row[2 * i + 1] = (uint8_t)w->samples[i];
        }
        png_write_row(png, w->row);
    }
    png_write_end(png, NULL);
}

CtsStatus cts_png_write(const CtsExportJob *job, CtsError *err)
{
    const CtsPicture *picture = job->frames[0];
    PngWriter w = {.job = job, .err = err};
    w.n_samples = picture->n_channels == 4 && picture->has_alpha ? 4 : cts_picture_is_grey(picture) ? 1 : 3;
    png_infop info = NULL;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &w, on_write_error, on_warning);
    if (!png || !(info = png_create_info_struct(png)))
        w.status = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    const size_t n = (size_t)picture->width * w.n_samples;
    if (!w.status && !(w.status = cts_alloc_array(&w.samples, n, err)) &&
        !(w.status = cts_alloc_array(&w.row, 2 * n, err)))
        write_all(png, info, &w);
    png_destroy_write_struct(&png, &info);
    cts_free(&w.samples);
    cts_free(&w.row);
    return w.status;
}
