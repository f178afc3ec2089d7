#include "export/idat.h"

#include "base/mem.h"
#include "image/samples.h"
#include <string.h>
#include <zlib.h>

enum { STRIP_BYTES = 256 << 10, HEADER_BYTES = 2, FILTER_UP = 2, LEVEL = 1, MEM_LEVEL = 9 };

CtsIdat cts_idat_plan(const CtsPicture *picture, int n_samples)
{
    const size_t row_bytes = (size_t)picture->width * n_samples * 2;
    CtsIdat idat = {.picture = picture, .n_samples = n_samples};
    idat.rows_per_strip = row_bytes < STRIP_BYTES ? (int)(STRIP_BYTES / row_bytes) : 1;
    idat.n_strips = (picture->height + idat.rows_per_strip - 1) / idat.rows_per_strip;
    return idat;
}

static void big_endian_row(const CtsIdat *idat, int y, uint16_t *samples, uint8_t *row)
{
    const size_t n = (size_t)idat->picture->width * idat->n_samples;
    cts_samples_row16(idat->picture, y, idat->n_samples, samples);
    for (size_t i = 0; i < n; i++) {
        row[2 * i] = (uint8_t)(samples[i] >> 8);
        row[2 * i + 1] = (uint8_t)samples[i];
    }
}

/* Counts the pixels that are not black, and those of them whose colours are equal. */
static void count_grey(const uint16_t *samples, int width, int n_samples, size_t *n_lit, size_t *n_grey)
{
    for (const uint16_t *s = samples, *end = s + (size_t)width * n_samples; n_samples >= 3 && s < end; s += n_samples) {
        const bool lit = (s[0] | s[1] | s[2]) != 0;
        *n_lit += lit;
        *n_grey += lit && s[0] == s[1] && s[1] == s[2];
    }
}

/* Rows first to last, each as its filter's number and its bytes less those of the row above (PNG filter Up). */
static CtsStatus filtered_rows(const CtsIdat *idat, int first, int last, uint8_t *filtered, bool *repeats,
                               CtsError *err)
{
    size_t n_lit = 0, n_grey = 0;
    const size_t n = (size_t)idat->picture->width * idat->n_samples * 2;
    uint16_t *samples = NULL;
    uint8_t *rows = NULL;
    CtsStatus st = cts_alloc_array(&samples, n / 2, err);
    if (st || (st = cts_alloc_zeroed(&rows, 2 * n, err)))
        goto end;
    uint8_t *above = rows, *row = rows + n;
    if (first > 0)
        big_endian_row(idat, first - 1, samples, above);
    for (int y = first; y <= last; y++) {
        big_endian_row(idat, y, samples, row);
        count_grey(samples, idat->picture->width, idat->n_samples, &n_lit, &n_grey);
        *filtered++ = FILTER_UP;
        for (size_t i = 0; i < n; i++)
            filtered[i] = (uint8_t)(row[i] - above[i]);
        filtered += n;
        uint8_t *const swap = above;
        above = row;
        row = swap;
    }
    *repeats = n_grey > n_lit / 16;
end:
    cts_free(&samples);
    cts_free(&rows);
    return st;
}

/* Runs and Huffman codes alone, unless the same bytes come again within a pixel: grey in three channels.
 * Raw deflate; all strips but the last end on a byte with a block that is not final, so that the next can follow. */
static CtsStatus deflate_strip(const uint8_t *filtered, size_t n, bool repeats, bool last, CtsIdatStrip *strip,
                               CtsError *err)
{
    z_stream z = {0};
    if (deflateInit2(&z, LEVEL, Z_DEFLATED, -MAX_WBITS, MEM_LEVEL, repeats ? Z_DEFAULT_STRATEGY : Z_RLE) != Z_OK)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const size_t bound = deflateBound(&z, n) + 16; /* the flush adds an empty block */
    CtsStatus st = cts_alloc_array(&strip->bytes, HEADER_BYTES + bound, err);
    if (!st) {
        z.next_in = (Bytef *)(uintptr_t)filtered;
        z.avail_in = (uInt)n;
        z.next_out = strip->bytes + strip->n_bytes;
        z.avail_out = (uInt)bound;
        const int result = deflate(&z, last ? Z_FINISH : Z_SYNC_FLUSH);
        if (result != (last ? Z_STREAM_END : Z_OK) || z.avail_in > 0 || z.avail_out == 0)
            st = cts_fail(err, CTS_ERR_INTERNAL, "zlib gave up on a strip (%d)", result);
        strip->n_bytes += bound - z.avail_out;
    }
    deflateEnd(&z);
    return st;
}

CtsStatus cts_idat_strip(const CtsIdat *idat, int index, CtsIdatStrip *strip, CtsError *err)
{
    const int first = index * idat->rows_per_strip, rows_left = idat->picture->height - first;
    const int n_rows = rows_left < idat->rows_per_strip ? rows_left : idat->rows_per_strip;
    const size_t n = ((size_t)idat->picture->width * idat->n_samples * 2 + 1) * n_rows;
    uint8_t *filtered = NULL;
    bool repeats = false;
    *strip = (CtsIdatStrip){.n_filtered = n, .n_bytes = index == 0 ? HEADER_BYTES : 0};
    CtsStatus st = cts_alloc_array(&filtered, n, err);
    if (st || (st = filtered_rows(idat, first, first + n_rows - 1, filtered, &repeats, err)) ||
        (st = deflate_strip(filtered, n, repeats, index == idat->n_strips - 1, strip, err)))
        goto end;
    strip->adler = (uint32_t)adler32_z(1, filtered, n);
    if (index == 0)
        memcpy(strip->bytes, "\x78\x01", HEADER_BYTES); /* deflate, window of 32 KiB, fastest */
end:
    cts_free(&filtered);
    return st;
}

uint32_t cts_idat_checksum(uint32_t adler, const CtsIdatStrip *strip)
{
    return (uint32_t)adler32_combine(adler, strip->adler, (z_off_t)strip->n_filtered);
}
