/* The library that decodes with OpenJPH (htj2k.h). */
#include "input/codec/htj2k.h"

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

CtsHtj2kShape shape_of(ojph::param_siz siz)
{
    const ojph::point end = siz.get_image_extent(), origin = siz.get_image_offset(), tile = siz.get_tile_offset();
    CtsHtj2kShape shape = {};
    shape.columns = end.x;
    shape.rows = end.y;
    shape.n_components = siz.get_num_components();
    shape.plain = !origin.x && !origin.y && !tile.x && !tile.y;
    for (unsigned c = 0; c < std::min<unsigned>(shape.n_components, CTS_HTJ2K_MAX_COMPONENTS); c++) {
        const ojph::point step = siz.get_downsampling(c);
        shape.plain = shape.plain && step.x == 1 && step.y == 1;
        shape.components[c].precision = static_cast<int>(siz.get_bit_depth(c));
        shape.components[c].is_signed = siz.is_signed(c);
    }
    return shape;
}

/* Component by component, or line by line in turns, as the stream has them. */
CtsHtj2kEnd take_lines(ojph::codestream &codestream, const CtsHtj2kShape &shape, const CtsHtj2kTaker &taker)
{
    std::vector<unsigned> n_lines(shape.n_components, 0);
    std::vector<int32_t> line(shape.columns);
    for (size_t i = 0; i < static_cast<size_t>(shape.n_components) * shape.rows; i++) {
        ojph::ui32 c = 0;
        const ojph::line_buf *got = codestream.pull(c);
        if (!got || c >= shape.n_components || got->size < line.size() || n_lines[c] >= shape.rows)
            throw std::runtime_error("a line is missing");
        /* What lossy coding has added beyond the precision goes. */
        const int precision = shape.components[c].precision;
        const int32_t low = shape.components[c].is_signed ? -(1 << (precision - 1)) : 0;
        const int32_t high = low + (1 << precision) - 1;
        for (size_t x = 0; x < line.size(); x++)
            line[x] = std::clamp(got->i32[x], low, high);
        if (!taker.line(taker.context, c, n_lines[c]++, line.data()))
            return CTS_HTJ2K_ENDED;
    }
    return CTS_HTJ2K_DONE;
}

CtsHtj2kEnd decode(const uint8_t *stream, size_t n, const CtsHtj2kTaker &taker)
{
    listen();
    ojph::mem_infile file;
    ojph::codestream codestream;
    file.open(stream, n);
    codestream.read_headers(&file);
    const CtsHtj2kShape shape = shape_of(codestream.access_siz());
    if (!taker.shape(taker.context, &shape))
        return CTS_HTJ2K_ENDED;
    if (shape.n_components > CTS_HTJ2K_MAX_COMPONENTS)
        throw std::runtime_error("it has too many components");
    codestream.set_planar(false);
    codestream.create();
    const CtsHtj2kEnd end = take_lines(codestream, shape, taker);
    codestream.close();
    return end;
}

} // namespace

extern "C" __attribute__((visibility("default"))) CtsHtj2kEnd cts_htj2k_run(const uint8_t *stream, size_t n,
                                                                            const CtsHtj2kTaker *taker, char why[120])
try {
    return decode(stream, n, *taker);
} catch (const std::bad_alloc &) {
    return CTS_HTJ2K_NO_MEMORY;
} catch (const std::exception &failure) {
    std::snprintf(why, 120, "%s", failure.what());
    return CTS_HTJ2K_DAMAGED;
} catch (...) {
    std::snprintf(why, 120, "unexpected failure in OpenJPH");
    return CTS_HTJ2K_DAMAGED;
}
