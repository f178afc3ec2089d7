/* High-throughput JPEG 2000 (Rec. ITU-T T.814) streams, decoded with OpenJPH, which takes half of OpenJPEG's time. */
#include "dicom/codec.h"
#include "dicom/jpeg2000.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <new>
#include <openjph/ojph_arch.h>
#include <openjph/ojph_base.h>
#include <openjph/ojph_codestream.h>
#include <openjph/ojph_file.h>
#include <openjph/ojph_mem.h>
#include <openjph/ojph_message.h>
#include <openjph/ojph_params.h>
#include <stdexcept>
#include <vector>

namespace
{

unsigned big16(const uint8_t *p)
{
    return static_cast<unsigned>(p[0]) << 8 | p[1];
}

uint32_t big32(const uint8_t *p)
{
    return static_cast<uint32_t>(big16(p)) << 16 | big16(p + 2);
}

/* Tile-parts follow each other up to the end marker: OpenJPH takes a stream that is cut off for one of lower quality.
 */
bool ends_well(const uint8_t *p, size_t n, size_t pos)
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
 * coding for all. OpenJPEG reads, or refuses, the rest. */
bool is_for_openjph(const uint8_t *p, size_t n)
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

/* OpenJPH says what is wrong through objects of its own and wants an exception for an error; warnings are noise in the
 * picture, too. */
template <class Base> class Thrower final : public Base
{
  public:
    void operator()(int, const char *, int, const char *format, ...) override
    {
        char text[120];
        va_list arguments;
        va_start(arguments, format);
        std::vsnprintf(text, sizeof text, format, arguments);
        va_end(arguments);
        text[std::strcspn(text, "\r\n")] = 0;
        throw std::runtime_error(text);
    }
};

void listen()
{
    static Thrower<ojph::message_warning> warnings;
    static Thrower<ojph::message_error> errors;
    ojph::configure_warning(&warnings);
    ojph::configure_error(&errors);
    ojph::set_info_stream(nullptr);
}

/* The stream's own shape, before anything is allocated by it. */
CtsStatus check_shape(const CtsFrameFormat *f, ojph::param_siz siz, CtsError *err)
{
    const ojph::point end = siz.get_image_extent(), origin = siz.get_image_offset(), tile = siz.get_tile_offset();
    const unsigned n_components = siz.get_num_components();
    CtsStatus st = cts_jpeg2000_check_components(f, n_components, err);
    for (unsigned c = 0; c < n_components && !st; c++) {
        const ojph::point step = siz.get_downsampling(c);
        const bool plain = !origin.x && !origin.y && !tile.x && !tile.y && step.x == 1 && step.y == 1;
        st = cts_jpeg2000_check_component(f, plain, end.x, end.y, siz.get_bit_depth(c), err);
    }
    return st;
}

/* Component by component, or line by line in turns, as the stream has them. */
CtsStatus take_lines(const CtsFrameFormat *f, ojph::codestream &codestream, void *pixels, CtsError *err)
{
    const ojph::param_siz siz = codestream.access_siz();
    const unsigned n_components = siz.get_num_components();
    const size_t columns = static_cast<size_t>(f->columns), sample_bytes = static_cast<size_t>(f->bits_allocated / 8);
    std::vector<size_t> n_lines(n_components, 0);
    std::vector<int32_t> line(columns);
    for (size_t i = 0; i < n_components * static_cast<size_t>(f->rows); i++) {
        ojph::ui32 c = 0;
        const ojph::line_buf *got = codestream.pull(c);
        if (!got || c >= n_components || got->size < columns || n_lines[c] >= static_cast<size_t>(f->rows))
            return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream is damaged: a line is missing");
        CtsJpeg2000Samples samples = {};
        samples.precision = static_cast<int>(siz.get_bit_depth(c));
        samples.is_signed = siz.is_signed(c);
        /* What lossy coding has added above the precision. */
        const int32_t low = samples.is_signed ? -(1 << (samples.precision - 1)) : 0;
        const int32_t high = low + (1 << samples.precision) - 1;
        for (size_t x = 0; x < columns; x++)
            line[x] = std::clamp(got->i32[x], low, high);
        samples.values = line.data();
        samples.first = n_lines[c]++ * columns;
        samples.n = columns;
        const CtsStatus st =
            cts_jpeg2000_take_samples(f, &samples, static_cast<uint8_t *>(pixels) + c * sample_bytes, err);
        if (st)
            return st;
    }
    return CTS_OK;
}

CtsStatus decode(const CtsFrameFormat *f, const uint8_t *bytes, size_t n, void *pixels, CtsError *err)
{
    listen();
    ojph::mem_infile file;
    ojph::codestream codestream;
    file.open(bytes, n);
    codestream.read_headers(&file);
    CtsStatus st = check_shape(f, codestream.access_siz(), err);
    if (st)
        return st;
    codestream.set_planar(false);
    codestream.create();
    st = take_lines(f, codestream, pixels, err);
    codestream.close();
    return st;
}

} // namespace

CtsStatus cts_htj2k_decode(const CtsFrameFormat *f, const uint8_t *bytes, size_t n, void *pixels, CtsError *err)
try {
    return is_for_openjph(bytes, n) ? decode(f, bytes, n, pixels, err) : cts_jpeg2000_decode(f, bytes, n, pixels, err);
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
} catch (const std::exception &why) {
    return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 stream is damaged: %s", why.what());
} catch (...) {
    return cts_fail(err, CTS_ERR_PIXELS, "unexpected failure in OpenJPH");
}
