/* 16-bit PNG: libpng writes the file, idat.c compresses the pixels. */
#include "export/format.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "export/idat.h"
#include "image/describe.h"
#include "image/samples.h"
#include <math.h>
#include <png.h>
#include <string.h>

enum { BATCH = 64 };

/* Where libpng's callbacks find what belongs to this file. */
typedef struct PngWriter {
    const CtsExportJob *job;
    CtsError *err;
    CtsStatus status;
    CtsIdat idat;
    uint32_t adler; /* of the strips written */
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
    png_set_IHDR(png, info, (png_uint_32)picture->width, (png_uint_32)picture->height, 16,
                 colour_types[w->idat.n_samples], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    const double pixels_per_m = picture->info.mm_per_pixel > 0 ? floor(1000 / picture->info.mm_per_pixel + 0.5) : 0;
    if (pixels_per_m >= 1 && pixels_per_m <= PNG_UINT_31_MAX)
        png_set_pHYs(png, info, (png_uint_32)pixels_per_m, (png_uint_32)pixels_per_m, PNG_RESOLUTION_METER);
    put_texts(png, info, &picture->info);
}

/* Serial on purpose: libpng leaves by longjmp, which must not cross a parallel region. */
static void write_strips(png_structp png, PngWriter *w, const CtsIdatStrip *strips, int first, int n)
{
    for (int i = 0; i < n; i++) {
        w->adler = cts_idat_checksum(w->adler, &strips[i]);
        png_write_chunk_start(png, (png_const_bytep) "IDAT",
                              (png_uint_32)(strips[i].n_bytes + (first + i == w->idat.n_strips - 1 ? 4 : 0)));
        png_write_chunk_data(png, strips[i].bytes, strips[i].n_bytes);
        if (first + i == w->idat.n_strips - 1) {
            png_byte check[4];
            png_save_uint_32(check, w->adler);
            png_write_chunk_data(png, check, sizeof check);
        }
        png_write_chunk_end(png);
    }
}

/* The three steps that talk to libpng; kept apart so that nothing local changes between setjmp and a longjmp back. */
static CtsStatus write_start(png_structp png, png_infop info, PngWriter *w)
{
    if (setjmp(png_jmpbuf(png)))
        return w->status;
    png_set_write_fn(png, w, on_write, on_flush);
    png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    put_header(png, info, w);
    png_write_info(png, info);
    return CTS_OK;
}

static CtsStatus write_batch(png_structp png, PngWriter *w, const CtsIdatStrip *strips, int first, int n)
{
    if (setjmp(png_jmpbuf(png)))
        return w->status;
    write_strips(png, w, strips, first, n);
    return CTS_OK;
}

static CtsStatus write_finish(png_structp png, PngWriter *w)
{
    if (setjmp(png_jmpbuf(png)))
        return w->status;
    png_write_chunk(png, (png_const_bytep) "IEND", NULL, 0); /* png_write_end() knows nothing of our IDATs */
    return CTS_OK;
}

/* Compress up to BATCH strips in parallel, write them in order, and so on: what is held is bounded. */
static CtsStatus write_rows(png_structp png, PngWriter *w)
{
    const int n_threads = cts_threads(w->job->settings->n_threads);
    CtsStatus st = CTS_OK;
    for (int first = 0; first < w->idat.n_strips && !st; first += BATCH) {
        CtsIdatStrip strips[BATCH] = {0};
        CtsError errors[BATCH];
        const int left = w->idat.n_strips - first, n = left < BATCH ? left : BATCH;
        CtsStatus found[BATCH];
#pragma omp parallel for num_threads(n_threads) schedule(dynamic, 1)
        for (int i = 0; i < n; i++)
            found[i] = cts_idat_strip(&w->idat, first + i, &strips[i], &errors[i]);
        for (int i = 0; i < n && !st; i++)
            if (found[i])
                st = cts_fail(w->err, found[i], "%s: %s", w->job->path, errors[i].text);
        if (!st)
            st = write_batch(png, w, strips, first, n);
        for (int i = 0; i < n; i++)
            cts_free(&strips[i].bytes);
    }
    return st;
}

CtsStatus cts_png_write(const CtsExportJob *job, CtsError *err)
{
    const CtsPicture *picture = job->frames[0];
    PngWriter w = {.job = job, .err = err, .adler = 1};
    const bool alpha = picture->n_channels == 4 && picture->has_alpha;
    w.idat = cts_idat_plan(picture, alpha ? 4 : cts_picture_is_grey(picture) ? 1 : 3);
    png_infop info = NULL;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &w, on_write_error, on_warning);
    CtsStatus st = CTS_OK;
    if (!png || !(info = png_create_info_struct(png)))
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    if (!st && !(st = write_start(png, info, &w)) && !(st = write_rows(png, &w)))
        st = write_finish(png, &w);
    png_destroy_write_struct(&png, &info);
    return st;
}
