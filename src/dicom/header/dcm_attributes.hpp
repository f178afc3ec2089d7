/* Attributes of a slice or frame by tag, as scanned in the data set or, of a frame, in its functional groups (PS3.3
 * C.7.6.16). DCMTK contributes only the tags' names. */
#ifndef CTS_DICOM_DCM_ATTRIBUTES_HPP
#define CTS_DICOM_DCM_ATTRIBUTES_HPP

#include "dicom/header/dcm_read.h"
#include "dicom/parser/elements.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dctagkey.h>
#include <string_view>

constexpr uint32_t cts_tag_number(uint16_t group, uint16_t element)
{
    return static_cast<uint32_t>(group) << 16 | element;
}

inline uint32_t cts_tag_number(const DcmTagKey &tag)
{
    return cts_tag_number(tag.getGroup(), tag.getElement());
}

struct CtsAttributes {
    const CtsDataSet &set;
    bool is_frame = false;
    CtsElements groups[2] = {}; /* of a frame: its own ones precede the shared ones, and both the object's */
    char digits[12] = "";
};

bool cts_attribute_has(const CtsAttributes &item, const DcmTagKey &tag);
/* The value as text without padding, empty if missing or of a binary VR; valid until the next call. */
std::string_view cts_attribute_text(CtsAttributes &item, const DcmTagKey &tag);
/* A single number of VR US or UL. */
bool cts_attribute_number(const CtsAttributes &item, const DcmTagKey &tag, uint32_t *value);
/* A single number of VR FL, FD or DS. */
bool cts_attribute_real(CtsAttributes &item, const DcmTagKey &tag, double *value);
/* A single US value. */
bool cts_attribute_word(const CtsAttributes &item, const DcmTagKey &tag, int *value);
/* The 16 bits of a padding value, whose VR (US or SS) is often wrong. */
bool cts_attribute_pattern(const CtsAttributes &item, const DcmTagKey &tag, unsigned *pattern);

/* Reads all of a slice except its position in the file. */
void cts_dcm_read_slice(CtsAttributes &item, CtsStringPool &texts, CtsSlice *slice);

/* Adds a slice to an object, whose array has room for it. Throws std::bad_alloc, like the following functions. */
CtsSlice *cts_dcm_add_slice(CtsObject *object);
/* Allocates room for n slices. */
void cts_dcm_make_room(CtsObject *object, int n);
/* Adds a slice for each frame, by the functional groups, in the order of the pixels; a single one with a fault if no
 * frame can be used. */
void cts_dcm_read_frames(const CtsDataSet &data_set, CtsStringPool &texts, CtsObject *object);

/* Adds at most `longest` characters of a text to the string pool. */
const char *cts_dcm_share(CtsStringPool &texts, std::string_view text, size_t longest);

#endif
