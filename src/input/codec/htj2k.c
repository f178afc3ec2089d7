#include "input/codec/htj2k.h"

#include "base/load_part.h"
#include "input/codec/jpeg2000.h"
#include <pthread.h>
#include <string.h>

/* The state of this file: the library, looked for once, or why there is none. */
static pthread_once_t once = PTHREAD_ONCE_INIT;
static cts_htj2k_fn loaded;
static CtsError why_not;

static void load(void)
{
    void *symbol = NULL;
    if (!cts_part_load(CTS_HTJ2K_PART, "cts_htj2k_run", &symbol, &why_not))
        memcpy(&loaded, &symbol, sizeof loaded);
}

const char *cts_htj2k_prepare(void)
{
    pthread_once(&once, load);
    return loaded ? NULL : why_not.text;
}

static unsigned big16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

static uint32_t big32(const uint8_t *p)
{
    return (uint32_t)big16(p) << 16 | big16(p + 2);
}

/* Tile-parts follow each other up to the end marker: OpenJPH takes a stream that is cut off for one of lower quality.
 */
static bool ends_well(const uint8_t *p, size_t n, size_t pos)
{
    enum { START_OF_TILE = 0xFF90, END = 0xFFD9, LEAST = 14 };
    while (pos + LEAST <= n && big16(p + pos) == START_OF_TILE && big16(p + pos + 2) == 10) {
        const uint32_t length = big32(p + pos + 6);
        if (length < LEAST || length > n - pos)
            return false;
        pos += length;
    }
    return pos + 2 <= n && big16(p + pos) == END;
}

/* Whether OpenJPH can have it: a bare stream that is whole, all its blocks of the high-throughput kind, one style of
 * coding for all. */
static bool is_for_openjph(const uint8_t *p, size_t n)
{
    enum { START = 0xFF4F, SIZE = 0xFF51, CAPABILITIES = 0xFF50, CODING = 0xFF52, QUANTISATION = 0xFF5C };
    enum { TILE_LENGTHS = 0xFF55, COMMENT = 0xFF64, START_OF_TILE = 0xFF90 };
    enum { HIGH_THROUGHPUT = 0x40, MIXED = 0x80 };
    bool high_throughput = false;
    if (n < 4 || big16(p) != START)
        return false;
    for (size_t pos = 2; pos + 4 <= n;) {
        const unsigned marker = big16(p + pos), length = big16(p + pos + 2);
        if (marker == START_OF_TILE)
            return high_throughput && ends_well(p, n, pos);
        if (length < 2 || length > n - pos - 2)
            return false;
        if (marker == CODING) {
            const unsigned style = length >= 12 ? p[pos + 12] : 0u;
            high_throughput = (style & (HIGH_THROUGHPUT | MIXED)) == HIGH_THROUGHPUT;
        } else if (marker != SIZE && marker != CAPABILITIES && marker != QUANTISATION && marker != TILE_LENGTHS &&
                   marker != COMMENT) {
            return false;
        }
        pos += 2 + length;
    }
    return false;
}

/* One frame on its way. */
typedef struct Frame {
    const CtsFrameFormat *format;
    CtsHtj2kShape shape;
    uint8_t *pixels;
    CtsStatus status; /* why the decoding was ended */
    CtsError *err;
} Frame;

static int take_shape(void *context, const CtsHtj2kShape *shape)
{
    Frame *const f = context;
    f->shape = *shape;
    f->status = cts_jpeg2000_check_components(f->format, shape->n_components, f->err);
    for (unsigned c = 0; c < shape->n_components && c < CTS_HTJ2K_MAX_COMPONENTS && !f->status; c++)
        f->status = cts_jpeg2000_check_component(f->format, shape->plain, shape->columns, shape->rows,
                                                 (unsigned)shape->components[c].precision, f->err);
    return !f->status;
}

static int take_line(void *context, unsigned component, unsigned row, const int32_t *samples)
{
    Frame *const f = context;
    const CtsJpeg2000Samples line = {.values = samples,
                                     .first = (size_t)row * f->shape.columns,
                                     .n = f->shape.columns,
                                     .precision = f->shape.components[component].precision,
                                     .is_signed = f->shape.components[component].is_signed};
    f->status = cts_jpeg2000_take_samples(f->format, &line,
                                          f->pixels + component * (size_t)(f->format->bits_allocated / 8), f->err);
    return !f->status;
}

CtsStatus cts_htj2k_decode_by(cts_htj2k_fn run, const CtsFrameFormat *format, const uint8_t *stream, size_t n,
                              void *pixels, CtsError *err)
{
    if (!run || !is_for_openjph(stream, n))
        return cts_jpeg2000_decode(format, stream, n, pixels, err);
    Frame f = {.format = format, .pixels = pixels, .err = err};
    const CtsHtj2kTaker taker = {&f, take_shape, take_line};
    char why[120] = "";
    switch (run(stream, n, &taker, why)) {
    case CTS_HTJ2K_DONE:
        return CTS_OK;
    case CTS_HTJ2K_ENDED:
        return f.status;
    case CTS_HTJ2K_NO_MEMORY:
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    default:
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream is damaged: %s", why);
    }
}

CtsStatus cts_htj2k_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
{
    return cts_htj2k_decode_by(loaded, format, stream, n, pixels, err);
}
