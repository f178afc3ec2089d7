/* PNG, 16 or 8 bits a sample: libpng writes the file, idat.c compresses the pixels. */
#include "output/export/format.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "output/export/idat.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <endian.h>
#include <math.h>
#include <png.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

/* Strips in memory for each thread: few, so that it is used again, and enough that nobody waits long for the others. */
enum { STRIPS_EACH = 4, MOST_STRIPS = 64 };

/* One thread's. */
typedef struct Packer {
    CtsIdatPacker *idat;
    uint8_t *rows; /* a strip's, with the row above */
} Packer;

enum {
    CHUNK_HEAD = 8,
    CHUNK_TAIL = 8
}; /* length and name; the stream's check value, in the last one, and the chunk's */

/* A strip as it comes out of its packer, in a chunk that has room for what stands around it. */
typedef struct Slot {
    CtsIdatStrip strip;
    CtsError why; /* it could not be packed */
} Slot;

/* Where libpng's callbacks find what belongs to this file. */
typedef struct PngWriter {
    const CtsExportJob *job;
    png_structp png;
    png_infop info;
    CtsError *err; /* of the call under way */
    CtsStatus status;
    CtsIdat idat;
    int n_threads, n_slots;
    Packer *packers;
    uint8_t *rows; /* the last row written, then the rows that wait for a strip to be whole, samples big-endian */
    int n_waiting;
    int n_before; /* strips of earlier bands */
    Slot slots[MOST_STRIPS];
    uint8_t *slot_bytes;
    size_t slot_room;
    int n_written;
    uint32_t adler; /* of those written */
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
    png_set_IHDR(png, info, (png_uint_32)head->width, (png_uint_32)head->height, 8 * w->idat.sample_bytes,
                 colour_types[w->idat.n_samples], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
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

/* The next IDAT chunk, past libpng, which would take the check sums one after the other. */
static CtsStatus write_strip(PngWriter *w, CtsIdatStrip *strip, CtsError *err)
{
    uint8_t *const chunk = strip->bytes - CHUNK_HEAD;
    w->adler = cts_idat_checksum(w->adler, strip);
    if (++w->n_written == w->idat.n_strips) {
        png_save_uint_32(strip->bytes + strip->n_bytes, w->adler);
        strip->crc = (uint32_t)crc32(strip->crc, strip->bytes + strip->n_bytes, 4);
        strip->n_bytes += 4;
    }
    png_save_uint_32(chunk, (png_uint_32)strip->n_bytes);
    memcpy(chunk + 4, "IDAT", 4);
    png_save_uint_32(strip->bytes + strip->n_bytes, strip->crc);
    return cts_temp_write(w->job->temp, chunk, CHUNK_HEAD + strip->n_bytes + 4, err);
}

/* The two steps that talk to libpng; kept apart so that nothing local changes between setjmp and a longjmp back. */
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

static CtsStatus write_finish(PngWriter *w)
{
    if (setjmp(png_jmpbuf(w->png)))
        return w->status;
    png_write_chunk(w->png, (png_const_bytep) "IEND", NULL, 0); /* png_write_end() knows nothing of our IDATs */
    return CTS_OK;
}

/* Rows that wait, then those of a band, counted on from the first that waits. */
typedef struct Packing {
    PngWriter *writer;
    const CtsPicture *band;
    int first; /* strip of the band that goes into slot 0 */
} Packing;

static void convert_row(const PngWriter *w, const CtsPicture *band, int y, uint8_t *to)
{
    const size_t n = w->idat.row_bytes / 2;
    if (w->idat.sample_bytes == 1) {
        cts_samples_row8(band, y, w->idat.n_samples, to);
        return;
    }
    uint16_t *row = (uint16_t *)(void *)to;
    cts_samples_row16(band, y, w->idat.n_samples, row);
    for (size_t k = 0; k < n; k++)
        row[k] = htobe16(row[k]);
}

/* Rows first <= r < end; row -1 is the last that was written. */
static void collect_rows(const PngWriter *w, const CtsPicture *band, int first, int end, uint8_t *to)
{
    for (int r = first; r < end; r++, to += w->idat.row_bytes)
        if (r < w->n_waiting)
            memcpy(to, w->rows + (size_t)(r + 1) * w->idat.row_bytes, w->idat.row_bytes);
        else
            convert_row(w, band, r - w->n_waiting, to);
}

/* By the thread that it is for, with its first strip. */
static CtsStatus packer_ready(const PngWriter *w, Packer *packer, CtsError *err)
{
    const size_t n_rows = (size_t)w->idat.rows_per_strip + 1;
    CtsStatus st = CTS_OK;
    if (!packer->rows && ((st = cts_alloc_array(&packer->rows, n_rows * w->idat.row_bytes, err)) ||
                          (st = cts_idat_packer_new(&packer->idat, &w->idat, err)))) {
        cts_idat_packer_free(&packer->idat);
        cts_free(&packer->rows);
    }
    return st;
}

/* Strip i of the band. */
static CtsStatus pack_strip(const Packing *p, int worker, int i, CtsIdatStrip *strip, CtsError *err)
{
    const PngWriter *w = p->writer;
    Packer *const packer = &w->packers[worker];
    const CtsStatus st = packer_ready(w, packer, err);
    if (st)
        return st;
    const int n_rows = w->n_waiting + p->band->height, per_strip = w->idat.rows_per_strip;
    const int from = i * per_strip, to = from + per_strip;
    collect_rows(w, p->band, from - 1, to < n_rows ? to : n_rows, packer->rows);
    return cts_idat_strip(packer->idat, w->n_before + i, packer->rows + w->idat.row_bytes, strip, err);
}

static void pack_strips(void *context, int worker, size_t first, size_t end)
{
    const Packing *const p = context;
    PngWriter *const w = p->writer;
    for (size_t i = first; i < end; i++) {
        w->slots[i] = (Slot){.strip = {.bytes = w->slot_bytes + i * w->slot_room + CHUNK_HEAD}};
        pack_strip(p, worker, p->first + (int)i, &w->slots[i].strip, &w->slots[i].why);
    }
}

/* As many strips as there are slots are compressed side by side, then written in order, and so on. */
static CtsStatus write_strips(PngWriter *w, const CtsPicture *band, int n_strips)
{
    CtsStatus st = CTS_OK;
    for (int first = 0; first < n_strips && !st; first += w->n_slots) {
        const int n = n_strips - first < w->n_slots ? n_strips - first : w->n_slots;
        Packing packing = {w, band, first};
        cts_parallel(w->n_threads, (size_t)n, 1, pack_strips, &packing);
        for (int i = 0; i < n && !st; i++)
            st = w->slots[i].why.status
                     ? cts_fail(w->err, w->slots[i].why.status, "%s: %s", w->job->path, w->slots[i].why.text)
                     : write_strip(w, &w->slots[i].strip, w->err);
    }
    return st;
}

/* All whole strips of the rows that wait and the band's, then the rows that are left wait; with the last band, those
 * too. */
static CtsStatus add_rows(PngWriter *w, const CtsPicture *band)
{
    const bool last = band->first_row + band->height == w->idat.height;
    const int per_strip = w->idat.rows_per_strip, n_rows = w->n_waiting + band->height;
    const int n_strips = last ? (n_rows + per_strip - 1) / per_strip : n_rows / per_strip;
    const CtsStatus st = write_strips(w, band, n_strips);
    if (st)
        return st;
    w->n_before += n_strips;
    /* What is left is less than a strip. */
    const int first = last ? n_rows : n_strips * per_strip;
    collect_rows(w, band, first - 1, n_rows, w->packers[0].rows);
    memcpy(w->rows, w->packers[0].rows, (size_t)(n_rows - first + 1) * w->idat.row_bytes);
    w->n_waiting = n_rows - first;
    return CTS_OK;
}

static CtsStatus begin_packing(PngWriter *w, CtsError *err)
{
    CtsStatus st;
    const size_t n_rows = (size_t)w->idat.rows_per_strip + 1;
    const int n_threads = cts_threads(w->job->settings.n_threads);
    w->n_threads = n_threads < w->idat.n_strips ? n_threads : w->idat.n_strips;
    w->n_slots = STRIPS_EACH * w->n_threads < MOST_STRIPS ? STRIPS_EACH * w->n_threads : MOST_STRIPS;
    w->n_slots = w->n_slots < w->idat.n_strips ? w->n_slots : w->idat.n_strips;
    if ((st = cts_alloc_zeroed(&w->packers, (size_t)w->n_threads, err)) || (st = packer_ready(w, &w->packers[0], err)))
        return st;
    w->slot_room = CHUNK_HEAD + cts_idat_bound(&w->idat) + CHUNK_TAIL;
    if ((st = cts_alloc_array(&w->slot_bytes, (size_t)w->n_slots * w->slot_room, err)))
        return st;
    return cts_alloc_zeroed(&w->rows, n_rows * w->idat.row_bytes, err);
}

CtsStatus cts_png_begin(CtsExportJob *job, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    CtsStatus st;
    PngWriter *w = job->state = calloc(1, sizeof *w);
    if (!w)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    *w = (PngWriter){.job = job, .err = err, .adler = 1};
    w->idat = cts_idat_plan(head->width, head->height,
                            head->has_alpha ? 4
                            : head->grey    ? 1
                                            : 3,
                            job->settings.png_8_bits ? 1 : 2);
    if ((st = begin_packing(w, err)))
        return st;
    w->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, w, on_write_error, on_warning);
    if (!w->png || !(w->info = png_create_info_struct(w->png)))
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    return write_start(w);
}

CtsStatus cts_png_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    PngWriter *w = job->state;
    w->err = err;
    return add_rows(w, band);
}

CtsStatus cts_png_finish(CtsExportJob *job, CtsError *err)
{
    PngWriter *w = job->state;
    w->err = err;
    return write_finish(w);
}

void cts_png_close(CtsExportJob *job)
{
    PngWriter *w = job->state;
    if (!w)
        return;
    if (w->png)
        png_destroy_write_struct(&w->png, &w->info);
    for (int t = 0; w->packers && t < w->n_threads; t++) {
        cts_idat_packer_free(&w->packers[t].idat);
        cts_free(&w->packers[t].rows);
    }
    cts_free(&w->packers);
    cts_free(&w->slot_bytes);
    cts_free(&w->rows);
    free(w);
}
