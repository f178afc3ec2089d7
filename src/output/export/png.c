/* PNG, 16 or 8 bits a sample, and any kind read back. Chunks are written here and deflate.c packs the rows, so that
 * files do not depend on the version of libpng, which reads them.
 *
 * libpng compresses on one thread, and at its default level takes many times longer than a render. So rows are cut into
 * strips that are filtered and packed side by side, the same ones for any number of threads. Rows of 16 bits are
 * filtered by Up, whose low bytes are noise by any filter; at 8 bits Paeth takes 2 to 17 % less room. */
#include "output/export/deflate.h"
#include "output/export/format.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "ctsplat/bounds.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

enum { STRIP_BYTES = 512 << 10, FILTER_SUB = 1, FILTER_UP = 2, FILTER_PAETH = 4 };

/* Working memory of one thread. */
typedef struct Packer {
    uint16_t *words;  /* a row's samples of 16 bits */
    uint8_t *rows;    /* a row and the one above it, each behind a pixel of zeros */
    uint8_t *strip;   /* filtered rows, each behind its filter's number */
    CtsByteRun *runs; /* of the strip */
    uint8_t *packed;
} Packer;

/* A compressed strip that is not yet written. */
typedef struct PngStrip {
    uint8_t *bytes; /* owned */
    size_t n_bytes;
    uint32_t adler; /* of its n_rows filtered rows */
    size_t n_filtered;
    CtsStatus status;
} PngStrip;

typedef struct PngWriter {
    const CtsExportJob *job;
    int n_samples, sample_bytes; /* of a pixel, of a sample */
    size_t row_bytes;
    int rows_per_strip; /* a power of two: bands are whole strips */
    int n_threads;
    Packer *packers; /* one per thread, created at first use */
    uint32_t adler;  /* of all rows so far */
} PngWriter;

/* Length, name, bytes and their CRC, of the name too. */
static CtsStatus write_chunk(const CtsExportJob *job, const char name[4], const void *bytes, size_t n, CtsError *err)
{
    const uint32_t length = htobe32((uint32_t)n);
    uLong crc = crc32(0, (const Bytef *)name, 4);
    crc = n ? crc32(crc, bytes, (uInt)n) : crc;
    const uint32_t check = htobe32((uint32_t)crc);
    CtsStatus st = cts_temp_write(job->temp, &length, sizeof length, err);
    if (!st)
        st = cts_temp_write(job->temp, name, 4, err);
    if (!st && n)
        st = cts_temp_write(job->temp, bytes, n, err);
    return st ? st : cts_temp_write(job->temp, &check, sizeof check, err);
}

/* tEXt, or in other letters than ASCII iTXt: not compressed, of no language. */
static CtsStatus write_text(const CtsExportJob *job, const char *key, const char *text, CtsError *err)
{
    enum { NO_LANGUAGE = 4 }; /* zeros of iTXt: flag and method of compression, the ends of language and key in it */
    char bytes[80 + NO_LANGUAGE + sizeof job->head.info.tiles] = {0};
    bool is_ascii = true;
    for (const char *c = text; *c; c++)
        is_ascii &= (unsigned char)*c <= 126;
    const size_t n_key = strlen(key) + 1, at = n_key + (is_ascii ? 0 : NO_LANGUAGE);
    snprintf(bytes, sizeof bytes, "%s", key);
    snprintf(bytes + at, sizeof bytes - at, "%s", text);
    return write_chunk(job, at == n_key ? "tEXt" : "iTXt", bytes, at + strlen(bytes + at), err);
}

/* Software, source and disclaimer. No dates: the same picture gives the same bytes. */
static CtsStatus write_texts(const CtsExportJob *job, CtsError *err)
{
    const CtsPictureInfo *const about = &job->head.info;
    const CtsPhrase view = cts_describe_view(about), window = cts_describe_window(about);
    const CtsPhrase scale = cts_describe_number(about->mm_per_pixel, 9);
    const CtsPhrase occlusion = cts_describe_number(about->occlusion, 6);
    const struct {
        const char *key, *text;
        bool present;
    } lines[] = {
        {"Software", "ctsplat " CTS_VERSION, true},
        {"Disclaimer", "not for diagnostic use", true},
        {"ctsplat:preset", about->preset, about->preset[0] != 0},
        {"ctsplat:view", view.text, true},
        {"ctsplat:tiles", about->tiles, about->tiles[0] != 0},
        {"ctsplat:mm_per_pixel", scale.text, about->mm_per_pixel > 0},
        {"ctsplat:window", window.text, window.text[0] != 0},
        {"ctsplat:occlusion", occlusion.text, about->occlusion > 0},
    };
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < sizeof lines / sizeof *lines && !st; i++)
        if (lines[i].present)
            st = write_text(job, lines[i].key, lines[i].text, err);
    return st;
}

/* Size and kind of pixels; colours as sRGB, and by gamma and chromaticities (times 100,000) for readers that do not
 * know it; pixels a metre, where they fit; black as background for viewers, as in DICOM. */
static CtsStatus write_png_head(const PngWriter *w, CtsError *err)
{
    static const uint8_t colour_types[] = {
        [1] = PNG_COLOR_TYPE_GRAY, [3] = PNG_COLOR_TYPE_RGB, [4] = PNG_COLOR_TYPE_RGBA};
    static const uint32_t white_red_green_blue[] = {31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000};
    const CtsExportJob *const job = w->job;
    const uint32_t size[] = {htobe32((uint32_t)job->head.width), htobe32((uint32_t)job->head.height)};
    const uint32_t gamma = htobe32(45455);
    const double mm_per_pixel = job->head.info.mm_per_pixel;
    const double pixels_per_m = mm_per_pixel > 0 ? floor(1000 / mm_per_pixel + 0.5) : 0;
    uint8_t header[13] = {[8] = (uint8_t)(8 * w->sample_bytes), [9] = colour_types[w->n_samples]}, scale[9] = {[8] = 1};
    uint32_t chromaticities[8];
    memcpy(header, size, sizeof size);
    for (int i = 0; i < 8; i++)
        chromaticities[i] = htobe32(white_red_green_blue[i]);
    CtsStatus st = cts_temp_write(job->temp, "\x89PNG\r\n\x1a\n", 8, err);
    if (st || (st = write_chunk(job, "IHDR", header, sizeof header, err)) ||
        (st = write_chunk(job, "gAMA", &gamma, sizeof gamma, err)) || (st = write_chunk(job, "sRGB", "", 1, err)) ||
        (st = write_chunk(job, "cHRM", chromaticities, sizeof chromaticities, err)) ||
        (job->head.has_alpha && (st = write_chunk(job, "bKGD", (uint8_t[6]){0}, 6, err))))
        return st;
    if (pixels_per_m >= 1 && pixels_per_m <= PNG_UINT_31_MAX) {
        const uint32_t each = htobe32((uint32_t)pixels_per_m);
        memcpy(scale, &each, sizeof each);
        memcpy(scale + 4, &each, sizeof each);
        st = write_chunk(job, "pHYs", scale, sizeof scale, err);
    }
    return st ? st : write_texts(job, err);
}

static size_t pixel_bytes(const PngWriter *w)
{
    return (size_t)(w->n_samples * w->sample_bytes);
}

static void free_packer(Packer *p)
{
    cts_free(&p->words);
    cts_free(&p->rows);
    cts_free(&p->runs);
    cts_free(&p->packed);
    cts_free(&p->strip);
}

static CtsStatus make_packer(const PngWriter *w, Packer *p)
{
    const size_t n = (w->row_bytes + 1) * (size_t)w->rows_per_strip;
    CtsStatus st;
    if ((st = cts_alloc_bytes((void **)&p->words, 1, w->row_bytes, NULL)) ||
        (st = cts_alloc_zeroed(&p->rows, 2 * (pixel_bytes(w) + w->row_bytes), NULL)) ||
        (st = cts_alloc_array(&p->runs, cts_deflate_max_runs(n), NULL)) ||
        (st = cts_alloc_array(&p->packed, cts_deflate_max_bytes(n), NULL)) ||
        (st = cts_alloc_array(&p->strip, n, NULL)))
        free_packer(p);
    return st;
}

/* Converts row y to bytes. words has room for its samples. */
static void convert_row(const PngWriter *w, const CtsPicture *band, int y, uint16_t *words, uint8_t *to)
{
    if (w->sample_bytes == 1) {
        cts_samples_row8(band, y, w->n_samples, to);
        return;
    }
    cts_samples_row16(band, y, w->n_samples, words);
    for (size_t k = 0; k < w->row_bytes / 2; k++) {
        to[2 * k] = (uint8_t)(words[k] >> 8);
        to[2 * k + 1] = (uint8_t)words[k];
    }
}

static void filter_up(const uint8_t *restrict row, const uint8_t *restrict above, size_t n, uint8_t *restrict to)
{
    for (size_t i = 0; i < n; i++)
        to[i] = (uint8_t)(row[i] - above[i]);
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

/* Rows y <= r < end of a band. The first is filtered as if the row above were zeros, where Paeth equals Sub, so that
 * strips are independent. */
static CtsStatus pack_strip(const PngWriter *w, Packer *p, const CtsPicture *band, int y, int end, bool last,
                            PngStrip *strip)
{
    const size_t n = w->row_bytes, bpp = pixel_bytes(w);
    const CtsStatus st = p->strip ? CTS_OK : make_packer(w, p);
    uint8_t *row = p->rows + bpp, *above = row + n + bpp, *to = p->strip;
    if (st)
        return st;
    memset(above, 0, n);
    for (int r = y; r < end; r++) {
        *to = r == y ? FILTER_SUB : w->sample_bytes == 2 ? FILTER_UP : FILTER_PAETH;
        convert_row(w, band, r, p->words, row);
        if (*to++ == FILTER_UP)
            filter_up(row, above, n, to);
        else
            filter_paeth(row, above, n, bpp, to);
        to += n;
        uint8_t *const swap = row;
        row = above;
        above = swap;
    }
    strip->n_filtered = (size_t)(to - p->strip);
    strip->adler = (uint32_t)adler32(1, p->strip, (uInt)strip->n_filtered);
    strip->n_bytes = cts_deflate(p->strip, strip->n_filtered, last, p->runs, p->packed);
    if (!(strip->bytes = malloc(strip->n_bytes)))
        return CTS_ERR_MEMORY;
    memcpy(strip->bytes, p->packed, strip->n_bytes);
    return CTS_OK;
}

typedef struct Packing {
    const PngWriter *writer;
    const CtsPicture *band;
    PngStrip *strips;
} Packing;

static void pack_strips(void *context, int worker, size_t first, size_t end)
{
    const Packing *const p = context;
    const int per_strip = p->writer->rows_per_strip, height = p->band->height;
    const bool last_band = p->band->first_row + height == p->band->whole_height;
    for (size_t i = first; i < end; i++) {
        const int y = (int)i * per_strip, y_end = y + per_strip < height ? y + per_strip : height;
        PngStrip *const strip = &p->strips[i];
        strip->status =
            pack_strip(p->writer, &p->writer->packers[worker], p->band, y, y_end, last_band && y_end == height, strip);
    }
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    PngWriter *w = job->state;
    const size_t n = (size_t)((band->height + w->rows_per_strip - 1) / w->rows_per_strip);
    PngStrip *strips;
    CtsStatus st = cts_alloc_zeroed(&strips, n, err);
    if (st)
        return st;
    Packing packing = {w, band, strips};
    cts_parallel(w->n_threads, n, 1, pack_strips, &packing);
    for (size_t i = 0; i < n; i++) {
        if (!st && (st = strips[i].status))
            cts_fail(err, st, "%s: the picture's rows could not be packed", job->path);
        if (!st)
            st = write_chunk(job, "IDAT", strips[i].bytes, strips[i].n_bytes, err);
        w->adler = (uint32_t)adler32_combine(w->adler, strips[i].adler, (z_off_t)strips[i].n_filtered);
        free(strips[i].bytes);
    }
    cts_free(&strips);
    return st;
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    CtsStatus st;
    PngWriter *w = job->state;
    *w = (PngWriter){.job = job, .adler = 1, .rows_per_strip = CTS_BAND_ROWS};
    w->n_samples = head->has_alpha ? 4 : head->grey ? 1 : 3;
    w->sample_bytes = job->settings.png_8_bits ? 1 : 2;
    w->row_bytes = (size_t)head->width * (size_t)(w->n_samples * w->sample_bytes);
    while (w->rows_per_strip > 1 && w->row_bytes * (size_t)w->rows_per_strip > STRIP_BYTES)
        w->rows_per_strip /= 2;
    w->n_threads = cts_threads(job->settings.n_threads);
    if ((st = cts_alloc_zeroed(&w->packers, (size_t)w->n_threads, err)))
        return st;
    /* The stream begins: deflate, window of 32 KiB, fastest. */
    return (st = write_png_head(w, err)) ? st : write_chunk(job, "IDAT", "\x78\x01", 2, err);
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    const PngWriter *const w = job->state;
    const uint32_t adler = htobe32(w->adler);
    char error[CTS_ERROR_TEXT];
    CtsStatus st = write_chunk(job, "IDAT", &adler, sizeof adler, err);
    if (!st && job->rmse >= 0) {
        cts_describe_error(job->rmse, error);
        st = write_text(job, "ctsplat:error", error, err);
    }
    return st ? st : write_chunk(job, "IEND", NULL, 0, err);
}

static void release(CtsExportJob *job)
{
    PngWriter *w = job->state;
    for (int t = 0; w->packers && t < w->n_threads; t++)
        free_packer(&w->packers[t]);
    cts_free(&w->packers);
}

/* Deflate cannot compress by more than 1032: a file that claims more is truncated or malicious. */
enum { MAX_CHUNK_BYTES = 16 << 20, MAX_RATIO = 1040 };

typedef struct PngReader {
    const char *path;
    FILE *file;
    uint64_t file_bytes;
    CtsError *err;
    CtsStatus status;
    CtsPicture *picture;
    uint8_t *samples; /* the whole picture, as interlaced files need it */
    png_bytep *rows;
} PngReader;

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void on_read_error(png_structp png, png_const_charp message)
{
    PngReader *r = png_get_error_ptr(png);
    r->status = cts_fail(r->err, CTS_ERR_READ, "%s: not a sound PNG file: %s", r->path, message);
    png_longjmp(png, 1);
}

/* Ask libpng for 16-bit samples, grey, RGB or RGBA. */
static void set_transforms(png_structp png, png_infop info)
{
    const int type = png_get_color_type(png, info);
    const bool transparent = png_get_valid(png, info, PNG_INFO_tRNS);
    png_set_expand_16(png);
    if (type == PNG_COLOR_TYPE_GRAY_ALPHA || (type == PNG_COLOR_TYPE_GRAY && transparent))
        png_set_gray_to_rgb(png);
    if (transparent)
        png_set_tRNS_to_alpha(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
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
    set_transforms(png, info);
    const int n_samples = png_get_channels(png, info);
    const size_t row_bytes = png_get_rowbytes(png, info);
    if (png_get_bit_depth(png, info) != 16 || row_bytes != (size_t)width * n_samples * 2 || n_samples == 2)
        png_error(png, "its samples cannot be widened to 16 bits");
    if ((r->status = cts_picture_new(&r->picture, width, height, n_samples == 1 ? 1 : 4, r->err)) ||
        (r->status = cts_alloc_array(&r->samples, (size_t)height * row_bytes, r->err)) ||
        (r->status = cts_alloc_array(&r->rows, (size_t)height, r->err)))
        return;
    for (int y = 0; y < height; y++)
        r->rows[y] = r->samples + (size_t)y * row_bytes;
    png_read_image(png, r->rows);
    png_read_end(png, NULL);
    r->picture->has_alpha = n_samples == 4;
    for (int y = 0; y < height; y++)
        fill_png_row(r->picture, y, n_samples, r->rows[y]);
}

static CtsStatus read_png(const char *path, CtsPicture **picture, CtsError *err)
{
    PngReader r = {.path = path, .err = err};
    struct stat about;
    png_infop info = NULL;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r, on_read_error, on_warning);
    if (!png || !(info = png_create_info_struct(png)))
        r.status = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    else if (!(r.file = fopen(path, "rbe")) || fstat(fileno(r.file), &about))
        r.status = cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    else {
        r.file_bytes = (uint64_t)about.st_size;
        read_png_file(png, info, &r);
    }
    png_destroy_read_struct(&png, &info, NULL);
    if (r.file)
        fclose(r.file);
    cts_free(&r.samples);
    cts_free(&r.rows);
    if (r.status)
        cts_picture_free(&r.picture);
    *picture = r.picture;
    return r.status;
}

const CtsFormat cts_format_png = {
    .info = {"png", "PNG, 16 bits a channel (or 8)", "image/png", .has_alpha = true, .read_back = true},
    .magic = "\x89PNG",
    CTS_FORMAT_STEPS(PngWriter),
    .read = read_png,
};
