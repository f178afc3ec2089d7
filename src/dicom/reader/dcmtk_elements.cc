/* A data set -> records (dicom/header/elements.h). */
#include "dicom/header/elements.h"
#include "dicom/reader/dcmtk_attributes.hpp"
#include "dicom/reader/reader.h"

#include <algorithm>
#include <cstring>

namespace
{

/* Bytes that are written as far as they fit, and counted. */
class Output
{
  public:
    Output(uint8_t *bytes, size_t n) : bytes_(bytes), n_(n)
    {
    }
    size_t used() const
    {
        return used_;
    }
    void put(const void *bytes, size_t n)
    {
        if (n && used_ <= n_ && n <= n_ - used_)
            std::memcpy(bytes_ + used_, bytes, n);
        used_ += n;
    }
    /* Begins a record; end() completes it. */
    size_t begin(uint32_t tag, CtsValueKind kind)
    {
        const CtsRecord record = {tag, static_cast<uint32_t>(kind), 0};
        put(&record, sizeof record);
        return used_;
    }
    void end(size_t value)
    {
        const uint64_t n = used_ - value, zeros = 0;
        if (used_ <= n_)
            std::memcpy(bytes_ + value - sizeof n, &n, sizeof n);
        put(&zeros, (8 - n % 8) % 8);
    }
    void record(uint32_t tag, CtsValueKind kind, const void *bytes, size_t n)
    {
        const size_t value = begin(tag, kind);
        put(bytes, n);
        end(value);
    }

  private:
    uint8_t *bytes_;
    size_t n_, used_ = 0;
};

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

void put_value(DcmElement &e, uint32_t tag, Output &out)
{
    std::vector<double> values;
    const std::string_view text = cts_element_text(&e);
    const bool is_text = cts_is_text(e.ident());
    Uint8 *bytes = nullptr;
    Uint16 *words = nullptr;
    if (is_text && !((e.ident() == EVR_DS || e.ident() == EVR_IS) && parse(text, values)))
        out.record(tag, CTS_VALUE_TEXT, text.data(), text.size());
    else if (is_text || cts_binary_numbers(e, values))
        out.record(tag, CTS_VALUE_NUMBERS, values.data(), values.size() * sizeof(double));
    else if (e.getUint16Array(words).good() && words)
        out.record(tag, CTS_VALUE_BYTES, words, e.getLength());
    else if (e.getUint8Array(bytes).good() && bytes)
        out.record(tag, CTS_VALUE_BYTES, bytes, e.getLength());
    else
        out.record(tag, CTS_VALUE_BYTES, nullptr, 0);
}

/* Not deeper than the framing's limit, which was checked (CTS_MAX_NESTING). */
void put_item(DcmItem &item, Output &out)
{
    for (DcmObject *o = item.nextInContainer(nullptr); o; o = item.nextInContainer(o)) {
        const uint32_t tag = number_of(o->getTag());
        if (o->ident() != EVR_SQ) {
            put_value(static_cast<DcmElement &>(*o), tag, out);
            continue;
        }
        auto &sequence = static_cast<DcmSequenceOfItems &>(*o);
        const size_t value = out.begin(tag, CTS_VALUE_ITEMS);
        for (DcmObject *i = sequence.nextInContainer(nullptr); i; i = sequence.nextInContainer(i)) {
            const size_t elements = out.begin(0, CTS_VALUE_ITEM);
            put_item(static_cast<DcmItem &>(*i), out);
            out.end(elements);
        }
        out.end(value);
    }
}

} // namespace

size_t cts_elements_pack(DcmItem &data_set, const char *class_uid, uint8_t *bytes, size_t n)
{
    Output out(bytes, n);
    out.record(CTS_TAG_META_CLASS, CTS_VALUE_TEXT, class_uid, std::strlen(class_uid));
    put_item(data_set, out);
    return out.used();
}
