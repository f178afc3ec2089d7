/* Volume Rendering Volumetric Presentation State (PS3.3 A.80.2): modules in the order of its table. */
#include "dicom/objects/records.h"

#include <string.h>

/* Series, equipment, frame of reference, identification. */
static void put_names(CtsRecords *to, const CtsDcmState *s)
{
    CTS_PUT_TEXTS(to, {DCM_SOPClassUID, CTS_STATE_CLASS}, {DCM_SOPInstanceUID, s->sop_uid},
                  {DCM_StudyInstanceUID, s->study_uid}, {DCM_SeriesInstanceUID, s->series_uid}, {DCM_Modality, "PR"},
                  {DCM_SeriesDescription, "ctsplat states"}, {DCM_SeriesDate, s->date}, {DCM_SeriesTime, s->time},
                  {DCM_Manufacturer, "ctsplat"}, {DCM_ManufacturerModelName, "ctsplat"}, {DCM_DeviceSerialNumber, "0"},
                  {DCM_SoftwareVersions, CTS_VERSION}, {DCM_FrameOfReferenceUID, s->frame_uid},
                  {DCM_PositionReferenceIndicator, ""}, {DCM_ContentLabel, "CTSPLAT"},
                  {DCM_ContentDescription, s->description}, {DCM_ContentCreatorName, "ctsplat"},
                  {DCM_PresentationCreationDate, s->date}, {DCM_PresentationCreationTime, s->time});
    CTS_PUT_NUMBERS(to, {DCM_SeriesNumber, s->series_number}, {DCM_InstanceNumber, 1});
    if (s->capture_uid[0])
        cts_put_item_end(
            to, cts_put_reference(to, DCM_RenderedImageReferenceSequence, s->capture_class_uid, s->capture_uid));
}

/* Begins a cropping method, with its number. */
static size_t put_crop(CtsRecords *to, int number, const char *method)
{
    const size_t crop = cts_put_item(to, DCM_VolumeCroppingSequence);
    CTS_PUT_TEXTS(to, {DCM_VolumeCroppingMethod, method});
    CTS_PUT_NUMBERS(to, {DCM_CroppingSpecificationNumber, number});
    return crop;
}

/* The segments of one cropping method, by segmentation: where there are any, a method with the next number. */
static void put_segments(CtsRecords *to, const CtsDcmState *s, CtsLabelCrop way, int *n_crops)
{
    size_t crop = 0;
    for (size_t o = 0; s->labels && o < s->labels->n_objects; o++) {
        const CtsLabelObject *const object = &s->labels->objects[o];
        size_t image = 0, numbers = 0;
        for (size_t i = 0; i < s->labels->n; i++) {
            const double number = s->labels->items[i].fact.number;
            if (s->label_crop[i] != way || s->labels->items[i].object != o + 1)
                continue;
            if (!crop)
                crop = put_crop(to, ++*n_crops, way == CTS_CROP_INCLUDE ? "INCLUDE_SEG" : "EXCLUDE_SEG");
            if (!image) {
                image = cts_put_reference(to, DCM_ReferencedImageSequence, object->class_uid, object->sop_uid);
                numbers = cts_put_begin(to, DCM_ReferencedSegmentNumber, CTS_VALUE_NUMBERS);
            }
            cts_put_more(to, &number, sizeof number);
        }
        if (image) {
            cts_put_end(to, numbers);
            cts_put_item_end(to, image);
        }
    }
    if (crop)
        cts_put_item_end(to, crop);
}

/* The box, and the segments, that are kept (PS3.3 C.11.24). */
static void put_crops(CtsRecords *to, const CtsDcmState *s)
{
    static const double numbers[] = {1, 2, 3};
    int n = 0;
    if (s->cropped) {
        const size_t crop = put_crop(to, ++n, "BOUNDING_BOX");
        cts_put_numbers(to, DCM_BoundingBoxCrop, s->crop_lps, 6);
        cts_put_item_end(to, crop);
    }
    put_segments(to, s, CTS_CROP_INCLUDE, &n);
    put_segments(to, s, CTS_CROP_EXCLUDE, &n);
    CTS_PUT_TEXTS(to, {DCM_GlobalCrop, n ? "YES" : "NO"});
    if (n)
        cts_put_numbers(to, DCM_GlobalCroppingSpecificationIndex, numbers, (size_t)n);
}

/* The volume, its window, the crop box, and a list of all referenced instances. */
static void put_input(CtsRecords *to, const CtsDcmState *s)
{
    const size_t set = cts_put_item(to, DCM_VolumetricPresentationInputSetSequence);
    CTS_PUT_TEXTS(to, {DCM_VolumetricPresentationInputSetUID, s->input_uid}, {DCM_PresentationInputType, "VOLUME"});
    cts_put_sources(to, DCM_ReferencedImageSequence, s->source, NULL);
    cts_put_item_end(to, set);
    const size_t input = cts_put_item(to, DCM_VolumetricPresentationStateInputSequence);
    CTS_PUT_TEXTS(to, {DCM_VolumetricPresentationInputSetUID, s->input_uid}, {DCM_VOILUTFunction, "LINEAR_EXACT"},
                  {DCM_Crop, "NO"});
    CTS_PUT_NUMBERS(to, {DCM_VolumetricPresentationInputNumber, 1}, {DCM_WindowCenter, s->window_centre_hu},
                    {DCM_WindowWidth, s->window_width_hu});
    cts_put_item_end(to, input);
    put_crops(to, s);
    cts_put_source_series(to, s->source);
    cts_put_label_series(to, s->labels, s->study_uid);
}

static void put_view(CtsRecords *to, const CtsDcmState *s)
{
    cts_put_code(to, DCM_ViewCodeSequence, s->view);
    CTS_PUT_TEXTS(to, {DCM_RenderProjection, "ORTHOGRAPHIC"});
    cts_put_numbers(to, DCM_ViewpointPosition, s->viewpoint_lps, 3);
    cts_put_numbers(to, DCM_ViewpointLookAtPoint, s->look_at_lps, 3);
    cts_put_numbers(to, DCM_ViewpointUpDirection, s->up_lps, 3);
    cts_put_numbers(to, DCM_RenderFieldOfView, s->field_mm, 6);
    CTS_PUT_TEXTS(to, {DCM_RenderingMethod, s->method});
    if (!s->shaded)
        return;
    CTS_PUT_TEXTS(to, {DCM_ShadingStyle, "DOUBLESIDED"});
    CTS_PUT_NUMBERS(to, {DCM_AmbientReflectionIntensity, s->ambient});
    cts_put_numbers(to, DCM_LightDirection, s->forward_lps, 3);
    CTS_PUT_NUMBERS(to, {DCM_DiffuseReflectionIntensity, s->diffuse}, {DCM_SpecularReflectionIntensity, s->specular},
                    {DCM_Shininess, s->shininess});
}

static void put_display(CtsRecords *to, const CtsDcmState *s)
{
    static const struct {
        uint32_t descriptor, data;
    } tables[] = {{DCM_RedPaletteColorLookupTableDescriptor, DCM_RedPaletteColorLookupTableData},
                  {DCM_GreenPaletteColorLookupTableDescriptor, DCM_GreenPaletteColorLookupTableData},
                  {DCM_BluePaletteColorLookupTableDescriptor, DCM_BluePaletteColorLookupTableData},
                  {DCM_AlphaPaletteColorLookupTableDescriptor, DCM_AlphaPaletteColorLookupTableData}};
    CTS_PUT_TEXTS(to, {DCM_PixelPresentation, "TRUE_COLOR"});
    const size_t stream = cts_put_item(to, DCM_VolumeStreamSequence);
    CTS_PUT_TEXTS(to, {DCM_VolumetricPresentationInputSetUID, s->input_uid});
    const size_t component = cts_put_item(to, DCM_PresentationStateClassificationComponentSequence);
    CTS_PUT_TEXTS(to, {DCM_RGBATransferFunctionDescription, s->description}, {DCM_ComponentType, "ONE_TO_RGBA"});
    const size_t input = cts_put_item(to, DCM_ComponentInputSequence);
    CTS_PUT_NUMBERS(to, {DCM_VolumetricPresentationInputIndex, 1});
    cts_put_item_end(to, input);
    CTS_PUT_TEXTS(to, {DCM_RGBLUTTransferFunction, "TABLE"}, {DCM_AlphaLUTTransferFunction, "TABLE"});
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++) {
        cts_put_numbers(to, tables[i].descriptor, (double[]){CTS_STATE_ENTRIES, 0, 16}, 3);
        cts_put_bytes(to, tables[i].data, CTS_VALUE_BYTES, s->tables[i], sizeof s->tables[i]);
    }
    cts_put_item_end(to, component);
    cts_put_item_end(to, stream);
    cts_put_profile(to);
}

/* A private text as bytes of an even number. */
static void put_private(CtsRecords *to, uint32_t number, const char *text)
{
    const size_t n = strlen(text), value = cts_put_begin(to, CTS_STATE_GROUP << 16 | number, CTS_VALUE_BYTES);
    cts_put_more(to, text, n);
    cts_put_more(to, "\n", n % 2);
    cts_put_end(to, value);
}

CtsStatus cts_dcm_state_write(const CtsDcmState *state, CtsTempFile *file, CtsError *err)
{
    CtsRecords to = {0};
    const CtsReaderOrder order = {.syntax_number = cts_syntax_number(cts_syntax_native(true, false))};
    put_names(&to, state);
    put_input(&to, state);
    put_view(&to, state);
    put_display(&to, state);
    CTS_PUT_TEXTS(&to, {CTS_STATE_GROUP << 16 | CTS_STATE_CREATOR, CTS_STATE_BLOCK});
    put_private(&to, CTS_STATE_PRESET, state->preset);
    put_private(&to, CTS_STATE_OPTIONS, state->options);
    return cts_records_write(&to, order, state->source->slices[0], file, err);
}
