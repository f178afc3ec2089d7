#include "export/idat.h"

#include "base/mem.h"
#include <stdbool.h>
#include <string.h>
#include <zlib.h>

enum { STRIP_BYTES = 256 << 10, HEADER_BYTES = 2, FILTER_UP = 2, LEVEL = 1, MEM_LEVEL = 9 };

CtsIdat cts_idat_plan(int width, int height, int n_samples)
{
    CtsIdat idat = {.width = width, .height = height, .n_samples = n_samples};
    idat.row_bytes = (size_t)width * n_samples * 2;
    idat.rows_per_strip = idat.row_bytes < STRIP_BYTES ? (int)(STRIP_BYTES / idat.row_bytes) : 1;
    idat.n_strips = (height + idat.rows_per_strip - 1) / idat.rows_per_strip;
    return idat;
}

/* Counts the pixels that are not black, and those of them whose colours are equal. */
static void count_grey(const uint8_t *row, const CtsIdat *idat, size_t *n_lit, size_t *n_grey)
{
    const int n_samples = idat->n_samples;
    uint16_t s[3];
    for (const uint8_t *at = row, *end = row + idat->row_bytes; n_samples >= 3 && at < end; at += 2 * n_samples) {
        memcpy(s, at, sizeof s);
        const bool lit = (s[0] | s[1] | s[2]) != 0;
        *n_lit += lit;
        *n_grey += lit & (s[0] == s[1]) & (s[1] == s[2]);
    }
}

/* Each row as its filter's number and its bytes less those of the row above (PNG filter Up). */
static void filter_rows(const CtsIdat *idat, const uint8_t *rows, int n_rows, uint8_t *filtered, bool *repeats)
{
    const size_t n = idat->row_bytes;
    size_t n_lit = 0, n_grey = 0;
    for (int y = 0; y < n_rows; y++) {
        const uint8_t *row = rows + (size_t)y * n, *above = row - n;
        count_grey(row, idat, &n_lit, &n_grey);
        *filtered++ = FILTER_UP;
        for (size_t i = 0; i < n; i++)
            filtered[i] = (uint8_t)(row[i] - above[i]);
        filtered += n;
    }
    *repeats = n_grey > n_lit / 16;
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

CtsStatus cts_idat_strip(const CtsIdat *idat, int index, const uint8_t *rows, CtsIdatStrip *strip, CtsError *err)
{
    const int rows_left = idat->height - index * idat->rows_per_strip;
    const int n_rows = rows_left < idat->rows_per_strip ? rows_left : idat->rows_per_strip;
    const size_t n = (idat->row_bytes + 1) * n_rows;
    uint8_t *filtered = NULL;
    bool repeats;
    *strip = (CtsIdatStrip){.n_filtered = n, .n_bytes = index == 0 ? HEADER_BYTES : 0};
    CtsStatus st = cts_alloc_array(&filtered, n, err);
    if (st)
        return st;
    filter_rows(idat, rows, n_rows, filtered, &repeats);
    if ((st = deflate_strip(filtered, n, repeats, index == idat->n_strips - 1, strip, err)))
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
