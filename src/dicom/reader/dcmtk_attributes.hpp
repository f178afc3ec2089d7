/* Attributes of a slice or frame by tag, as DCMTK has read them from the data set or, of a frame, from its functional
 * groups (PS3.3 C.7.6.16). */
#pragma once

#include "dicom/reader/reader.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <string_view>
#include <vector>

/* The elements of a data set, to be found faster than by DCMTK's walk from the first. */
class CtsTopLevel
{
  public:
    explicit CtsTopLevel(DcmItem &item);
    DcmElement *find(const DcmTagKey &tag) const;

  private:
    std::vector<DcmElement *> elements_; /* by rising tag */
};

struct CtsAttributes {
    const CtsTopLevel &top;
    bool is_frame = false;
    DcmItem *groups[2] = {}; /* of a frame: its own ones precede the shared ones; NULL: none */
    bool is_item = false;    /* of a sequence: the first group has its elements */
    char digits[12] = "";
};

bool cts_is_text(DcmEVR vr);
/* The whole value of a text; empty where it is none. */
std::string_view cts_element_text(DcmElement *element);
/* Adds all numbers of a value of binary VR; false: of another VR, or cut short. */
bool cts_binary_numbers(DcmElement &element, std::vector<double> &values);
/* NULL: it has none, or is none. */
DcmItem *cts_first_item(DcmElement *sequence);
bool cts_attribute_has(const CtsAttributes &item, const DcmTagKey &tag);
/* The value as text without padding, empty if missing or of a binary VR; valid until the next call. */
std::string_view cts_attribute_text(CtsAttributes &item, const DcmTagKey &tag);
/* A single US value. */
bool cts_attribute_word(const CtsAttributes &item, const DcmTagKey &tag, int *value);
/* The 16 bits of a padding value, whose VR (US or SS) is often wrong. */
bool cts_attribute_pattern(const CtsAttributes &item, const DcmTagKey &tag, unsigned *pattern);

/* n numbers of DS or IS. */
bool cts_attribute_decimals(CtsAttributes &item, const DcmTagKey &tag, double *values, int n);
/* A single number of any VR, or the first of several; NaN if missing. */
double cts_attribute_number_or_nan(const CtsAttributes &item, const DcmTagKey &tag);
/* Up to n numbers of any VR; their count, 0 where there are more. */
int cts_attribute_numbers(const CtsAttributes &item, const DcmTagKey &tag, double *values, int n);
/* The attributes of a sequence's first item; none where it is missing. */
CtsAttributes cts_attribute_item(const CtsAttributes &item, const DcmTagKey &sequence);

/* A private element at the top level: (group,xxNN) in the block that its creator reserved. */
struct CtsPrivateTag {
    uint16_t group;
    const char *creator;
    uint8_t nn;
};
std::string_view cts_private_text(const CtsAttributes &item, const CtsPrivateTag &tag);
int cts_private_numbers(const CtsAttributes &item, const CtsPrivateTag &tag, double *values, int n);

std::string_view cts_without_padding(std::string_view text);
/* The n-th value of a multi-valued text, from 0, without padding. */
std::string_view cts_text_value(std::string_view text, int n);

/* Reads the slices of a data set into a zeroed object whose texts are kept in texts: all fields of each slice except
 * path, file facts, syntax, odd syntax flags and pixel offset. class_uid: the meta header's, used where the data set
 * has none. A slice with unusable values is a success with slice->fault set; so is an object of many frames without a
 * usable one, as one slice. Throws std::bad_alloc, like the following functions. */
void cts_dcm_read_object(DcmItem &data_set, CtsStringPool *texts, const char *class_uid, CtsObject *object);

/* Reads all of a slice except its position in the file. */
void cts_dcm_read_slice(CtsAttributes &item, CtsStringPool &texts, CtsSlice *slice);

/* HH, HHMM or HHMMSS.FFFFFF, which colons may be within, as seconds of the day; NaN for anything else. */
double cts_seconds_of_day(std::string_view text);

/* Reads the attributes of MR and PET alone. */
void cts_dcm_read_mr(CtsAttributes &item, CtsStringPool &texts, CtsSlice *slice);
void cts_dcm_read_pet(CtsAttributes &item, CtsSlice *slice);

/* Adds a slice to an object. */
CtsSlice *cts_dcm_add_slice(CtsObject *object);
/* Adds a slice for each frame, by the functional groups, in the order of the pixels; a single one with a fault if no
 * frame can be used. */
void cts_dcm_read_frames(const CtsTopLevel &top, CtsStringPool &texts, CtsObject *object);

/* Adds at most `longest` characters of a text to the string pool. */
const char *cts_dcm_share(CtsStringPool &texts, std::string_view text, size_t longest = CTS_MAX_TEXT);

/* Writes the records of a data set (dicom/header/elements.h), in front of them its SOP class in the meta header, into
 * at most n bytes; returns the number of bytes needed, more than n where they do not fit. */
size_t cts_elements_pack(DcmItem &data_set, const char *class_uid, uint8_t *bytes, size_t n);
