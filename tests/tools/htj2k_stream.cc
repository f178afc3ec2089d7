#include "htj2k_stream.h"

#include <algorithm>
#include <vector>

#include <openjph/ojph_arch.h>
#include <openjph/ojph_base.h>
#include <openjph/ojph_codestream.h>
#include <openjph/ojph_file.h>
#include <openjph/ojph_mem.h>
#include <openjph/ojph_params.h>

Jpeg2000Bytes htj2k_stream(const Jpeg2000 *p, bool lossy, const int32_t *samples)
try {
    ojph::codestream codestream;
    ojph::param_siz siz = codestream.access_siz();
    const ojph::ui32 columns = static_cast<ojph::ui32>(p->columns), rows = static_cast<ojph::ui32>(p->rows);
    siz.set_image_extent(ojph::point(columns, rows));
    siz.set_num_components(static_cast<ojph::ui32>(p->n_components));
    for (ojph::ui32 c = 0; c < static_cast<ojph::ui32>(p->n_components); c++)
        siz.set_component(c, ojph::point(1, 1), static_cast<ojph::ui32>(p->bits), p->is_signed);
    ojph::param_cod cod = codestream.access_cod();
    cod.set_num_decomposition(p->columns < 32 ? 1 : 5);
    cod.set_block_dims(64, 64);
    cod.set_color_transform(false);
    cod.set_reversible(!lossy);
    if (lossy)
        codestream.access_qcd().set_irrev_quant(0.005f);
    codestream.set_planar(p->n_components > 1);
    ojph::mem_outfile file;
    file.open();
    codestream.write_headers(&file);
    ojph::ui32 component = 0;
    ojph::line_buf *line = codestream.exchange(nullptr, component);
    std::vector<ojph::ui32> row(static_cast<size_t>(p->n_components), 0);
    for (size_t i = 0; i < static_cast<size_t>(p->rows) * static_cast<size_t>(p->n_components); i++) {
        const int32_t *from = samples + static_cast<size_t>(row[component]++) * columns;
        std::copy(from, from + columns, line->i32);
        line = codestream.exchange(line, component);
    }
    codestream.flush();
    Jpeg2000Bytes bytes = {nullptr, static_cast<size_t>(file.tell()), 0};
    bytes.data = static_cast<uint8_t *>(std::malloc(bytes.n));
    if (bytes.data)
        std::memcpy(bytes.data, file.get_data(), bytes.n);
    codestream.close();
    return bytes;
} catch (...) {
    return {nullptr, 0, 0};
}
