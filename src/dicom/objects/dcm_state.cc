/* Volume Rendering Volumetric Presentation State (PS3.3 A.80.2): modules in the order of its table. */
#include <dcmtk/config/osconfig.h>

#include "dicom/objects/objects.h"

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"
#include "dicom/objects/dcm_put.hpp"
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

namespace
{

/* Series, equipment, frame of reference, identification. */
void put_names(Put &put, const CtsDcmState &s)
{
    put.text(DCM_SOPClassUID, UID_VolumeRenderingVolumetricPresentationStateStorage)
        .text(DCM_SOPInstanceUID, s.sop_uid);
    put.text(DCM_StudyInstanceUID, s.study_uid).text(DCM_SeriesInstanceUID, s.series_uid).text(DCM_Modality, "PR");
    put.number(DCM_SeriesNumber, s.series_number).text(DCM_SeriesDescription, "ctsplat states");
    put.text(DCM_SeriesDate, s.date).text(DCM_SeriesTime, s.time);
    put.text(DCM_Manufacturer, "ctsplat").text(DCM_ManufacturerModelName, "ctsplat");
    put.text(DCM_DeviceSerialNumber, "0").text(DCM_SoftwareVersions, CTS_VERSION);
    put.text(DCM_FrameOfReferenceUID, s.frame_uid).text(DCM_PositionReferenceIndicator, "");
    put.number(DCM_InstanceNumber, 1).text(DCM_ContentLabel, "CTSPLAT").text(DCM_ContentDescription, s.description);
    put.text(DCM_ContentCreatorName, "ctsplat").text(DCM_PresentationCreationDate, s.date);
    put.text(DCM_PresentationCreationTime, s.time);
    if (s.capture_uid[0])
        put.reference(DCM_RenderedImageReferenceSequence, s.capture_class_uid, s.capture_uid);
}

/* Adds a cropping method, with its number. */
template <typename Fill> void put_crop(Put &put, std::vector<Uint16> &numbers, const char *method, Fill fill)
{
    if (DcmItem *item = put.item(DCM_VolumeCroppingSequence)) {
        Put crop(*item);
        numbers.push_back(static_cast<Uint16>(numbers.size() + 1));
        crop.word(DCM_CroppingSpecificationNumber, numbers.back()).text(DCM_VolumeCroppingMethod, method);
        fill(crop);
        put.keep(crop.state());
    }
}

/* Adds the segments of one cropping method, by segmentation; false where there are none. */
bool put_segments(Put *put, const CtsDcmState &s, CtsLabelCrop way)
{
    bool any = false;
    for (size_t o = 0; s.labels && o < s.labels->n_objects; o++) {
        std::vector<Uint16> segments;
        for (size_t i = 0; i < s.labels->n; i++)
            if (s.label_crop[i] == way && s.labels->items[i].object == o + 1)
                segments.push_back(static_cast<Uint16>(s.labels->items[i].fact.number));
        any |= !segments.empty();
        if (!put || segments.empty())
            continue;
        const CtsLabelObject &object = s.labels->objects[o];
        if (DcmItem *item = put->reference(DCM_ReferencedImageSequence, object.class_uid, object.sop_uid))
            put->keep(Put(*item).words(DCM_ReferencedSegmentNumber, segments).state());
    }
    return any;
}

/* The box, and the segments, that are kept (PS3.3 C.11.24). */
void put_crops(Put &put, const CtsDcmState &s)
{
    std::vector<Uint16> numbers;
    if (s.cropped)
        put_crop(put, numbers, "BOUNDING_BOX", [&](Put &crop) { crop.doubles(DCM_BoundingBoxCrop, s.crop_lps, 6); });
    for (const CtsLabelCrop way : {CTS_CROP_INCLUDE, CTS_CROP_EXCLUDE})
        if (put_segments(nullptr, s, way))
            put_crop(put, numbers, way == CTS_CROP_INCLUDE ? "INCLUDE_SEG" : "EXCLUDE_SEG",
                     [&](Put &crop) { put_segments(&crop, s, way); });
    put.text(DCM_GlobalCrop, numbers.empty() ? "NO" : "YES");
    if (!numbers.empty())
        put.words(DCM_GlobalCroppingSpecificationIndex, numbers);
}

/* The volume, its window, the crop box, and a list of all referenced instances. */
void put_input(Put &put, const CtsDcmState &s)
{
    if (DcmItem *item = put.item(DCM_VolumetricPresentationInputSetSequence)) {
        Put set(*item);
        set.text(DCM_VolumetricPresentationInputSetUID, s.input_uid).text(DCM_PresentationInputType, "VOLUME");
        cts_dcm_each_instance(*s.source, [&](const char *uid) {
            set.reference(DCM_ReferencedImageSequence, s.source->slices[0]->class_uid, uid);
        });
        put.keep(set.state());
    }
    if (DcmItem *item = put.item(DCM_VolumetricPresentationStateInputSequence)) {
        Put input(*item);
        input.word(DCM_VolumetricPresentationInputNumber, 1).text(DCM_VolumetricPresentationInputSetUID, s.input_uid);
        input.decimals(DCM_WindowCenter, &s.window_centre_hu, 1).decimals(DCM_WindowWidth, &s.window_width_hu, 1);
        input.text(DCM_VOILUTFunction, "LINEAR_EXACT").text(DCM_Crop, "NO");
        put.keep(input.state());
    }
    put_crops(put, s);
    if (DcmItem *item = put.item(DCM_ReferencedSeriesSequence)) {
        Put series(*item);
        series.text(DCM_SeriesInstanceUID, s.source->uid);
        cts_dcm_each_instance(*s.source, [&](const char *uid) {
            series.reference(DCM_ReferencedInstanceSequence, s.source->slices[0]->class_uid, uid);
        });
        put.keep(series.state());
    }
    if (s.labels)
        cts_dcm_put_label_series(put, *s.labels, s.study_uid);
}

void put_view(Put &put, const CtsDcmState &s)
{
    put.code(DCM_ViewCodeSequence, s.view).text(DCM_RenderProjection, "ORTHOGRAPHIC");
    put.doubles(DCM_ViewpointPosition, s.viewpoint_lps, 3).doubles(DCM_ViewpointLookAtPoint, s.look_at_lps, 3);
    put.doubles(DCM_ViewpointUpDirection, s.up_lps, 3).doubles(DCM_RenderFieldOfView, s.field_mm, 6);
    put.text(DCM_RenderingMethod, s.method);
    if (!s.shaded)
        return;
    put.text(DCM_ShadingStyle, "DOUBLESIDED").doubles(DCM_AmbientReflectionIntensity, &s.ambient, 1);
    put.doubles(DCM_LightDirection, s.forward_lps, 3).doubles(DCM_DiffuseReflectionIntensity, &s.diffuse, 1);
    put.doubles(DCM_SpecularReflectionIntensity, &s.specular, 1).doubles(DCM_Shininess, &s.shininess, 1);
}

void put_table(Put &put, const DcmTagKey &descriptor, const DcmTagKey &data, const uint16_t *table)
{
    const Uint16 values[3] = {CTS_STATE_ENTRIES, 0, 16};
    std::unique_ptr<DcmUnsignedShort> described(new DcmUnsignedShort(DcmTag(descriptor, EVR_US)));
    std::unique_ptr<DcmOtherByteOtherWord> entries(new DcmOtherByteOtherWord(DcmTag(data, EVR_OW)));
    put.keep(described->putUint16Array(values, 3)).keep(entries->putUint16Array(table, CTS_STATE_ENTRIES));
    put.element(described.release()).element(entries.release());
}

void put_display(Put &put, const CtsDcmState &s)
{
    put.text(DCM_PixelPresentation, "TRUE_COLOR");
    if (DcmItem *stream_item = put.item(DCM_VolumeStreamSequence)) {
        Put stream(*stream_item);
        stream.text(DCM_VolumetricPresentationInputSetUID, s.input_uid);
        if (DcmItem *item = stream.item(DCM_PresentationStateClassificationComponentSequence)) {
            Put component(*item);
            component.text(DCM_RGBATransferFunctionDescription, s.description).text(DCM_ComponentType, "ONE_TO_RGBA");
            if (DcmItem *input = component.item(DCM_ComponentInputSequence))
                component.keep(Put(*input).word(DCM_VolumetricPresentationInputIndex, 1).state());
            component.text(DCM_RGBLUTTransferFunction, "TABLE").text(DCM_AlphaLUTTransferFunction, "TABLE");
            put_table(component, DCM_RedPaletteColorLookupTableDescriptor, DCM_RedPaletteColorLookupTableData,
                      s.tables[0]);
            put_table(component, DCM_GreenPaletteColorLookupTableDescriptor, DCM_GreenPaletteColorLookupTableData,
                      s.tables[1]);
            put_table(component, DCM_BluePaletteColorLookupTableDescriptor, DCM_BluePaletteColorLookupTableData,
                      s.tables[2]);
            put_table(component, DCM_AlphaPaletteColorLookupTableDescriptor, DCM_AlphaPaletteColorLookupTableData,
                      s.tables[3]);
            stream.keep(component.state());
        }
        put.keep(stream.state());
    }
    cts_dcm_put_profile(put, DCM_ICCProfile).text(DCM_ColorSpace, "SRGB");
}

void put_private(Put &put, uint16_t number, const char *text)
{
    DcmTag tag(CTS_STATE_GROUP, number, EVR_OB);
    tag.setPrivateCreator(CTS_STATE_BLOCK);
    std::vector<Uint8> bytes(text, text + strlen(text));
    if (bytes.size() % 2)
        bytes.push_back('\n');
    std::unique_ptr<DcmOtherByteOtherWord> element(new DcmOtherByteOtherWord(tag));
    put.keep(element->putUint8Array(bytes.data(), static_cast<unsigned long>(bytes.size())));
    put.element(element.release());
}

CtsStatus write_state(const CtsDcmState &s, CtsScSink sink, void *context, CtsError *err)
{
    DcmFileFormat file;
    DcmDataset source;
    CtsStatus st = cts_dcm_start(err);
    if (st || (st = cts_dcm_load(source, *s.header, err)))
        return st;
    Put put(*file.getDataset());
    cts_dcm_put_study(put, source, nullptr);
    put_names(put, s);
    put_input(put, s);
    put_view(put, s);
    put_display(put, s);
    put.keep(
        file.getDataset()->putAndInsertString(DcmTag(CTS_STATE_GROUP, CTS_STATE_CREATOR, EVR_LO), CTS_STATE_BLOCK));
    put_private(put, CTS_STATE_PRESET, s.preset);
    put_private(put, CTS_STATE_OPTIONS, s.options);
    if (put.state().bad())
        return cts_fail(err, cts_dcm_status(put.state(), CTS_ERR_OUTPUT),
                        "the presentation state cannot be encoded: %s", put.state().text());
    return cts_dcm_stream(file, EXS_LittleEndianExplicit, sink, context, err);
}

} // namespace

extern "C" CtsStatus cts_dcm_state_write(const CtsDcmState *state, CtsScSink sink, void *context, CtsError *err)
{
    return cts_dcm_guarded(err, CTS_ERR_OUTPUT, [&] { return write_state(*state, sink, context, err); });
}
