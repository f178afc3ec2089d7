#include "dicom/pixels/pixel_tasks.h"

#include "base/bytes.h"
#include <stdbool.h>

static unsigned big16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

/* Start of frame: DCMTK searches it by segment lengths too, but never gets past FF 01 (TEM). */
CtsStatus cts_codec_check_jpeg(CtsCodecFrame *f, const uint8_t *p, size_t n, CtsError *err)
{
    size_t pos = 2;
    if (n < 4 || p[0] != 0xFF || p[1] != 0xD8)
        return cts_fail(err, CTS_ERR_PIXELS, "its compressed pixels are no JPEG stream");
    for (;;) {
        while (pos + 1 < n && p[pos] == 0xFF && p[pos + 1] == 0xFF)
            pos++;
        if (pos + 4 > n || p[pos] != 0xFF)
            return cts_fail(err, CTS_ERR_PIXELS, "its JPEG stream is damaged before the frame header");
        const unsigned marker = p[pos + 1], length = big16(p + pos + 2);
        if (marker <= 0x01 || (marker >= 0xD0 && marker <= 0xDA) || length < 2)
            return cts_fail(err, CTS_ERR_PIXELS, "its JPEG stream has marker FF %02X before the frame header", marker);
        const bool frame =
            marker == 0xF7 || (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC);
        if (frame)
            break;
        pos += 2 + length;
    }
    if (pos + 10 > n)
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG stream ends in the frame header");
    const int precision = p[pos + 4], rows = (int)big16(p + pos + 5), columns = (int)big16(p + pos + 7);
    if (rows != f->rows || columns != f->columns || p[pos + 9] != f->n_samples)
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG stream is %d x %d with %d components, the header says %d x %d",
                        columns, rows, p[pos + 9], f->columns, f->rows);
    /* A decoder writes one byte a pixel up to a precision of 8, and two above. */
    if (precision < 2 || precision > 16 || (precision > 8) != (f->bits_allocated == 16))
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG stream has %d bits, the header allocates %d", precision,
                        f->bits_allocated);
    f->precision = precision;
    return CTS_OK;
}

/* Number of bytes that a segment decodes to; a truncated run counts as 0 (writers pad with zeros). */
static size_t unpacked(const uint8_t *p, size_t n)
{
    size_t total = 0;
    for (size_t pos = 0; pos + 1 < n;) {
        const size_t run = p[pos] < 128 ? p[pos] + 1u : p[pos] > 128 ? 257u - p[pos] : 0;
        pos += p[pos] < 128 ? run + 1 : p[pos] > 128 ? 2 : 1;
        total += pos <= n ? run : 0;
    }
    return total;
}

CtsStatus cts_codec_check_rle(CtsCodecFrame *f, const uint8_t *p, size_t n, CtsError *err)
{
    const uint32_t segments = (uint32_t)(f->n_samples * f->bits_allocated / 8);
    if (n < 64 || cts_little32(p) != segments)
        return cts_fail(err, CTS_ERR_PIXELS, "its RLE header does not have %u segments", segments);
    uint32_t last = 63;
    for (uint32_t i = 0; i < segments; i++) {
        const uint32_t offset = cts_little32(p + 4 + 4 * i);
        if (offset <= last || offset >= n)
            return cts_fail(err, CTS_ERR_PIXELS, "its RLE header has offsets that do not fit the stream");
        last = offset;
    }
    /* Too few bytes are detected by the decoder; it ignores surplus rows. */
    const size_t wanted = (size_t)f->columns * (size_t)f->rows;
    for (uint32_t i = 0; i < segments; i++) {
        const uint32_t offset = cts_little32(p + 4 + 4 * i),
                       end = i + 1 < segments ? cts_little32(p + 8 + 4 * i) : (uint32_t)n;
        const size_t got = unpacked(p + offset, end - offset);
        if (got >= wanted + (size_t)f->columns)
            return cts_fail(err, CTS_ERR_PIXELS, "its RLE stream holds %zu pixels, the header says %d x %d", got,
                            f->columns, f->rows);
    }
    return CTS_OK;
}
