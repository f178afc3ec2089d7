/* One slice's or frame's attributes by tag, wherever they stand. */
#ifndef CTS_DICOM_DCM_ATTRIBUTES_HPP
#define CTS_DICOM_DCM_ATTRIBUTES_HPP

#include "dicom/slice.h"

#include <dcmtk/dcmdata/dctk.h>
#include <string_view>

class CtsAttributes
{
  public:
    virtual ~CtsAttributes() = default;
    virtual bool has(const DcmTagKey &tag) = 0;
    /* As text, empty when missing or of a binary VR. */
    virtual std::string_view text(const DcmTagKey &tag) = 0;
    /* A single US value. */
    virtual bool unsigned_short(const DcmTagKey &tag, int *value) = 0;
    /* The 16 bits of a padding value: its VR (US or SS) is often the wrong one. */
    virtual bool bit_pattern(const DcmTagKey &tag, unsigned *pattern) = 0;
};

/* What DCMTK has parsed. */
class CtsParsedAttributes final : public CtsAttributes
{
  public:
    explicit CtsParsedAttributes(DcmItem &parsed) : item(parsed)
    {
    }
    bool has(const DcmTagKey &tag) override
    {
        return item.tagExists(tag);
    }
    std::string_view text(const DcmTagKey &tag) override
    {
        DcmElement *element = nullptr;
        char *text = nullptr;
        Uint32 n = 0;
        if (item.findAndGetElement(tag, element).bad() || element->getString(text, n).bad() || !text)
            return {};
        return std::string_view(text, n);
    }
    bool unsigned_short(const DcmTagKey &tag, int *value) override
    {
        DcmElement *element = nullptr;
        Uint16 v = 0;
        if (item.findAndGetElement(tag, element).bad() || element->ident() != EVR_US || element->getVM() != 1 ||
            element->getUint16(v).bad())
            return false;
        *value = v;
        return true;
    }
    bool bit_pattern(const DcmTagKey &tag, unsigned *pattern) override
    {
        DcmElement *element = nullptr;
        Uint16 u = 0;
        Sint16 s = 0;
        Uint8 *bytes = nullptr;
        if (item.findAndGetElement(tag, element).bad() || element->getLength() != 2)
            return false;
        if (element->getUint16(u).good())
            *pattern = u;
        else if (element->getSint16(s).good())
            *pattern = static_cast<Uint16>(s);
        else if (element->getUint8Array(bytes).good() && bytes)
            *pattern = static_cast<unsigned>(bytes[0] | bytes[1] << 8);
        else
            return false;
        return true;
    }

  private:
    DcmItem &item;
};

/* Without the padding. */
inline std::string_view cts_text_of(CtsAttributes &item, const DcmTagKey &tag)
{
    std::string_view view = item.text(tag);
    while (!view.empty() && (view.back() == ' ' || view.back() == '\0'))
        view.remove_suffix(1);
    while (!view.empty() && view.front() == ' ')
        view.remove_prefix(1);
    return view;
}

/* All of a slice but its place in the file. */
void cts_dcm_read_slice(CtsAttributes &item, CtsTexts &texts, CtsSlice *slice);

/* At most `longest` characters of a text, shared. Throws std::bad_alloc. */
const char *cts_dcm_share(CtsTexts &texts, std::string_view text, size_t longest);

#endif
