#include "dicom/header/dcm_attributes.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>

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

bool is_one_of(const CtsElement &element, std::string_view vrs)
{
    for (size_t i = 0; i + 1 < vrs.size(); i += 2)
        if (std::memcmp(vrs.data() + i, element.vr, 2) == 0)
            return true;
    return element.vr[0] == 0; /* implicit: its tag's */
}

size_t length_of(const CtsElement &element)
{
    return static_cast<size_t>(element.value.end - element.value.at);
}

/* An unsigned number of 2 or 4 bytes. */
uint32_t number_of(const CtsElement &element)
{
    uint32_t value = 0;
    const size_t n = length_of(element);
    for (size_t i = 0; i < n; i++)
        value |= static_cast<uint32_t>(element.value.at[i]) << 8 * (element.value.big_endian ? n - 1 - i : i);
    return value;
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

bool find_scanned(const CtsDataSet &set, const DcmTagKey &tag, CtsElement *found)
{
    const uint32_t number = cts_tag_number(tag);
    for (int i = 0; i < set.scan->n_values; i++) {
        const CtsTagValue &value = set.scan->values[i];
        if (value.tag != number)
            continue;
        const uint8_t *const at = set.bytes + value.offset;
        *found = CtsElement{number,
                            {value.vr[0], value.vr[1]},
                            {at, at + value.n_bytes, set.native->explicit_vr, set.native->big_endian, false},
                            value.is_sequence};
        return true;
    }
    if (!cts_scan_notes(number))
        throw std::logic_error("a tag that the scan does not note");
    return false;
}

bool find(const CtsAttributes &item, const DcmTagKey &tag, CtsElement *found)
{
    const Place *const place = item.is_frame ? place_of(tag) : nullptr;
    if (!place)
        return find_scanned(item.set, tag, found);
    for (const CtsElements &group : item.groups)
        if (cts_elements_get(cts_elements_item(group, cts_tag_number(place->group)), cts_tag_number(place->tag), found))
            return true;
    /* Legacy objects may have it on top alone. */
    return tag == DCM_ImageType && find_scanned(item.set, tag, found);
}

} // namespace

bool cts_attribute_has(const CtsAttributes &item, const DcmTagKey &tag)
{
    CtsElement found;
    /* NumberOfFrames is not an attribute of a single frame. */
    return !(item.is_frame && tag == DCM_NumberOfFrames) && find(item, tag, &found);
}

std::string_view cts_attribute_text(CtsAttributes &item, const DcmTagKey &tag)
{
    CtsElement found;
    if (!find(item, tag, &found))
        return {};
    const size_t n = length_of(found);
    const Place *const place = item.is_frame ? place_of(tag) : nullptr;
    if (place && place->is_number)
        return {item.digits,
                (n == 2 || n == 4) && is_one_of(found, "USUL")
                    ? static_cast<size_t>(std::snprintf(item.digits, sizeof item.digits, "%u", number_of(found)))
                    : 0};
    if (found.undefined || !is_one_of(found, "AEASCSDADSDTISLOLTPNSHSTTMUCUIUT"))
        return {};
    const std::string_view text = without_padding({reinterpret_cast<const char *>(found.value.at), n});
    return item.is_frame && tag == DCM_AcquisitionTime ? time_of(text) : text;
}

bool cts_attribute_word(const CtsAttributes &item, const DcmTagKey &tag, int *value)
{
    CtsElement found;
    if (!find(item, tag, &found) || length_of(found) != 2 || !is_one_of(found, "US"))
        return false;
    *value = static_cast<int>(number_of(found));
    return true;
}

bool cts_attribute_number(const CtsAttributes &item, const DcmTagKey &tag, uint32_t *value)
{
    CtsElement found;
    if (!find(item, tag, &found) || (length_of(found) != 2 && length_of(found) != 4) || !is_one_of(found, "USUL"))
        return false;
    *value = number_of(found);
    return true;
}

bool cts_attribute_real(CtsAttributes &item, const DcmTagKey &tag, double *value)
{
    CtsElement found;
    if (!find(item, tag, &found))
        return false;
    if (is_one_of(found, "FD") && length_of(found) == 8) {
        uint64_t bits = 0;
        for (size_t i = 0; i < 8; i++)
            bits |= static_cast<uint64_t>(found.value.at[i]) << 8 * (found.value.big_endian ? 7 - i : i);
        std::memcpy(value, &bits, sizeof bits);
        return std::isfinite(*value);
    }
    if (is_one_of(found, "FL") && length_of(found) == 4) {
        const uint32_t bits = number_of(found);
        float single;
        std::memcpy(&single, &bits, sizeof bits);
        *value = static_cast<double>(single);
        return std::isfinite(*value);
    }
    const std::string_view text = cts_attribute_text(item, tag);
    return !text.empty() && cts_dcm_parse_ds(text.data(), text.size(), value, 1);
}

bool cts_attribute_pattern(const CtsAttributes &item, const DcmTagKey &tag, unsigned *pattern)
{
    CtsElement found;
    if (!find(item, tag, &found) || length_of(found) != 2 || !is_one_of(found, "USSSOWOBUN"))
        return false;
    *pattern = number_of(found);
    return true;
}
