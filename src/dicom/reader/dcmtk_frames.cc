/* Functional groups (PS3.3 C.7.6.16) -> one slice record a frame. */
#include "dicom/reader/dcmtk_attributes.hpp"

#include <cstdint>
#include <new>

namespace
{

/* One faulty slice in place of an object without a usable frame. */
void refuse(const CtsTopLevel &top, CtsStringPool &texts, CtsObject *object, const char *why)
{
    CtsAttributes attributes{top, true};
    CtsSlice *slice = cts_dcm_add_slice(object);
    cts_slice_fault(slice, CTS_ERR_PIXELS, "%s", why);
    cts_dcm_read_slice(attributes, texts, slice);
}

} // namespace

CtsSlice *cts_dcm_add_slice(CtsObject *object)
{
    CtsSlice *const slice = cts_object_add_slice(object, nullptr);
    if (!slice)
        throw std::bad_alloc();
    return slice;
}

void cts_dcm_read_frames(const CtsTopLevel &top, CtsStringPool &texts, CtsObject *object)
{
    DcmElement *const frames = top.find(DCM_PerFrameFunctionalGroupsSequence);
    DcmItem *const shared = cts_first_item(top.find(DCM_SharedFunctionalGroupsSequence));
    auto *const sequence = frames && frames->ident() == EVR_SQ ? static_cast<DcmSequenceOfItems *>(frames) : nullptr;
    int n_frames = 0;
    CtsAttributes object_alone{top};
    const std::string_view text = cts_attribute_text(object_alone, DCM_NumberOfFrames);
    if (!cts_parse_is(text.data(), text.size(), &n_frames) || n_frames < 1 || n_frames > CTS_MAX_FRAMES)
        return refuse(top, texts, object, "NumberOfFrames (0028,0008) is missing or not within 1 to 20000");
    if (!sequence || sequence->card() != static_cast<unsigned long>(n_frames))
        return refuse(top, texts, object,
                      "Per-frame Functional Groups (5200,9230) are missing, or not as many as there are frames");
    const auto whole = [&](const DcmTagKey &tag, double most, int64_t otherwise) {
        const double number = cts_attribute_number_or_nan(object_alone, tag);
        return number >= 0 && number <= most ? static_cast<int64_t>(number) : otherwise;
    };
    const int64_t number = whole(DCM_InConcatenationNumber, UINT16_MAX, 0),
                  n_parts = whole(DCM_InConcatenationTotalNumber, UINT16_MAX, 0),
                  first = whole(DCM_ConcatenationFrameOffsetNumber, UINT32_MAX, -1);
    const char *concatenation = cts_dcm_share(texts, cts_attribute_text(object_alone, DCM_ConcatenationUID), 64);
    for (DcmObject *frame = sequence->nextInContainer(nullptr); frame; frame = sequence->nextInContainer(frame)) {
        CtsAttributes attributes{top, true, {static_cast<DcmItem *>(frame), shared}};
        CtsSlice *slice = cts_dcm_add_slice(object);
        slice->n_frames = n_frames;
        slice->frame = object->n_slices - 1;
        cts_dcm_read_slice(attributes, texts, slice);
        slice->concatenation = concatenation;
        slice->part_number = static_cast<int>(number);
        slice->n_parts = static_cast<int>(n_parts);
        slice->first_frame = first;
        slice->stack_id = cts_dcm_share(texts, cts_attribute_text(attributes, DCM_StackID), 16);
    }
}
