#include "dicom/writer/dcmtk_write.hpp"

#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <memory>
#include <string>
#include <vector>

namespace
{

/* Names this implementation of DICOM writing (PS3.7 D.3.3.2); made once, like any UID. */
const char *const implementation_uid = "2.25.67028870792169200667320284542246776385";

/* Zeros with which some devices pad texts are not valid in any character set (PS3.5 6.1.3): each value is truncated at
 * its first zero. */
void drop_zeros(DcmByteString &text)
{
    char *bytes = nullptr;
    Uint32 n = 0;
    if (text.getString(bytes, n).bad() || !bytes || !std::memchr(bytes, 0, n))
        return;
    std::string clean;
    bool padding = false;
    for (Uint32 i = 0; i < n; i++) {
        padding = bytes[i] == 0 || (padding && bytes[i] != '\\');
        if (!padding)
            clean += bytes[i];
    }
    cts_dcm_check(text.putString(clean.c_str(), static_cast<Uint32>(clean.size())));
}

/* Removes private elements and zeros within. */
void clean_up(DcmElement &element)
{
    if (DcmByteString *text = dynamic_cast<DcmByteString *>(&element))
        drop_zeros(*text);
    DcmSequenceOfItems *sequence = dynamic_cast<DcmSequenceOfItems *>(&element);
    for (unsigned long k = 0; sequence && k < sequence->card(); k++) {
        DcmItem &item = *sequence->getItem(k);
        for (unsigned long i = item.card(); i-- > 0;)
            if (item.getElement(i)->getTag().isPrivate())
                delete item.remove(i);
            else
                clean_up(*item.getElement(i));
    }
}

/* A decimal string with as many digits as fit 16 characters (DS, PS3.5 6.2), with a point in any locale. */
std::string decimal(double value)
{
    char digits[64];
    for (int precision = 16; precision > 0; precision--) {
        OFStandard::ftoa(digits, sizeof digits, value, 0, 0, precision);
        if (std::strlen(digits) <= 16)
            break;
    }
    return digits;
}

/* The bytes of a value as an array. */
template <typename Value> std::vector<Value> array_of(const CtsElements &bytes)
{
    std::vector<Value> values(static_cast<size_t>(bytes.end - bytes.at) / sizeof(Value));
    if (!values.empty())
        std::memcpy(values.data(), bytes.at, values.size() * sizeof(Value));
    return values;
}

/* Numbers by the element's VR. */
OFCondition put_numbers(DcmElement &element, const std::vector<double> &values)
{
    const unsigned long n = static_cast<unsigned long>(values.size());
    const bool is_word = element.ident() == EVR_US || element.ident() == EVR_AT;
    const std::vector<Uint16> words(values.begin(), is_word ? values.end() : values.begin());
    std::string text;
    switch (element.ident()) {
    case EVR_FD:
        return element.putFloat64Array(values.data(), n);
    case EVR_US:
        return element.putUint16Array(words.data(), n);
    case EVR_AT:
        return element.putUint16Array(words.data(), n / 2);
    default:
        for (const double value : values)
            text += (text.empty() ? "" : "\\") + decimal(value);
        return element.putString(text.c_str());
    }
}

/* The VR where the dictionary leaves a choice, or has none. */
DcmTag tag_of(const CtsElement &e)
{
    DcmTag tag(static_cast<Uint16>(e.tag >> 16), static_cast<Uint16>(e.tag & 0xFFFF));
    if (tag.getEVR() == EVR_xs)
        tag.setVR(EVR_US);
    else if (tag.isPrivate())
        tag.setVR(e.kind == CTS_VALUE_TEXT ? EVR_LO : EVR_OB);
    return tag;
}

void insert_all(DcmItem &item, CtsElements attributes);

void insert_items(DcmItem &item, const DcmTag &sequence, CtsElements items)
{
    CtsElements attributes;
    while (cts_items_next(&items, &attributes)) {
        DcmItem *made = nullptr;
        cts_dcm_check(item.findOrCreateSequenceItem(sequence, made, -2));
        insert_all(*made, attributes);
    }
}

void insert_value(DcmItem &item, const DcmTag &tag, const CtsElement &e)
{
    DcmElement *element = nullptr;
    cts_dcm_check(DcmItem::newDicomElementWithVR(element, tag));
    std::unique_ptr<DcmElement> owner(element);
    const unsigned long n = static_cast<unsigned long>(e.value.end - e.value.at);
    if (e.kind == CTS_VALUE_NUMBERS)
        cts_dcm_check(put_numbers(*element, array_of<double>(e.value)));
    else if (e.kind == CTS_VALUE_TEXT)
        cts_dcm_check(element->putString(reinterpret_cast<const char *>(e.value.at), static_cast<Uint32>(n)));
    else if (tag.getEVR() == EVR_OW)
        cts_dcm_check(element->putUint16Array(array_of<Uint16>(e.value).data(), n / 2));
    else
        cts_dcm_check(element->putUint8Array(e.value.at, n));
    cts_dcm_check(item.insert(element, OFTrue));
    owner.release();
}

void insert_all(DcmItem &item, CtsElements attributes)
{
    CtsElement e;
    while (cts_elements_next(&attributes, &e))
        if (e.kind == CTS_VALUE_ITEMS)
            insert_items(item, tag_of(e), e.value);
        else
            insert_value(item, tag_of(e), e);
}

/* DCMTK fills the meta header with names of its own; these are ours. */
void put_meta(DcmFileFormat &file, E_TransferSyntax syntax)
{
    char version[17];
    std::snprintf(version, sizeof version, "CTSPLAT_%.8s", CTS_VERSION);
    for (char *c = version; *c; c++)
        *c = *c == '.' ? '_' : *c;
    cts_dcm_check(file.validateMetaInfo(syntax));
    DcmMetaInfo *const meta = file.getMetaInfo();
    cts_dcm_check(meta->putAndInsertString(DCM_ImplementationClassUID, implementation_uid));
    cts_dcm_check(meta->putAndInsertString(DCM_ImplementationVersionName, version));
    cts_dcm_check(
        meta->computeGroupLengthAndPadding(EGL_recalcGL, EPD_noChange, EXS_LittleEndianExplicit, EET_ExplicitLength));
}

} // namespace

void cts_dcm_copy(DcmItem &to, DcmElement &element, bool filled)
{
    std::unique_ptr<DcmElement> copy(dynamic_cast<DcmElement *>(element.clone()));
    if (!copy)
        throw std::bad_alloc();
    clean_up(*copy);
    if (filled && copy->getLength() == 0)
        return;
    cts_dcm_check(to.insert(copy.get(), OFTrue));
    copy.release();
}

size_t cts_dcm_write(DcmItem &source, const CtsReaderOrder &order, CtsElements attributes, uint8_t *bytes, size_t n)
{
    DcmFileFormat file;
    const E_TransferSyntax syntax = DcmXfer(cts_syntax_by_number(order.syntax_number)->uid).getXfer();
    DcmOutputBufferStream out(bytes, static_cast<offile_off_t>(n & ~size_t{1}));
    void *start = nullptr;
    offile_off_t written = 0;
    cts_dcm_copy_study(*file.getDataset(), source, order.deidentified);
    if (order.body_side)
        cts_dcm_copy_side(*file.getDataset(), source);
    insert_all(*file.getDataset(), attributes);
    put_meta(file, syntax);
    file.transferInit();
    const OFCondition state = file.write(out, syntax, EET_ExplicitLength, nullptr, EGL_withoutGL, EPD_withoutPadding, 0,
                                         0, 0, EWM_dontUpdateMeta);
    file.transferEnd();
    if (state == EC_StreamNotifyClient)
        return 2 * n;
    cts_dcm_check(state);
    out.flushBuffer(start, written);
    return static_cast<size_t>(written);
}
