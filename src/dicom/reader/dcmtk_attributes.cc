#include "dicom/reader/dcmtk_attributes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace
{

/* Location of an attribute in an object of many frames. */
struct Place {
    DcmTagKey asked, group, tag;
    bool is_number = false; /* US or UL, where a slice has text */
};
const Place places[] = {
    {DCM_ImagePositionPatient, DCM_PlanePositionSequence, DCM_ImagePositionPatient},
    {DCM_ImageOrientationPatient, DCM_PlaneOrientationSequence, DCM_ImageOrientationPatient},
    {DCM_PixelSpacing, DCM_PixelMeasuresSequence, DCM_PixelSpacing},
    {DCM_RescaleSlope, DCM_PixelValueTransformationSequence, DCM_RescaleSlope},
    {DCM_RescaleIntercept, DCM_PixelValueTransformationSequence, DCM_RescaleIntercept},
    {DCM_RescaleType, DCM_PixelValueTransformationSequence, DCM_RescaleType},
    {DCM_ImageType, DCM_CTImageFrameTypeSequence, DCM_FrameType},
    {DCM_AcquisitionNumber, DCM_FrameContentSequence, DCM_FrameAcquisitionNumber, true},
    {DCM_AcquisitionTime, DCM_FrameContentSequence, DCM_FrameAcquisitionDateTime},
    {DCM_InstanceNumber, DCM_FrameContentSequence, DCM_InStackPositionNumber, true},
    {DCM_TemporalPositionIdentifier, DCM_FrameContentSequence, DCM_TemporalPositionIndex, true},
    {DCM_StackID, DCM_FrameContentSequence, DCM_StackID},
    {DCM_KVP, DCM_CTXRayDetailsSequence, DCM_KVP},
    {DCM_ConvolutionKernel, DCM_CTReconstructionSequence, DCM_ConvolutionKernel},
    {DCM_NominalPercentageOfCardiacPhase, DCM_CardiacSynchronizationSequence, DCM_NominalPercentageOfCardiacPhase},
    {DCM_NominalCardiacTriggerDelayTime, DCM_CardiacSynchronizationSequence, DCM_NominalCardiacTriggerDelayTime},
    {DCM_SliceThickness, DCM_PixelMeasuresSequence, DCM_SliceThickness},
};

const Place *place_of(const DcmTagKey &tag)
{
    for (const Place &p : places)
        if (p.asked == tag)
            return &p;
    return nullptr;
}

/* An element of an item; NULL: none. */
DcmElement *find_in(DcmItem *item, const DcmTagKey &tag)
{
    for (DcmObject *o = item ? item->nextInContainer(nullptr) : nullptr; o; o = item->nextInContainer(o))
        if (o->getTag() == tag)
            return static_cast<DcmElement *>(o);
    return nullptr;
}

DcmElement *find(const CtsAttributes &item, const DcmTagKey &tag)
{
    const Place *const place = item.is_frame ? place_of(tag) : nullptr;
    if (!place)
        return item.top.find(tag);
    for (DcmItem *group : item.groups)
        if (DcmElement *const found = find_in(cts_first_item(find_in(group, place->group)), place->tag))
            return found;
    /* Legacy objects may have it on top alone. */
    return tag == DCM_ImageType ? item.top.find(tag) : nullptr;
}

std::string_view without_padding(std::string_view view)
{
    while (!view.empty() && (view.back() == ' ' || view.back() == '\0'))
        view.remove_suffix(1);
    while (!view.empty() && view.front() == ' ')
        view.remove_prefix(1);
    return view;
}

/* A date and time (YYYYMMDDHHMMSS.FFFFFF&ZZXX) without its date and zone. */
std::string_view time_of(std::string_view date_time)
{
    date_time = date_time.substr(0, date_time.find_first_of("+-"));
    return date_time.size() > 8 ? date_time.substr(8) : std::string_view();
}

bool single_number(DcmElement *element, uint32_t *value)
{
    Uint16 word = 0;
    Uint32 number = 0;
    if (!element)
        return false;
    if (element->ident() == EVR_US && element->getLength() == 2 && element->getUint16(word).good())
        *value = word;
    else if (element->ident() == EVR_UL && element->getLength() == 4 && element->getUint32(number).good())
        *value = number;
    else
        return false;
    return true;
}

} // namespace

CtsTopLevel::CtsTopLevel(DcmItem &item)
{
    for (DcmObject *o = item.nextInContainer(nullptr); o; o = item.nextInContainer(o))
        elements_.push_back(static_cast<DcmElement *>(o));
}

DcmElement *CtsTopLevel::find(const DcmTagKey &tag) const
{
    const auto at = std::lower_bound(elements_.begin(), elements_.end(), tag,
                                     [](const DcmElement *e, const DcmTagKey &t) { return e->getTag() < t; });
    return at != elements_.end() && (*at)->getTag() == tag ? *at : nullptr;
}

DcmItem *cts_first_item(DcmElement *sequence)
{
    return sequence && sequence->ident() == EVR_SQ ? static_cast<DcmSequenceOfItems *>(sequence)->getItem(0) : nullptr;
}

bool cts_is_text(DcmEVR vr)
{
    static const DcmEVR texts[] = {EVR_AE, EVR_AS, EVR_CS, EVR_DA, EVR_DS, EVR_DT, EVR_IS, EVR_LO,
                                   EVR_LT, EVR_PN, EVR_SH, EVR_ST, EVR_TM, EVR_UC, EVR_UI, EVR_UT};
    return std::find(std::begin(texts), std::end(texts), vr) != std::end(texts);
}

std::string_view cts_element_text(DcmElement *element)
{
    char *text = nullptr;
    Uint32 n = 0;
    if (!element || !cts_is_text(element->ident()) || element->getString(text, n).bad() || !text)
        return {};
    return {text, n};
}

bool cts_attribute_has(const CtsAttributes &item, const DcmTagKey &tag)
{
    /* NumberOfFrames is not an attribute of a single frame. */
    return !(item.is_frame && tag == DCM_NumberOfFrames) && find(item, tag);
}

std::string_view cts_attribute_text(CtsAttributes &item, const DcmTagKey &tag)
{
    DcmElement *const found = find(item, tag);
    const Place *const place = item.is_frame ? place_of(tag) : nullptr;
    uint32_t number = 0;
    if (place && place->is_number)
        return {item.digits, single_number(found, &number)
                                 ? static_cast<size_t>(std::snprintf(item.digits, sizeof item.digits, "%u", number))
                                 : 0};
    const std::string_view text = without_padding(cts_element_text(found));
    return item.is_frame && tag == DCM_AcquisitionTime ? time_of(text) : text;
}

bool cts_attribute_word(const CtsAttributes &item, const DcmTagKey &tag, int *value)
{
    uint32_t number = 0;
    DcmElement *const found = find(item, tag);
    if (!found || found->ident() != EVR_US || !single_number(found, &number))
        return false;
    *value = static_cast<int>(number);
    return true;
}

bool cts_attribute_number(const CtsAttributes &item, const DcmTagKey &tag, uint32_t *value)
{
    return single_number(find(item, tag), value);
}

bool cts_attribute_real(CtsAttributes &item, const DcmTagKey &tag, double *value)
{
    DcmElement *const found = find(item, tag);
    Float64 real = 0;
    if (found && found->ident() == EVR_FD && found->getLength() == 8 && found->getFloat64(real).good()) {
        *value = real;
        return std::isfinite(real);
    }
    Float32 single = 0;
    if (found && found->ident() == EVR_FL && found->getLength() == 4 && found->getFloat32(single).good()) {
        *value = static_cast<double>(single);
        return std::isfinite(single);
    }
    const std::string_view text = cts_attribute_text(item, tag);
    return !text.empty() && cts_parse_ds(text.data(), text.size(), value, 1);
}

bool cts_attribute_pattern(const CtsAttributes &item, const DcmTagKey &tag, unsigned *pattern)
{
    DcmElement *const found = find(item, tag);
    Uint16 word = 0, *words = nullptr;
    Sint16 value = 0;
    Uint8 *bytes = nullptr;
    if (!found || found->getLength() != 2)
        return false;
    if (found->getUint16(word).good())
        *pattern = word;
    else if (found->getSint16(value).good())
        *pattern = static_cast<Uint16>(value);
    else if (found->getUint16Array(words).good() && words)
        *pattern = words[0];
    else if (found->getUint8Array(bytes).good() && bytes)
        *pattern = bytes[0] | static_cast<unsigned>(bytes[1]) << 8;
    else
        return false;
    return true;
}
