/* Attributes that DCMTK has parsed. */
#ifndef CTS_DICOM_DCM_PARSED_HPP
#define CTS_DICOM_DCM_PARSED_HPP

#include "input/header/dcm_attributes.hpp"

#include <dcmtk/dcmdata/dctk.h>

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

#endif
