/* The header of a slice from the values that the tag scan has found, where nothing about it is odd; else by DCMTK. */
#include "input/header/dcm_attributes.hpp"
#include "input/header/dcm_door.hpp"
#include "input/header/dcm_readers.h"

#include <algorithm>
#include <cstring>
#include <string_view>

namespace
{

/* The values that the tag scan has found, where nothing about them is odd: a plain header needs no parser, nor the half
 * of a small run's time that loading DCMTK's dictionary takes. */
class ScannedAttributes final : public CtsAttributes
{
  public:
    ScannedAttributes(const uint8_t *data_set, const CtsDataScan &found) : bytes(data_set), scan(found)
    {
    }
    /* Whether DCMTK would read the same: explicit little endian, every value of its own VR and an even length, texts
     * without what DCMTK corrects. */
    bool plain(const CtsSyntax &syntax) const
    {
        if (!syntax.explicit_vr || syntax.big_endian || scan.repeats)
            return false;
        for (int i = 0; i < scan.n_values; i++)
            if (!plain_value(scan.values[i]))
                return false;
        return true;
    }
    bool has(const DcmTagKey &tag) override
    {
        return find(tag) != nullptr;
    }
    std::string_view text(const DcmTagKey &tag) override
    {
        const CtsTagValue *value = find(tag);
        return value && is_text(*value) ? text_value(*value) : std::string_view();
    }
    bool unsigned_short(const DcmTagKey &tag, int *value) override
    {
        unsigned pattern = 0;
        if (!bit_pattern(tag, &pattern))
            return false;
        *value = static_cast<int>(pattern);
        return true;
    }
    bool bit_pattern(const DcmTagKey &tag, unsigned *pattern) override
    {
        const CtsTagValue *value = find(tag);
        if (!value || value->n_bytes != 2)
            return false;
        *pattern = static_cast<unsigned>(bytes[value->offset] | bytes[value->offset + 1] << 8);
        return true;
    }

  private:
    static bool is_one_of(const CtsTagValue &value, std::string_view vrs)
    {
        for (size_t i = 0; i + 1 < vrs.size(); i += 2)
            if (std::memcmp(vrs.data() + i, value.vr, 2) == 0)
                return true;
        return false;
    }
    static bool is_text(const CtsTagValue &value)
    {
        return is_one_of(value, "CSDADSISLOPNSHTMUI");
    }
    std::string_view text_value(const CtsTagValue &value) const
    {
        return std::string_view(reinterpret_cast<const char *>(bytes + value.offset), value.n_bytes);
    }
    /* DCMTK takes all else out of a UID. */
    static bool uid_character(char c)
    {
        return (c >= '0' && c <= '9') || c == '.';
    }
    bool plain_value(const CtsTagValue &value) const
    {
        if (value.is_sequence)
            return value.tag == 0x00041220 || value.tag == 0x00283000;
        if (value.n_bytes % 2)
            return false;
        if (value.tag == 0x00280120 || value.tag == 0x00280121)
            return value.n_bytes == 2 && is_one_of(value, "USSS");
        const bool is_number = value.tag >> 16 == 0x0028 && (value.tag & 0xFFFF) != 0x0004 &&
                               (value.tag & 0xFFFF) != 0x0008 && (value.tag & 0xFFFF) != 0x0030 &&
                               (value.tag & 0xFFFF) < 0x0300;
        if (is_number)
            return value.n_bytes == 2 && is_one_of(value, "US");
        if (!is_text(value))
            return false;
        const std::string_view text = text_value(value);
        const bool is_uid = std::memcmp(value.vr, "UI", 2) == 0;
        for (size_t i = 0; i < text.size(); i++)
            if (text[i] == '\0' ? !is_uid || i + 1 < text.size() : is_uid && !uid_character(text[i]))
                return false;
        return true;
    }
    const CtsTagValue *find(const DcmTagKey &tag) const
    {
        /* In order, for a plain header repeats nothing. */
        const uint32_t wanted = static_cast<uint32_t>(tag.getGroup()) << 16 | tag.getElement();
        const CtsTagValue *const end = scan.values + scan.n_values;
        const CtsTagValue *const found = std::lower_bound(
            scan.values, end, wanted, [](const CtsTagValue &value, uint32_t key) { return value.tag < key; });
        return found != end && found->tag == wanted ? found : nullptr;
    }

    const uint8_t *bytes;
    const CtsDataScan &scan;
};

} // namespace

/* DCMTK takes control characters out of a UID, and a series would become another one. */
static bool is_torn_uid(const CtsTagValue &value, const uint8_t *bytes)
{
    const uint32_t uids[] = {0x00080018, 0x0020000D, 0x0020000E, 0x00200052};
    if (value.is_sequence || std::find(std::begin(uids), std::end(uids), value.tag) == std::end(uids))
        return false;
    uint32_t n = value.n_bytes;
    while (n > 0 && bytes[value.offset + n - 1] == 0)
        n--;
    return std::any_of(bytes + value.offset, bytes + value.offset + n, [](uint8_t c) { return c < 0x20 || c == 0x7F; });
}

CtsStatus cts_dcm_read_header(const uint8_t *bytes, size_t n, const CtsDataScan *scan, const CtsSyntax *native,
                              CtsTexts *texts, char class_uid[65], CtsSlice *slice, CtsError *err)
try {
    ScannedAttributes scanned(bytes, *scan);
    if (!scanned.plain(*native)) {
        for (int i = 0; i < scan->n_values; i++)
            if (is_torn_uid(scan->values[i], bytes))
                return cts_fail(err, CTS_ERR_READ, "damaged: its UID (%04X,%04X) holds control characters",
                                static_cast<unsigned>(scan->values[i].tag >> 16),
                                static_cast<unsigned>(scan->values[i].tag & 0xFFFF));
        const CtsDcmReaders *dcm = nullptr;
        const CtsStatus st = cts_dcm_readers(&dcm, err);
        return st ? st : dcm->parse_header(bytes, n, native, texts, class_uid, slice, err);
    }
    cts_dcm_read_object(scanned, *texts, class_uid, slice);
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}
