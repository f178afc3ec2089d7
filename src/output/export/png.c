/* PNG, 16 or 8 bits a sample, and any kind read back.
 *
 * libpng writes the chunks, but not the rows: it compresses on one thread, and at its default level takes many times
 * longer than a render. So rows are cut into strips that are filtered and packed side by side, the same ones for any
 * number of threads. Paeth is the filter: measured, Up makes 4 to 5 % more bytes of 16-bit renders, 2 to 17 % of 8-bit
 * ones. */
#include "output/export/format.h"

#include "base/mem.h"
#include "ctsplat/bounds.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

enum { STRIP_BYTES = 512 << 10, FILTER_SUB = 1, FILTER_PAETH = 4 };

/* Errors of libpng's calls, each of which is made behind a setjmp(). */
typedef struct PngErrors {
    const char *path, *subject; /* of messages */
    CtsStatus kind;
    CtsError *err;    /* of the current call */
    CtsStatus status; /* of the error */
} PngErrors;

static void on_png_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void on_png_error(png_structp png, png_const_charp message)
{
    PngErrors *const e = png_get_error_ptr(png);
    e->status = cts_fail(e->err, e->kind, "%s: %s: %s", e->path, e->subject, message);
    png_longjmp(png, 1);
}

typedef struct PngWriter {
    PngErrors errors;
    const CtsExportJob *job;
    png_structp png;
    png_infop info;
    int n_samples, sample_bytes; /* of a pixel, of a sample */
    size_t row_bytes;
    int rows_per_strip; /* a power of two: bands are whole strips */
    uint32_t adler;     /* of all rows so far */
} PngWriter;

static void write_bytes(png_structp png, png_bytep bytes, size_t n)
{
    PngWriter *const w = png_get_io_ptr(png);
    if ((w->errors.status = cts_temp_write(w->job->temp, bytes, n, w->errors.err)))
        png_longjmp(png, 1);
}

static void write_chunk(PngWriter *w, const char name[5], const void *bytes, size_t n)
{
    png_write_chunk(w->png, (png_const_bytep)name, bytes, n);
}

/* tEXt, or in other letters than ASCII iTXt. */
static void set_png_text(PngWriter *w, const char *key, const char *text)
{
    png_text line = {.compression = PNG_TEXT_COMPRESSION_NONE, .key = (char *)key, .text = (char *)text};
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c > 126)
            line.compression = PNG_ITXT_COMPRESSION_NONE;
    if (text[0])
        png_set_text(w->png, w->info, &line, 1);
}

/* Software, source and disclaimer. No dates: the same picture gives the same bytes. */
static void set_png_texts(PngWriter *w)
{
    const CtsPictureInfo *const about = &w->job->head.info;
    set_png_text(w, "Software", "ctsplat " CTS_VERSION);
    set_png_text(w, "Disclaimer", "not for diagnostic use");
    set_png_text(w, "ctsplat:preset", about->preset);
    set_png_text(w, "ctsplat:view", cts_describe_view(about).text);
    set_png_text(w, "ctsplat:tiles", about->tiles);
    if (about->mm_per_pixel > 0)
        set_png_text(w, "ctsplat:mm_per_pixel", cts_describe_number(about->mm_per_pixel, 9).text);
    set_png_text(w, "ctsplat:window", cts_describe_window(about).text);
    if (about->occlusion > 0)
        set_png_text(w, "ctsplat:occlusion", cts_describe_number(about->occlusion, 6).text);
}

/* Size and kind of pixels; colours as sRGB, and by gamma and chromaticities for readers that do not know it; pixels a
 * metre, where they fit; black as background for viewers, as in DICOM. */
static void write_head(PngWriter *w)
{
    static const int colour_types[] = {[1] = PNG_COLOR_TYPE_GRAY, [3] = PNG_COLOR_TYPE_RGB, [4] = PNG_COLOR_TYPE_RGBA};
    const CtsExportHead *const head = &w->job->head;
    const double mm_per_pixel = head->info.mm_per_pixel;
    const double pixels_per_m = mm_per_pixel > 0 ? floor(1000 / mm_per_pixel + 0.5) : 0;
    png_set_IHDR(w->png, w->info, (png_uint_32)head->width, (png_uint_32)head->height, 8 * w->sample_bytes,
                 colour_types[w->n_samples], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(w->png, w->info, PNG_sRGB_INTENT_PERCEPTUAL);
    if (head->has_alpha)
        png_set_bKGD(w->png, w->info, &(png_color_16){0});
    if (pixels_per_m >= 1 && pixels_per_m <= PNG_UINT_31_MAX)
        png_set_pHYs(w->png, w->info, (png_uint_32)pixels_per_m, (png_uint_32)pixels_per_m, PNG_RESOLUTION_METER);
    set_png_texts(w);
    png_write_info(w->png, w->info);
    write_chunk(w, "IDAT", "\x78\x01", 2); /* the stream begins: deflate, window of 32 KiB, fastest */
}

/* Row y as bytes, the high one of a sample first. */
static void convert_row(const PngWriter *w, const CtsPicture *band, int y, void *row)
{
    uint16_t *const samples = row;
    if (w->sample_bytes == 1) {
        cts_samples_row8(band, y, w->n_samples, row);
        return;
    }
    cts_samples_row16(band, y, w->n_samples, samples);
    for (size_t k = 0; k < w->row_bytes / 2; k++)
        samples[k] = htobe16(samples[k]);
}

/* Each byte minus its Paeth prediction: the one of left, above and above left (step bytes before) nearest to left +
 * above - above left, ties in this order. Types of 16 bits and abs() let compilers vectorise the loop: with int, or
 * with `v < 0 ? -v : v`, it takes two to four times as long. */
static void filter_paeth(const uint8_t *restrict row, const uint8_t *restrict above, size_t n, size_t step,
                         uint8_t *restrict to)
{
    const uint8_t *const lefts = row - step, *const corners = above - step;
    for (size_t i = 0; i < n; i++) {
        const int16_t left = lefts[i], up = above[i], corner = corners[i];
        const int16_t rise = (int16_t)(up - corner), run = (int16_t)(left - corner);
        const int16_t from_left = (int16_t)abs(rise), from_up = (int16_t)abs(run);
        const int16_t from_corner = (int16_t)abs(rise + run);
        const int16_t nearest = from_up < from_corner ? from_up : from_corner;
        const int16_t second = from_up <= from_corner ? up : corner;
        to[i] = (uint8_t)(row[i] - (from_left <= nearest ? left : second));
    }
}

/* Filters a strip, each row behind its filter's number. The first is filtered as if the row above were zeros, where
 * Paeth equals Sub, so that strips are independent. */
static CtsStatus filter_strip(const PngWriter *w, const CtsPicture *band, const CtsPackedRows *strip,
                              uint8_t **filtered)
{
    const size_t bpp = (size_t)(w->n_samples * w->sample_bytes), stride = bpp + w->row_bytes;
    const size_t n = (size_t)strip->n_rows;
    uint8_t *rows; /* the one above and the strip's, each behind a pixel of zeros */
    CtsStatus st = cts_alloc_array(&rows, (n + 1) * stride, NULL);
    if (!st)
        st = cts_alloc_array(filtered, n * (1 + w->row_bytes), NULL);
    if (!st)
        memset(rows, 0, stride);
    for (size_t r = 0; r < n && !st; r++) {
        uint8_t *const above = rows + r * stride + bpp, *const row = above + stride;
        uint8_t *const to = *filtered + r * (1 + w->row_bytes);
        memset(row - bpp, 0, bpp);
        *to = r == 0 ? FILTER_SUB : FILTER_PAETH;
        convert_row(w, band, strip->y + (int)r, row);
        filter_paeth(row, above, w->row_bytes, bpp, to + 1);
    }
    cts_free(&rows);
    return st;
}

/* Z_RLE finds runs of one byte: the high bytes of filtered rows are zeros, the low bytes of a render noise, and other
 * matches hardly save anything. A strip that is not the last ends on a byte, so that the next one can follow. */
static CtsStatus deflate_strip(uint8_t *filtered, size_t n, bool last, CtsPackedRows *strip)
{
    enum { FASTEST = 1, RAW = -15, MOST_MEMORY = 9, END_OF_FLUSH = 16 };
    z_stream z = {.next_in = filtered, .avail_in = (uInt)n};
    if (deflateInit2(&z, FASTEST, Z_DEFLATED, RAW, MOST_MEMORY, Z_RLE) != Z_OK)
        return CTS_ERR_MEMORY;
    z.avail_out = (uInt)deflateBound(&z, n) + END_OF_FLUSH;
    CtsStatus st = cts_alloc_bytes(&strip->bytes, z.avail_out, 1, NULL);
    if (!st) {
        z.next_out = strip->bytes;
        deflate(&z, last ? Z_FINISH : Z_FULL_FLUSH);
        st = z.avail_in || !z.avail_out ? CTS_ERR_INTERNAL : CTS_OK;
        strip->n_bytes = z.total_out;
        strip->adler = (uint32_t)adler32(1, filtered, (uInt)n);
    }
    deflateEnd(&z);
    return st;
}

static size_t filtered_bytes(const PngWriter *w, const CtsPackedRows *strip)
{
    return (size_t)strip->n_rows * (1 + w->row_bytes);
}

static CtsStatus pack_strip(const CtsExportJob *job, const CtsPicture *band, CtsPackedRows *strip)
{
    const PngWriter *const w = job->state;
    uint8_t *filtered = NULL;
    CtsStatus st = filter_strip(w, band, strip, &filtered);
    const bool last = band->first_row + strip->y + strip->n_rows == band->whole_height;
    if (!st)
        st = deflate_strip(filtered, filtered_bytes(w, strip), last, strip);
    cts_free(&filtered);
    return st;
}

static CtsStatus write_strip(CtsExportJob *job, const CtsPicture *band, const CtsPackedRows *strip, CtsError *err)
{
    PngWriter *const w = job->state;
    (void)band;
    w->adler = (uint32_t)adler32_combine(w->adler, strip->adler, (z_off_t)filtered_bytes(w, strip));
    w->errors.err = err;
    if (!setjmp(png_jmpbuf(w->png)))
        write_chunk(w, "IDAT", strip->bytes, strip->n_bytes);
    return w->errors.status;
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    const PngWriter *const w = job->state;
    return cts_export_packed(job, band, &(CtsRowPacking){w->rows_per_strip, pack_strip, write_strip}, err);
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    PngWriter *w = job->state;
    *w = (PngWriter){
        .errors = {.path = job->path, .subject = "libpng", .kind = CTS_ERR_OUTPUT, .err = err}, .job = job, .adler = 1};
    w->n_samples = head->has_alpha ? 4 : head->grey ? 1 : 3;
    w->sample_bytes = job->settings.png_8_bits ? 1 : 2;
    w->row_bytes = (size_t)head->width * (size_t)(w->n_samples * w->sample_bytes);
    w->rows_per_strip = CTS_BAND_ROWS;
    while (w->rows_per_strip > 1 && w->row_bytes * (size_t)w->rows_per_strip > STRIP_BYTES)
        w->rows_per_strip /= 2;
    w->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &w->errors, on_png_error, on_png_warning);
    if (!w->png || !(w->info = png_create_info_struct(w->png)))
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    png_set_write_fn(w->png, w, write_bytes, NULL);
    if (!setjmp(png_jmpbuf(w->png)))
        write_head(w);
    return w->errors.status;
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    PngWriter *const w = job->state;
    const uint32_t adler = htobe32(w->adler);
    char error[CTS_ERROR_TEXT], text[2 * CTS_ERROR_TEXT];
    w->errors.err = err;
    if (setjmp(png_jmpbuf(w->png)))
        return w->errors.status;
    write_chunk(w, "IDAT", &adler, sizeof adler);
    if (job->rmse >= 0) {
        cts_describe_error(job->rmse, error);
        write_chunk(w, "tEXt", text, (size_t)snprintf(text, sizeof text, "ctsplat:error%c%s", 0, error));
    }
    write_chunk(w, "IEND", NULL, 0);
    return w->errors.status;
}

static void release(CtsExportJob *job)
{
    PngWriter *const w = job->state;
    png_destroy_write_struct(&w->png, &w->info);
}

/* Deflate cannot compress by more than 1032: a file that claims more is truncated or malicious. */
enum { MAX_CHUNK_BYTES = 16 << 20, MAX_RATIO = 1040 };

typedef struct PngReader {
    PngErrors errors;
    FILE *file;
    uint64_t file_bytes;
    CtsPicture *picture;
    uint8_t *samples; /* the whole picture, as interlaced files need it */
} PngReader;

/* Asks libpng for 16-bit samples, grey, RGB or RGBA. Returns the number of passes over the rows. */
static int set_transforms(png_structp png, png_infop info)
{
    const int type = png_get_color_type(png, info);
    const bool transparent = png_get_valid(png, info, PNG_INFO_tRNS);
    png_set_expand_16(png);
    if (type == PNG_COLOR_TYPE_GRAY_ALPHA || (type == PNG_COLOR_TYPE_GRAY && transparent))
        png_set_gray_to_rgb(png);
    if (transparent)
        png_set_tRNS_to_alpha(png);
    const int n_passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    return n_passes;
}

static void fill_png_row(CtsPicture *picture, int y, int n_samples, const uint8_t *bytes)
{
    float *p = picture->pixels + (size_t)y * picture->width * picture->n_channels;
    for (int x = 0; x < picture->width; x++, bytes += 2 * n_samples, p += picture->n_channels) {
        double v[4] = {0, 0, 0, 1};
        for (int c = 0; c < n_samples; c++)
            v[c] = (bytes[2 * c] << 8 | bytes[2 * c + 1]) / 65535.0;
        for (int c = 0; c < picture->n_channels; c++)
            p[c] = (float)(c < 3 ? v[c] * v[3] : v[3]);
    }
}

static void read_png_file(png_structp png, png_infop info, PngReader *r)
{
    if (setjmp(png_jmpbuf(png)))
        return;
    png_init_io(png, r->file);
    png_set_user_limits(png, CTS_MAX_SIDE, CTS_MAX_SIDE);
    png_set_chunk_malloc_max(png, MAX_CHUNK_BYTES);
    png_read_info(png, info);
    const int width = (int)png_get_image_width(png, info), height = (int)png_get_image_height(png, info);
    if (png_get_rowbytes(png, info) * (uint64_t)height > r->file_bytes * MAX_RATIO)
        png_error(png, "it is too short for its size in pixels");
    const int n_passes = set_transforms(png, info), n_samples = png_get_channels(png, info);
    const size_t row_bytes = png_get_rowbytes(png, info);
    if (png_get_bit_depth(png, info) != 16 || row_bytes != (size_t)width * n_samples * 2 || n_samples == 2)
        png_error(png, "its samples cannot be widened to 16 bits");
    if ((r->errors.status = cts_picture_new(&r->picture, width, height, n_samples == 1 ? 1 : 4, r->errors.err)) ||
        (r->errors.status = cts_alloc_array(&r->samples, (size_t)height * row_bytes, r->errors.err)))
        return;
    for (int i = 0; i < n_passes * height; i++)
        png_read_row(png, r->samples + (size_t)(i % height) * row_bytes, NULL);
    png_read_end(png, NULL);
    r->picture->has_alpha = n_samples == 4;
    for (int y = 0; y < height; y++)
        fill_png_row(r->picture, y, n_samples, r->samples + (size_t)y * row_bytes);
}

static CtsStatus read_png(const char *path, CtsPicture **picture, CtsError *err)
{
    PngReader r = {.errors = {.path = path, .subject = "not a sound PNG file", .kind = CTS_ERR_READ, .err = err}};
    struct stat about;
    png_infop info = NULL;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r.errors, on_png_error, on_png_warning);
    if (!png || !(info = png_create_info_struct(png)))
        r.errors.status = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    else if (!(r.file = fopen(path, "rbe")) || fstat(fileno(r.file), &about))
        r.errors.status = cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    else {
        r.file_bytes = (uint64_t)about.st_size;
        read_png_file(png, info, &r);
    }
    png_destroy_read_struct(&png, &info, NULL);
    if (r.file)
        fclose(r.file);
    cts_free(&r.samples);
    if (r.errors.status)
        cts_picture_free(&r.picture);
    *picture = r.picture;
    return r.errors.status;
}

const CtsFormat cts_format_png = {
    .info = {"png", "PNG, 16 bits a channel (or 8)", "image/png", .has_alpha = true, .read_back = true},
    .magic = "\x89PNG",
    CTS_FORMAT_STEPS(PngWriter),
    .read = read_png,
};
