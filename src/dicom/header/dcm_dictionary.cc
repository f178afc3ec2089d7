/* Loads DCMTK's dictionary: DCMTK's own reader does not check malloc(), takes several times as long, and gets the file
 * name from the environment. */
#include <dcmtk/config/osconfig.h>

#include "base/file.h"
#include "dicom/header/dcm_call.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcdicent.h>
#include <dcmtk/dcmdata/dcdict.h>
#include <memory>
#include <string>

namespace
{

const size_t MAX_BYTES = 4 << 20; /* of a dictionary's file; DCMTK's largest has 0.25 MB */

/* Access to the private member that holds the dictionary, before DCMTK creates one: an explicit instantiation may name
 * private members. */
DcmDataDictionary *&the_dictionary();
template <DcmDataDictionary *GlobalDcmDataDictionary::*member> struct Member {
    friend DcmDataDictionary *&the_dictionary()
    {
        return dcmDataDict.*member;
    }
};
template struct Member<&GlobalDcmDataDictionary::dataDict>;

/* The flag that marks a dictionary as loaded; DCMTK's network library sends nothing without it. */
OFBool &is_whole(DcmDataDictionary &dictionary);
template <OFBool DcmDataDictionary::*member> struct Flag {
    friend OFBool &is_whole(DcmDataDictionary &dictionary)
    {
        return dictionary.*member;
    }
};
template struct Flag<&DcmDataDictionary::dictionaryLoaded>;

/* "0028" or "6000-60FF", which means even numbers, or "6000-u-60FF", which means all. */
bool parse_range(const char *text, unsigned *first, unsigned *last, DcmDictRangeRestriction *restriction)
{
    char kind = 'e', rest = 0;
    *restriction = DcmDictRange_Unspecified;
    if (std::sscanf(text, "%4x-%c-%4x%c", first, &kind, last, &rest) != 3) {
        const int n = std::sscanf(text, "%4x-%4x%c", first, last, &rest);
        if (n == 1)
            *last = *first;
        if (n < 1 || n > 2)
            return false;
        kind = n == 1 ? 'u' : 'e';
    }
    if (kind != 'u')
        *restriction = kind == 'o' ? DcmDictRange_Odd : DcmDictRange_Even;
    return true;
}

/* One line: (group,element), VR, name, and two unused fields, separated by tabs. The name is used in place. */
bool add_line(DcmDataDictionary &dictionary, char *line)
{
    char groups[16], elements[16], *rest = nullptr;
    const char *tag = strtok_r(line, "\t", &rest), *vr = strtok_r(nullptr, "\t", &rest);
    const char *name = strtok_r(nullptr, "\t", &rest);
    unsigned group, last_group, element, last_element;
    DcmDictRangeRestriction group_kind, element_kind;
    if (!name || std::sscanf(tag, "(%15[^,],%15[^)])", groups, elements) != 2 ||
        !parse_range(groups, &group, &last_group, &group_kind) ||
        !parse_range(elements, &element, &last_element, &element_kind))
        return false;
    std::unique_ptr<DcmDictEntry> entry(new DcmDictEntry(
        static_cast<Uint16>(group), static_cast<Uint16>(element), static_cast<Uint16>(last_group),
        static_cast<Uint16>(last_element), DcmVR(vr), name, 1, DcmVariableVM, nullptr, OFFalse, nullptr));
    entry->setGroupRangeRestriction(group_kind);
    entry->setElementRangeRestriction(element_kind);
    dictionary.addEntry(entry.get());
    entry.release();
    return true;
}

bool fill(DcmDataDictionary &dictionary, char *text)
{
    char *rest = nullptr;
    for (char *line = strtok_r(text, "\n", &rest); line; line = strtok_r(nullptr, "\n", &rest))
        if (*line == '(' && !add_line(dictionary, line))
            return false;
    return true;
}

} // namespace

CtsStatus cts_dcm_load_dictionary(CtsError *err)
{
    const std::string paths = DCM_DICT_DEFAULT_PATH, path = paths.substr(0, paths.find(':'));
    static char *text; /* memory of the dictionary's names */
    size_t n;
    CtsError why = {};
    if (the_dictionary()) /* the caller of the library uses DCMTK too */
        return CTS_OK;
    std::free(text);
    if (cts_file_text(path.c_str(), MAX_BYTES, CTS_ERR_INTERNAL, &text, &n, &why))
        return cts_fail(err, CTS_ERR_INTERNAL,
                        "DCMTK's data dictionary cannot be loaded: %s (install DCMTK's data files)", why.text);
    std::unique_ptr<DcmDataDictionary> made(new DcmDataDictionary(OFFalse, OFFalse));
    if (!fill(*made, text))
        return cts_fail(err, CTS_ERR_INTERNAL, "DCMTK's data dictionary cannot be loaded: %s is damaged", path.c_str());
    is_whole(*made) = OFTrue;
    the_dictionary() = made.release();
    return CTS_OK;
}
