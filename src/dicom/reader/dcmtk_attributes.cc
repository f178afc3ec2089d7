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
    {DCM_ImageType, DCM_MRImageFrameTypeSequence, DCM_FrameType},
    {DCM_ImageType, DCM_PETFrameTypeSequence, DCM_FrameType},
    {DCM_ComplexImageComponent, DCM_MRImageFrameTypeSequence, DCM_ComplexImageComponent},
    {DCM_EchoTime, DCM_MREchoSequence, DCM_EffectiveEchoTime},
    {DCM_InversionTime, DCM_MRModifierSequence, DCM_InversionTimes},
    {DCM_FlipAngle, DCM_MRTimingAndRelatedParametersSequence, DCM_FlipAngle},
    {DCM_DiffusionBValue, DCM_MRDiffusionSequence, DCM_DiffusionBValue},
    {DCM_FrameReferenceDateTime, DCM_FrameContentSequence, DCM_FrameReferenceDateTime},
    {DCM_FrameAcquisitionDateTime, DCM_FrameContentSequence, DCM_FrameAcquisitionDateTime},
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

/* An element of the items in which legacy objects keep other attributes of their slices (PS3.3 C.7.6.16.2.25). */
DcmElement *find_unassigned(const CtsAttributes &item, const DcmTagKey &tag)
{
    const DcmTagKey sequences[] = {DCM_UnassignedPerFrameConvertedAttributesSequence,
                                   DCM_UnassignedSharedConvertedAttributesSequence};
    for (int i = 0; i < 2; i++)
        if (DcmElement *const found = find_in(cts_first_item(find_in(item.groups[i], sequences[i])), tag))
            return found;
    return nullptr;
}

DcmElement *find(const CtsAttributes &item, const DcmTagKey &tag)
{
    bool has_place = false;
    if (item.is_item)
        return find_in(item.groups[0], tag);
    for (const Place &place : places) {
        if (!item.is_frame || place.asked != tag)
            continue;
        has_place = true;
        for (DcmItem *group : item.groups)
            if (DcmElement *const found = find_in(cts_first_item(find_in(group, place.group)), place.tag))
                return found;
    }
    DcmElement *const unassigned = item.is_frame ? find_unassigned(item, tag) : nullptr;
    /* Legacy objects may have the ImageType on top alone. */
    return unassigned || (has_place && tag != DCM_ImageType) ? unassigned : item.top.find(tag);
}

/* A date and time (YYYYMMDDHHMMSS.FFFFFF&ZZXX) without its date and zone. */
std::string_view time_of(std::string_view date_time)
{
    date_time = date_time.substr(0, date_time.find_first_of("+-"));
    return date_time.size() > 8 ? date_time.substr(8) : std::string_view();
}

template <typename Number>
bool numbers(DcmElement &e, OFCondition (DcmElement::*get)(Number &, unsigned long), std::vector<double> &values)
{
    Number value;
    const unsigned long n = e.getLength() / sizeof value;
    for (unsigned long i = 0; i < n && (e.*get)(value, i).good(); i++)
        values.push_back(value);
    return values.size() == n;
}

/* The number of an element that has one, of one of two VRs. */
bool single_number(DcmElement *element, DcmEVR vr, DcmEVR or_vr, double *value)
{
    std::vector<double> all;
    if (!element || (element->ident() != vr && element->ident() != or_vr) || !cts_binary_numbers(*element, all) ||
        all.size() != 1)
        return false;
    *value = all[0];
    return true;
}

/* A text, or a value of unknown VR as one. */
std::string_view raw_text(DcmElement *element)
{
    Uint8 *bytes = nullptr;
    if (element && !cts_is_text(element->ident()) && element->getUint8Array(bytes).good() && bytes)
        return {reinterpret_cast<const char *>(bytes), element->getLength()};
    return cts_element_text(element);
}

int numbers_of_text(std::string_view text, double *values, int n)
{
    int count = 0;
    for (std::string_view one; count < n && !(one = cts_text_value(text, count)).empty(); count++)
        if (!cts_parse_ds(one.data(), one.size(), values + count, 1))
            return 0;
    return count;
}

/* Of unknown VR: text where all of its characters are a decimal string's, else FL or FD. */
int numbers_of_bytes(std::string_view bytes, double *values, int n)
{
    const size_t size = bytes.size() % 8 ? 4 : 8, longest = 256; /* more than 16 decimal strings are no such value */
    const bool is_zero = bytes.find_first_not_of('\0') == std::string_view::npos;
    if (bytes.size() > longest)
        return 0;
    const std::string_view text = cts_without_padding(bytes);
    if (!is_zero && text.find_first_not_of("0123456789+-.eE\\ ") == std::string_view::npos)
        return numbers_of_text(text, values, n);
    const size_t count = bytes.size() / size;
    if (bytes.size() % size || count > static_cast<size_t>(n))
        return 0;
    for (size_t k = 0; k < count; k++) {
        float single = 0;
        std::memcpy(size == 8 ? static_cast<void *>(values + k) : &single, bytes.data() + k * size, size);
        values[k] = size == 8 ? values[k] : static_cast<double>(single);
        if (!std::isfinite(values[k]))
            return 0;
    }
    return static_cast<int>(count);
}

int numbers_of(DcmElement *element, double *values, int n)
{
    std::vector<double> all;
    if (!element)
        return 0;
    if (cts_is_text(element->ident()))
        return numbers_of_text(cts_without_padding(cts_element_text(element)), values, n);
    if (!cts_binary_numbers(*element, all))
        return numbers_of_bytes(raw_text(element), values, n);
    all.resize(std::min(all.size(), static_cast<size_t>(n)));
    std::copy(all.begin(), all.end(), values);
    const bool finite = std::all_of(all.begin(), all.end(), [](double x) { return std::isfinite(x); });
    return finite ? static_cast<int>(all.size()) : 0;
}

DcmElement *find_private(const CtsAttributes &item, const CtsPrivateTag &tag)
{
    for (unsigned block = 0x10; block <= 0xFF; block++) {
        DcmElement *const creator = item.top.find(DcmTagKey(tag.group, static_cast<Uint16>(block)));
        if (creator && cts_without_padding(raw_text(creator)) == tag.creator)
            return item.top.find(DcmTagKey(tag.group, static_cast<Uint16>(block << 8 | tag.nn)));
    }
    return nullptr;
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
    return DcmVR(vr).isaString();
}

bool cts_binary_numbers(DcmElement &e, std::vector<double> &values)
{
    switch (e.ident()) {
    case EVR_US:
        return numbers<Uint16>(e, &DcmElement::getUint16, values);
    case EVR_SS:
        return numbers<Sint16>(e, &DcmElement::getSint16, values);
    case EVR_UL:
        return numbers<Uint32>(e, &DcmElement::getUint32, values);
    case EVR_SL:
        return numbers<Sint32>(e, &DcmElement::getSint32, values);
    case EVR_FL:
        return numbers<Float32>(e, &DcmElement::getFloat32, values);
    case EVR_FD:
        return numbers<Float64>(e, &DcmElement::getFloat64, values);
    default:
        return false;
    }
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
    double number = 0;
    if (place && place->is_number)
        return {item.digits, single_number(found, EVR_US, EVR_UL, &number)
                                 ? static_cast<size_t>(std::snprintf(item.digits, sizeof item.digits, "%.0f", number))
                                 : 0};
    const std::string_view text = cts_without_padding(cts_element_text(found));
    return item.is_frame && tag == DCM_AcquisitionTime ? time_of(text) : text;
}

bool cts_attribute_decimals(CtsAttributes &item, const DcmTagKey &tag, double *values, int n)
{
    const std::string_view text = cts_attribute_text(item, tag);
    return cts_parse_ds(text.data(), text.size(), values, n);
}

double cts_attribute_number_or_nan(const CtsAttributes &item, const DcmTagKey &tag)
{
    double value;
    return numbers_of(find(item, tag), &value, 1) ? value : NAN;
}

int cts_attribute_numbers(const CtsAttributes &item, const DcmTagKey &tag, double *values, int n)
{
    return numbers_of(find(item, tag), values, n);
}

CtsAttributes cts_attribute_item(const CtsAttributes &item, const DcmTagKey &sequence)
{
    DcmItem *first = nullptr;
    for (int i = 0; (item.is_frame || item.is_item) && !first && i < 2; i++)
        first = cts_first_item(find_in(item.groups[i], sequence));
    if (!first && !item.is_item)
        first = cts_first_item(find(item, sequence));
    return CtsAttributes{item.top, false, {first}, true};
}

std::string_view cts_private_text(const CtsAttributes &item, const CtsPrivateTag &tag)
{
    return cts_without_padding(raw_text(find_private(item, tag)));
}

int cts_private_numbers(const CtsAttributes &item, const CtsPrivateTag &tag, double *values, int n)
{
    return numbers_of(find_private(item, tag), values, n);
}

std::string_view cts_text_value(std::string_view text, int n)
{
    for (; n > 0; n--) {
        const size_t end = text.find('\\');
        if (end == std::string_view::npos)
            return {};
        text.remove_prefix(end + 1);
    }
    return cts_without_padding(text.substr(0, text.find('\\')));
}

bool cts_attribute_word(const CtsAttributes &item, const DcmTagKey &tag, int *value)
{
    double number = 0;
    if (!single_number(find(item, tag), EVR_US, EVR_US, &number))
        return false;
    *value = static_cast<int>(number);
    return true;
}

bool cts_attribute_pattern(const CtsAttributes &item, const DcmTagKey &tag, unsigned *pattern)
{
    DcmElement *const found = find(item, tag);
    Uint16 word = 0;
    const bool has = found && found->getLength() == sizeof word && found->getPartialValue(&word, 0, sizeof word).good();
    *pattern = has ? word : *pattern;
    return has;
}
