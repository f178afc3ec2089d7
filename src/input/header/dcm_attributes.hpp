/* One slice's or frame's attributes by tag, wherever they stand. Of DCMTK only the tags' names. */
#ifndef CTS_DICOM_DCM_ATTRIBUTES_HPP
#define CTS_DICOM_DCM_ATTRIBUTES_HPP

#include "input/header/slice.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dctagkey.h>
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
/* The same for whatever a data set describes: its kind, and its class where it has one; a slice only if it is one. */
void cts_dcm_read_object(CtsAttributes &item, CtsTexts &texts, char class_uid[65], CtsSlice *slice);

/* At most `longest` characters of a text, shared. Throws std::bad_alloc. */
const char *cts_dcm_share(CtsTexts &texts, std::string_view text, size_t longest);

#endif
