/* Functional groups (PS3.3 C.7.6.16) -> one slice record a frame. */
#include <dcmtk/config/osconfig.h>

#include "input/header/dcm_door.hpp"
#include "input/header/dcm_parsed.hpp"
#include "input/header/dcm_read.h"

#include <cstdio>
#include <cstdlib>
#include <new>
#include <vector>

namespace
{

const int max_frames = 20000; /* what a series may have */

/* Where a frame says what a slice's header says. */
struct Place {
    DcmTagKey asked, group, tag;
};
const Place places[] = {
    {DCM_ImagePositionPatient, DCM_PlanePositionSequence, DCM_ImagePositionPatient},
    {DCM_ImageOrientationPatient, DCM_PlaneOrientationSequence, DCM_ImageOrientationPatient},
    {DCM_PixelSpacing, DCM_PixelMeasuresSequence, DCM_PixelSpacing},
    {DCM_RescaleSlope, DCM_PixelValueTransformationSequence, DCM_RescaleSlope},
    {DCM_RescaleIntercept, DCM_PixelValueTransformationSequence, DCM_RescaleIntercept},
    {DCM_RescaleType, DCM_PixelValueTransformationSequence, DCM_RescaleType},
    {DCM_ImageType, DCM_CTImageFrameTypeSequence, DCM_FrameType},
    {DCM_AcquisitionNumber, DCM_FrameContentSequence, DCM_FrameAcquisitionNumber},
    {DCM_AcquisitionTime, DCM_FrameContentSequence, DCM_FrameAcquisitionDateTime},
    {DCM_InstanceNumber, DCM_FrameContentSequence, DCM_InStackPositionNumber},
    {DCM_TemporalPositionIdentifier, DCM_FrameContentSequence, DCM_TemporalPositionIndex},
    {DCM_StackID, DCM_FrameContentSequence, DCM_StackID},
    {DCM_KVP, DCM_CTXRayDetailsSequence, DCM_KVP},
};

/* A date and time (YYYYMMDDHHMMSS.FFFFFF&ZZXX) without its date and zone. */
std::string_view time_of(std::string_view date_time)
{
    date_time = date_time.substr(0, date_time.find_first_of("+-"));
    return date_time.size() > 8 ? date_time.substr(8) : std::string_view();
}

/* The frame's own groups, then the shared ones, then the object itself. */
class FrameAttributes final : public CtsAttributes
{
  public:
    FrameAttributes(DcmItem &object, DcmItem *shared_groups, DcmItem *frame_groups)
        : whole(object), shared(shared_groups), own(frame_groups)
    {
    }
    bool has(const DcmTagKey &tag) override
    {
        /* How many frames there are is no question to one of them. */
        return tag != DCM_NumberOfFrames && (element_of(tag) || (!place_of(tag) && whole.has(tag)));
    }
    std::string_view text(const DcmTagKey &tag) override
    {
        if (!place_of(tag))
            return whole.text(tag);
        DcmElement *element = element_of(tag);
        char *value = nullptr;
        Uint32 n = 0, number = 0;
        if (element && element->ident() == EVR_UL && element->getUint32(number).good())
            return std::string_view(digits, static_cast<size_t>(std::snprintf(digits, sizeof digits, "%u", number)));
        if (!element && tag == DCM_ImageType) /* legacy objects may have it on top alone */
            return whole.text(tag);
        if (!element || element->getString(value, n).bad() || !value)
            return {};
        const std::string_view found(value, n);
        return tag == DCM_AcquisitionTime ? time_of(found) : found;
    }
    bool unsigned_short(const DcmTagKey &tag, int *value) override
    {
        return whole.unsigned_short(tag, value);
    }
    bool bit_pattern(const DcmTagKey &tag, unsigned *pattern) override
    {
        return whole.bit_pattern(tag, pattern);
    }

  private:
    static const Place *place_of(const DcmTagKey &tag)
    {
        for (const Place &p : places)
            if (p.asked == tag)
                return &p;
        return nullptr;
    }
    static DcmElement *in_group(DcmItem *groups, const Place &p)
    {
        DcmItem *group = nullptr;
        DcmElement *element = nullptr;
        if (!groups || groups->findAndGetSequenceItem(p.group, group).bad() ||
            group->findAndGetElement(p.tag, element).bad())
            return nullptr;
        return element;
    }
    DcmElement *element_of(const DcmTagKey &tag)
    {
        const Place *p = place_of(tag);
        DcmElement *element = p ? in_group(own, *p) : nullptr;
        return p && !element ? in_group(shared, *p) : element;
    }

    CtsParsedAttributes whole;
    DcmItem *shared, *own;
    char digits[12] = "";
};

CtsSlice *new_slice(std::vector<CtsSlice *> &slices)
{
    slices.push_back(nullptr);
    CtsSlice *slice = slices.back() = static_cast<CtsSlice *>(std::calloc(1, sizeof *slice));
    if (!slice) {
        slices.pop_back();
        throw std::bad_alloc();
    }
    slice->kind = CTS_OBJECT_ENHANCED;
    return slice;
}

/* One slice that stands for an object of which no frame can be used. */
void refuse(DcmItem &object, CtsTexts &texts, std::vector<CtsSlice *> &slices, const char *why)
{
    FrameAttributes attributes(object, nullptr, nullptr);
    CtsSlice *slice = new_slice(slices);
    cts_slice_fault(slice, CTS_ERR_PIXELS, "%s", why);
    cts_dcm_read_slice(attributes, texts, slice);
}

void read_frames(DcmItem &object, CtsTexts &texts, std::vector<CtsSlice *> &slices)
{
    Sint32 n_frames = 0;
    DcmItem *shared = nullptr;
    DcmSequenceOfItems *frames = nullptr;
    if (object.findAndGetSint32(DCM_NumberOfFrames, n_frames).bad() || n_frames < 1 || n_frames > max_frames)
        return refuse(object, texts, slices, "NumberOfFrames (0028,0008) is missing or not within 1 to 20000");
    if (object.findAndGetSequence(DCM_PerFrameFunctionalGroupsSequence, frames).bad() ||
        frames->card() != static_cast<unsigned long>(n_frames))
        return refuse(object, texts, slices,
                      "Per-frame Functional Groups (5200,9230) are missing, or not as many as there are frames");
    object.findAndGetSequenceItem(DCM_SharedFunctionalGroupsSequence, shared); /* without it, each frame says all */
    int k = 0;
    for (DcmObject *item = frames->nextInContainer(nullptr); item; item = frames->nextInContainer(item)) {
        FrameAttributes attributes(object, shared, dynamic_cast<DcmItem *>(item));
        CtsSlice *slice = new_slice(slices);
        slice->n_frames = n_frames;
        slice->frame = k++;
        cts_dcm_read_slice(attributes, texts, slice);
        slice->stack_id = cts_dcm_share(texts, cts_text_of(attributes, DCM_StackID), 16);
    }
}

} // namespace

CtsStatus cts_dcm_read_frames(const uint8_t *bytes, size_t n, const CtsSyntax *native, CtsTexts *texts,
                              CtsSlice ***frames, int *n_frames, CtsError *err)
{
    std::vector<CtsSlice *> slices;
    CtsStatus st = cts_dcm_start(err);
    try {
        const CtsDcmUse use(cts_dcm_in_use());
        DcmDataset data_set;
        const OFCondition result = st ? EC_Normal : cts_dcm_parse(data_set, bytes, n, native);
        if (result.bad())
            st = cts_fail(err, cts_dcm_status(result, CTS_ERR_READ), "cannot be parsed as DICOM: %s", result.text());
        else if (!st)
            read_frames(data_set, *texts, slices);
    } catch (...) {
        st = cts_dcm_caught(err, CTS_ERR_READ);
    }
    *n_frames = static_cast<int>(slices.size());
    *frames = st ? nullptr : static_cast<CtsSlice **>(std::malloc((slices.size() + 1) * sizeof **frames));
    if (!st && !*frames)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < slices.size(); i++)
        if (!st)
            (*frames)[i] = slices[i];
        else
            cts_slice_free(slices[i]);
    return st;
}
