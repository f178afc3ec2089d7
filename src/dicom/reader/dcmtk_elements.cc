/* A data set -> records (dicom/header/elements.h). */
#include "dicom/header/elements.h"
#include "dicom/reader/dcmtk_attributes.hpp"
#include "dicom/reader/reader.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace
{

uint32_t number_of(const DcmTagKey &tag)
{
    return static_cast<uint32_t>(tag.getGroup()) << 16 | tag.getElement();
}

/* The numbers of a text of DS or IS; false where one is none. */
bool parse(std::string_view text, std::vector<double> &values)
{
    values.resize(text.empty() ? 0 : 1 + static_cast<size_t>(std::count(text.begin(), text.end(), '\\')));
    return cts_parse_ds(text.data(), text.size(), values.data(), static_cast<int>(values.size()));
}

void put_value(DcmElement &e, uint32_t tag, CtsRecords *out)
{
    std::vector<double> values;
    const std::string_view text = cts_element_text(&e);
    const bool is_text = cts_is_text(e.ident());
    Uint8 *bytes = nullptr;
    Uint16 *words = nullptr;
    if (is_text && !((e.ident() == EVR_DS || e.ident() == EVR_IS) && parse(text, values)))
        cts_put_bytes(out, tag, CTS_VALUE_TEXT, text.data(), text.size());
    else if (is_text || cts_binary_numbers(e, values))
        cts_put_bytes(out, tag, CTS_VALUE_NUMBERS, values.data(), values.size() * sizeof(double));
    else if (e.getUint16Array(words).good() && words)
        cts_put_bytes(out, tag, CTS_VALUE_BYTES, words, e.getLength());
    else if (e.getUint8Array(bytes).good() && bytes)
        cts_put_bytes(out, tag, CTS_VALUE_BYTES, bytes, e.getLength());
    else
        cts_put_bytes(out, tag, CTS_VALUE_BYTES, nullptr, 0);
}

/* Not deeper than the framing's limit, which was checked (CTS_MAX_NESTING). */
void put_item(DcmItem &item, CtsRecords *out)
{
    for (DcmObject *o = item.nextInContainer(nullptr); o; o = item.nextInContainer(o)) {
        const uint32_t tag = number_of(o->getTag());
        if (o->ident() != EVR_SQ) {
            put_value(static_cast<DcmElement &>(*o), tag, out);
            continue;
        }
        auto &sequence = static_cast<DcmSequenceOfItems &>(*o);
        const size_t value = cts_put_begin(out, tag, CTS_VALUE_ITEMS);
        for (DcmObject *i = sequence.nextInContainer(nullptr); i; i = sequence.nextInContainer(i)) {
            const size_t elements = cts_put_begin(out, 0, CTS_VALUE_ITEM);
            put_item(static_cast<DcmItem &>(*i), out);
            cts_put_end(out, elements);
        }
        cts_put_end(out, value);
    }
}

} // namespace

size_t cts_elements_pack(DcmItem &data_set, const char *class_uid, uint8_t *bytes, size_t n)
{
    CtsRecords out = {};
    const std::unique_ptr<CtsRecords, void (*)(CtsRecords *)> owned(&out, [](CtsRecords *r) { std::free(r->bytes); });
    cts_put_bytes(&out, CTS_TAG_META_CLASS, CTS_VALUE_TEXT, class_uid, std::strlen(class_uid));
    put_item(data_set, &out);
    if (out.status)
        throw std::bad_alloc();
    if (out.n <= n)
        std::memcpy(bytes, out.bytes, out.n);
    return out.n;
}
