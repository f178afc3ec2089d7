/* Insertion of attributes into a data set, shared by the writers of DICOM objects. */
#ifndef CTS_DICOM_DCM_PUT_HPP
#define CTS_DICOM_DCM_PUT_HPP

#include "ctsplat/status.h"
#include "dicom/objects/objects.h"

#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dctk.h>
#include <memory>
#include <string>
#include <vector>

/* A decimal string with as many digits as fit 16 characters (DS, PS3.5 6.2), with a point in any locale. */
std::string cts_dcm_decimal(double value);

/* Inserts values into an item; after the first failure, which is stored, it does nothing. */
class Put
{
  public:
    explicit Put(DcmItem &item) : item_(item)
    {
    }

    Put &text(const DcmTagKey &tag, const char *value);
    Put &number(const DcmTagKey &tag, long value);
    /* Decimal strings (DS), each of at most 16 characters. */
    Put &decimals(const DcmTagKey &tag, const double *values, int n);
    Put &word(const DcmTagKey &tag, int value);
    Put &words(const DcmTagKey &tag, const std::vector<Uint16> &values);
    Put &doubles(const DcmTag &tag, const double *values, int n);
    Put &floats(const DcmTagKey &tag, const double *values, int n);
    Put &bytes(const DcmTagKey &tag, const uint8_t *values, size_t n);
    /* Takes ownership of the element. */
    Put &element(DcmElement *element);
    Put &code(const DcmTagKey &sequence, const CtsScCode &code);
    /* A new item at the end of a sequence; NULL after a failure. */
    DcmItem *item(const DcmTagKey &sequence);
    /* A new item that references an object. */
    DcmItem *reference(const DcmTagKey &sequence, const char *class_uid, const char *uid);

    Put &keep(const OFCondition &state)
    {
        if (state_.good())
            state_ = state;
        return *this;
    }

    const OFCondition &state() const
    {
        return state_;
    }

  private:
    DcmItem &item_;
    OFCondition state_ = EC_Normal;
};

inline Put &Put::text(const DcmTagKey &tag, const char *value)
{
    return keep(state_.good() ? item_.putAndInsertString(DcmTag(tag), value) : state_);
}

inline Put &Put::number(const DcmTagKey &tag, long value)
{
    char digits[24];
    std::snprintf(digits, sizeof digits, "%ld", value);
    return text(tag, digits);
}

inline Put &Put::decimals(const DcmTagKey &tag, const double *values, int n)
{
    std::string all;
    for (int i = 0; i < n; i++)
        all += (i ? "\\" : "") + cts_dcm_decimal(values[i]);
    return text(tag, all.c_str());
}

inline Put &Put::word(const DcmTagKey &tag, int value)
{
    return keep(state_.good() ? item_.putAndInsertUint16(DcmTag(tag), static_cast<Uint16>(value)) : state_);
}

inline Put &Put::words(const DcmTagKey &tag, const std::vector<Uint16> &values)
{
    return keep(state_.good() ? item_.putAndInsertUint16Array(DcmTag(tag), values.data(),
                                                              static_cast<unsigned long>(values.size()))
                              : state_);
}

inline Put &Put::doubles(const DcmTag &tag, const double *values, int n)
{
    std::unique_ptr<DcmFloatingPointDouble> made(new DcmFloatingPointDouble(tag));
    keep(made->putFloat64Array(values, static_cast<unsigned long>(n)));
    return element(made.release());
}

inline Put &Put::floats(const DcmTagKey &tag, const double *values, int n)
{
    std::vector<Float32> narrow(values, values + n);
    std::unique_ptr<DcmFloatingPointSingle> made(new DcmFloatingPointSingle(DcmTag(tag)));
    keep(made->putFloat32Array(narrow.data(), static_cast<unsigned long>(n)));
    return element(made.release());
}

inline Put &Put::bytes(const DcmTagKey &tag, const uint8_t *values, size_t n)
{
    return keep(state_.good() ? item_.putAndInsertUint8Array(DcmTag(tag), values, static_cast<unsigned long>(n))
                              : state_);
}

inline Put &Put::element(DcmElement *element)
{
    if (state_.good())
        state_ = element ? item_.insert(element) : EC_MemoryExhausted;
    if (state_.bad())
        delete element;
    return *this;
}

inline DcmItem *Put::item(const DcmTagKey &sequence)
{
    DcmItem *made = nullptr;
    if (state_.good())
        state_ = item_.findOrCreateSequenceItem(DcmTag(sequence), made, -2);
    return state_.good() ? made : nullptr;
}

inline DcmItem *Put::reference(const DcmTagKey &sequence, const char *class_uid, const char *uid)
{
    DcmItem *made = item(sequence);
    if (made)
        keep(Put(*made).text(DCM_ReferencedSOPClassUID, class_uid).text(DCM_ReferencedSOPInstanceUID, uid).state());
    return made;
}

inline Put &Put::code(const DcmTagKey &sequence, const CtsScCode &code)
{
    if (DcmItem *made = item(sequence)) {
        Put to(*made);
        to.text(DCM_CodeValue, code.value).text(DCM_CodingSchemeDesignator, code.scheme);
        keep(to.text(DCM_CodeMeaning, code.meaning).state());
    }
    return *this;
}

/* Calls add once for each object of the source's slices. */
template <typename Add> void cts_dcm_each_instance(const CtsSeries &source, Add add)
{
    const char *last = "";
    for (int i = 0; i < source.n_slices; i++) {
        const char *uid = source.slices[i]->sop_uid;
        if (*uid && std::strcmp(uid, last) != 0)
            add(uid);
        last = uid;
    }
}

/* Adds references to the label objects of one study. */
void cts_dcm_put_label_series(Put &put, const CtsLabels &labels, const char *study_uid);

/* Copies an element from `from` with its value bytes, without private elements in it; does nothing where it is missing.
 */
void cts_dcm_copy(Put &put, DcmItem &from, const DcmTagKey &tag, bool filled = false);
/* Removes the zeros that pad its texts. */
OFCondition cts_dcm_drop_zeros(DcmElement &element);

/* Adds the ICC profile of ctsplat's colours (sRGB). */
Put &cts_dcm_put_profile(Put &put, const DcmTagKey &tag);

/* The value as text; "" where it is missing. */
const char *cts_dcm_text(DcmItem &item, const DcmTagKey &tag);

/* Loads a scanned header into a data set of DCMTK. */
CtsStatus cts_dcm_load(DcmDataset &data, const CtsDataSet &set, CtsError *err);

/* Adds the attributes of patient and study: copies of the source's, or the pseudonym's. */
void cts_dcm_put_study(Put &put, DcmItem &source, const char *pseudonym);

/* Encodes the file up to the end of its data set into the sink, in parts, under ctsplat's implementation name. */
CtsStatus cts_dcm_stream(DcmFileFormat &file, E_TransferSyntax syntax, CtsScSink sink, void *context, CtsError *err);

#endif
