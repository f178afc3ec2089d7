/* 16-bit PNG: libpng writes the file, idat.c compresses the pixels. */
#include "export/format.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "export/idat.h"
#include "image/describe.h"
#include "image/samples.h"
#include <endian.h>
#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

/* Strips that are compressed side by side, and so how much waits: 16 MiB. */
enum { BATCH = 64 };

/* Where libpng's callbacks find what belongs to this file. */
typedef struct PngWriter {
    const CtsExportJob *job;
    png_structp png;
    png_infop info;
    CtsError *err; /* of the call under way */
    CtsStatus status;
    CtsIdat idat;
    uint8_t *rows; /* the last row written, then the rows that wait, samples big-endian */
    int n_waiting, capacity;
    int next_strip;
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
    const CtsExportHead *head = &w->job->head;
    png_set_IHDR(png, info, (png_uint_32)head->width, (png_uint_32)head->height, 16, colour_types[w->idat.n_samples],
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    const double mm_per_pixel = head->info.mm_per_pixel;
    const double pixels_per_m = mm_per_pixel > 0 ? floor(1000 / mm_per_pixel + 0.5) : 0;
    if (pixels_per_m >= 1 && pixels_per_m <= PNG_UINT_31_MAX)
        png_set_pHYs(png, info, (png_uint_32)pixels_per_m, (png_uint_32)pixels_per_m, PNG_RESOLUTION_METER);
    const png_color_16 black = {0};
    if (head->has_alpha)
        png_set_bKGD(png, info, &black); /* what lies behind where a viewer has no other idea; DICOM shows the same */
    put_texts(png, info, &head->info);
}

/* Serial on purpose: libpng leaves by longjmp, which must not cross a parallel region. */
static void write_strips(PngWriter *w, const CtsIdatStrip *strips, int n)
{
    for (int i = 0; i < n; i++) {
        const bool last = w->next_strip == w->idat.n_strips - 1;
        w->adler = cts_idat_checksum(w->adler, &strips[i]);
        png_write_chunk_start(w->png, (png_const_bytep) "IDAT", (png_uint_32)(strips[i].n_bytes + (last ? 4 : 0)));
        png_write_chunk_data(w->png, strips[i].bytes, strips[i].n_bytes);
        if (last) {
            png_byte check[4];
            png_save_uint_32(check, w->adler);
            png_write_chunk_data(w->png, check, sizeof check);
        }
        png_write_chunk_end(w->png);
        w->next_strip++;
    }
}

/* The three steps that talk to libpng; kept apart so that nothing local changes between setjmp and a longjmp back. */
static CtsStatus write_start(PngWriter *w)
{
    if (setjmp(png_jmpbuf(w->png)))
        return w->status;
    png_set_write_fn(w->png, w, on_write, on_flush);
    png_set_user_limits(w->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    put_header(w->png, w->info, w);
    png_write_info(w->png, w->info);
    return CTS_OK;
}

static CtsStatus write_batch(PngWriter *w, const CtsIdatStrip *strips, int n)
{
    if (setjmp(png_jmpbuf(w->png)))
        return w->status;
    write_strips(w, strips, n);
    return CTS_OK;
}

static CtsStatus write_finish(PngWriter *w)
{
    if (setjmp(png_jmpbuf(w->png)))
        return w->status;
    png_write_chunk(w->png, (png_const_bytep) "IEND", NULL, 0); /* png_write_end() knows nothing of our IDATs */
    return CTS_OK;
}

typedef struct Packing {
    const PngWriter *writer;
    CtsIdatStrip *strips;
    CtsError *errors;
    CtsStatus *found;
} Packing;

static void pack_strips(void *context, int worker, size_t first, size_t end)
{
    const Packing *const p = context;
    const PngWriter *w = p->writer;
    (void)worker;
    for (size_t i = first; i < end; i++)
        p->found[i] = cts_idat_strip(&w->idat, w->next_strip + (int)i,
                                     w->rows + (1 + i * (size_t)w->idat.rows_per_strip) * w->idat.row_bytes,
                                     &p->strips[i], &p->errors[i]);
}

/* All rows that wait: compressed strip by strip in parallel, written in order. */
static CtsStatus flush_rows(PngWriter *w)
{
    CtsIdatStrip strips[BATCH] = {0};
    CtsError errors[BATCH];
    CtsStatus found[BATCH], st = CTS_OK;
    const size_t row_bytes = w->idat.row_bytes;
    const int per_strip = w->idat.rows_per_strip, n = (w->n_waiting + per_strip - 1) / per_strip;
    Packing packing = {w, strips, errors, found};
    cts_parallel(cts_threads(w->job->settings.n_threads), (size_t)n, 1, pack_strips, &packing);
    for (int i = 0; i < n && !st; i++)
        if (found[i])
            st = cts_fail(w->err, found[i], "%s: %s", w->job->path, errors[i].text);
    if (!st)
        st = write_batch(w, strips, n);
    for (int i = 0; i < n; i++)
        cts_free(&strips[i].bytes);
    memcpy(w->rows, w->rows + (size_t)w->n_waiting * row_bytes, row_bytes);
    w->n_waiting = 0;
    return st;
}

typedef struct Adding {
    PngWriter *writer;
    const CtsPicture *band;
    int first_row; /* of the band */
} Adding;

static void convert_rows(void *context, int worker, size_t first, size_t end)
{
    const Adding *const a = context;
    const CtsIdat *idat = &a->writer->idat;
    const size_t n_samples = idat->row_bytes / 2;
    (void)worker;
    for (size_t i = first; i < end; i++) {
        uint16_t *row = (uint16_t *)(void *)a->writer->rows + (1 + (size_t)a->writer->n_waiting + i) * n_samples;
        cts_samples_row16(a->band, a->first_row + (int)i, idat->n_samples, row);
        for (size_t k = 0; k < n_samples; k++)
            row[k] = htobe16(row[k]);
    }
}

/* Rows y to y + n - 1 join those that wait. */
static void add_rows(PngWriter *w, const CtsPicture *band, int y, int n)
{
    Adding adding = {w, band, y};
    cts_parallel(cts_threads(w->job->settings.n_threads), (size_t)n, 0, convert_rows, &adding);
    w->n_waiting += n;
}

CtsStatus cts_png_begin(CtsExportJob *job, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    CtsStatus st;
    PngWriter *w = job->state = calloc(1, sizeof *w);
    if (!w)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    *w = (PngWriter){.job = job, .err = err, .adler = 1};
    w->idat = cts_idat_plan(head->width, head->height, head->has_alpha ? 4 : head->grey ? 1 : 3);
    const int batch = w->idat.n_strips < BATCH ? w->idat.n_strips : BATCH;
    w->capacity = batch * w->idat.rows_per_strip;
    if ((st = cts_alloc_array(&w->rows, ((size_t)w->capacity + 1) * w->idat.row_bytes, err)))
        return st;
    memset(w->rows, 0, w->idat.row_bytes);
    w->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, w, on_write_error, on_warning);
    if (!w->png || !(w->info = png_create_info_struct(w->png)))
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    return write_start(w);
}

CtsStatus cts_png_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    PngWriter *w = job->state;
    CtsStatus st = CTS_OK;
    w->err = err;
    for (int y = 0; y < band->height && !st;) {
        const int room = w->capacity - w->n_waiting, left = band->height - y, n = left < room ? left : room;
        add_rows(w, band, y, n);
        y += n;
        if (w->n_waiting == w->capacity)
            st = flush_rows(w);
    }
    return st;
}

CtsStatus cts_png_finish(CtsExportJob *job, CtsError *err)
{
    PngWriter *w = job->state;
    w->err = err;
    const CtsStatus st = w->n_waiting > 0 ? flush_rows(w) : CTS_OK;
    return st ? st : write_finish(w);
}

void cts_png_close(CtsExportJob *job)
{
    PngWriter *w = job->state;
    if (!w)
        return;
    if (w->png)
        png_destroy_write_struct(&w->png, &w->info);
    cts_free(&w->rows);
    free(w);
}
