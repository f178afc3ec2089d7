#include "output/export/idat.h"

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

struct CtsIdatPacker {
    CtsIdat idat;
    z_stream z;
    bool ready;
    uint8_t *filtered;
};

static size_t most_filtered(const CtsIdat *idat)
{
    return (idat->row_bytes + 1) * (size_t)idat->rows_per_strip;
}

/* Strips are raw deflate: all but the last end on a byte with a block that is not final, so that the next can follow.
 */
CtsStatus cts_idat_packer_new(CtsIdatPacker **packer, const CtsIdat *idat, CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(packer, 1, err);
    if (st)
        return st;
    CtsIdatPacker *const p = *packer;
    p->idat = *idat;
    p->ready = deflateInit2(&p->z, LEVEL, Z_DEFLATED, -MAX_WBITS, MEM_LEVEL, Z_RLE) == Z_OK;
    if (!p->ready)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return cts_alloc_array(&p->filtered, most_filtered(idat), err);
}

void cts_idat_packer_free(CtsIdatPacker **packer)
{
    CtsIdatPacker *const p = *packer;
    if (!p)
        return;
    if (p->ready)
        deflateEnd(&p->z);
    cts_free(&p->filtered);
    cts_free(packer);
}

size_t cts_idat_bound(CtsIdatPacker *p)
{
    return HEADER_BYTES + deflateBound(&p->z, (uLong)most_filtered(&p->idat)) + 16; /* the flush adds an empty block */
}

/* Runs and Huffman codes alone, unless the same bytes come again within a pixel: grey in three channels. */
static CtsStatus deflate_strip(CtsIdatPacker *p, size_t n, bool repeats, bool last, CtsIdatStrip *strip, CtsError *err)
{
    z_stream *const z = &p->z;
    if (deflateReset(z) != Z_OK || deflateParams(z, LEVEL, repeats ? Z_DEFAULT_STRATEGY : Z_RLE) != Z_OK)
        return cts_fail(err, CTS_ERR_INTERNAL, "zlib gave up before a strip");
    const size_t room = cts_idat_bound(p) - strip->n_bytes;
    z->next_in = p->filtered;
    z->avail_in = (uInt)n;
    z->next_out = strip->bytes + strip->n_bytes;
    z->avail_out = (uInt)room;
    const int result = deflate(z, last ? Z_FINISH : Z_SYNC_FLUSH);
    if (result != (last ? Z_STREAM_END : Z_OK) || z->avail_in > 0 || z->avail_out == 0)
        return cts_fail(err, CTS_ERR_INTERNAL, "zlib gave up on a strip (%d)", result);
    strip->n_bytes += room - z->avail_out;
    return CTS_OK;
}

CtsStatus cts_idat_strip(CtsIdatPacker *p, int index, const uint8_t *rows, CtsIdatStrip *strip, CtsError *err)
{
    const CtsIdat *idat = &p->idat;
    const int rows_left = idat->height - index * idat->rows_per_strip;
    const int n_rows = rows_left < idat->rows_per_strip ? rows_left : idat->rows_per_strip;
    const size_t n = (idat->row_bytes + 1) * n_rows;
    bool repeats;
    strip->n_filtered = n;
    strip->n_bytes = index == 0 ? HEADER_BYTES : 0;
    filter_rows(idat, rows, n_rows, p->filtered, &repeats);
    const CtsStatus st = deflate_strip(p, n, repeats, index == idat->n_strips - 1, strip, err);
    if (st)
        return st;
    strip->adler = (uint32_t)adler32_z(1, p->filtered, n);
    if (index == 0)
        memcpy(strip->bytes, "\x78\x01", HEADER_BYTES); /* deflate, window of 32 KiB, fastest */
    strip->crc = (uint32_t)crc32_z(crc32_z(0, (const Bytef *)"IDAT", 4), strip->bytes, strip->n_bytes);
    return CTS_OK;
}

uint32_t cts_idat_checksum(uint32_t adler, const CtsIdatStrip *strip)
{
    return (uint32_t)adler32_combine(adler, strip->adler, (z_off_t)strip->n_filtered);
}
