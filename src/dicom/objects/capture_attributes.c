/* Secondary captures as attributes (PS3.3 A.8.1, A.8.4 and A.8.5). */
#include "dicom/objects/records.h"

#include <stdio.h>

enum { FRAME_MS = 100 }; /* 36 frames of a rotation last 3.6 s */

static const char *class_uid(const CtsScObject *object)
{
    if (object->n_frames == 1)
        return "1.2.840.10008.5.1.4.1.1.7";
    return object->grey ? "1.2.840.10008.5.1.4.1.1.7.3" : "1.2.840.10008.5.1.4.1.1.7.4";
}

static void put_series_and_equipment(CtsRecords *to, const CtsScObject *object)
{
    CTS_PUT_TEXTS(to, {DCM_StudyInstanceUID, object->names->study_uid},
                  {DCM_SeriesInstanceUID, object->names->series_uid}, {DCM_SOPInstanceUID, object->names->sop_uid},
                  {DCM_SOPClassUID, class_uid(object)},
                  {DCM_Modality, object->source->modality[0] ? object->source->modality : "CT"},
                  {DCM_SeriesDescription, object->texts->series_description}, {DCM_ConversionType, "WSD"});
    CTS_PUT_NUMBERS(to, {DCM_SeriesNumber, object->names->series_number},
                    {DCM_InstanceNumber, object->names->instance_number});
    /* SeriesDate and SeriesTime would have to be those of views that were made before. */
    if (*object->date)
        CTS_PUT_TEXTS(to, {DCM_InstanceCreationDate, object->date}, {DCM_ContentDate, object->date},
                      {DCM_DateOfSecondaryCapture, object->date});
    if (*object->time)
        CTS_PUT_TEXTS(to, {DCM_InstanceCreationTime, object->time}, {DCM_ContentTime, object->time},
                      {DCM_TimeOfSecondaryCapture, object->time});
    CTS_PUT_TEXTS(to, {DCM_Manufacturer, "ctsplat"}, {DCM_ManufacturerModelName, "ctsplat"},
                  {DCM_SecondaryCaptureDeviceManufacturer, "ctsplat"},
                  {DCM_SecondaryCaptureDeviceManufacturerModelName, "ctsplat"}, {DCM_SoftwareVersions, CTS_VERSION},
                  {DCM_SecondaryCaptureDeviceSoftwareVersions, CTS_VERSION}, {DCM_DeviceSerialNumber, "0"});
}

/* Once lossy, always lossy. */
static void put_lossy(CtsRecords *to, const CtsSlice *lossy)
{
    CTS_PUT_TEXTS(to, {DCM_LossyImageCompression, lossy ? "01" : "00"});
    if (lossy && *lossy->lossy_ratio)
        CTS_PUT_TEXTS(to, {DCM_LossyImageCompressionRatio, lossy->lossy_ratio});
    if (lossy && *lossy->lossy_method)
        CTS_PUT_TEXTS(to, {DCM_LossyImageCompressionMethod, lossy->lossy_method});
}

static void put_image(CtsRecords *to, const CtsScObject *object)
{
    char image_type[64];
    snprintf(image_type, sizeof image_type, "DERIVED\\SECONDARY\\%s", object->texts->image_type);
    CTS_PUT_TEXTS(to, {DCM_ImageType, image_type}, {DCM_PatientOrientation, object->texts->patient_orientation},
                  {DCM_DerivationDescription, object->texts->derivation});
    cts_put_code(to, DCM_DerivationCodeSequence, object->texts->mode);
    if (object->texts->view.value)
        cts_put_code(to, DCM_ViewCodeSequence, object->texts->view);
    if (object->mm_per_pixel > 0) {
        cts_put_numbers(to, DCM_PixelSpacing, (double[]){object->mm_per_pixel, object->mm_per_pixel}, 2);
        CTS_PUT_TEXTS(to, {DCM_PixelSpacingCalibrationType, "GEOMETRY"},
                      {DCM_PixelSpacingCalibrationDescription, "orthographic projection, one scale at all depths"});
    }
    CTS_PUT_TEXTS(to, {DCM_BurnedInAnnotation, object->burned_in ? "YES" : "NO"},
                  {DCM_RecognizableVisualFeatures, object->recognizable ? "YES" : "NO"});
}

static void put_purpose(CtsRecords *to)
{
    CTS_PUT_TEXTS(to, {DCM_SpatialLocationsPreserved, "NO"});
    cts_put_code(to, DCM_PurposeOfReferenceCodeSequence,
                 (CtsScCode){"121322", "DCM", "Source image for image processing operation"});
}

/* Every slice the picture was made of. An enhanced object is one instance with many slices. */
static void put_references(CtsRecords *to, const CtsScObject *object)
{
    bool named = false;
    for (int i = 0; i < object->source->n_slices; i++)
        named |= object->source->slices[i]->sop_uid[0] != 0;
    if (named)
        cts_put_source_series(to, object->source);
    cts_put_sources(to, DCM_SourceImageSequence, object->source, put_purpose);
    cts_put_label_series(to, object->labels, object->names->study_uid);
}

/* In the place of patient and study. */
static void put_pseudonym(CtsRecords *to, const char *pseudonym)
{
    char name[80];
    snprintf(name, sizeof name, "Anonymous^%s", pseudonym);
    CTS_PUT_TEXTS(to, {DCM_PatientName, name}, {DCM_PatientID, pseudonym}, {DCM_PatientIdentityRemoved, "YES"},
                  {DCM_LongitudinalTemporalInformationModified, "REMOVED"},
                  {DCM_DeidentificationMethod, "ctsplat: identity and dates removed, new UIDs, pixels unchanged"});
    cts_put_code(to, DCM_DeidentificationMethodCodeSequence,
                 (CtsScCode){"113100", "DCM", "Basic Application Confidentiality Profile"});
}

/* FrameTime is the increment and comes first, since some viewers know nothing else. The angles are separate vectors
 * that must be listed beside it (C.8.6.4). A text value is shorter than 64 KiB. */
static void put_frames(CtsRecords *to, const CtsScObject *object)
{
    const bool angles_fit = object->n_frames <= 0xFFFE / 17;
    const double steps[] = {0x0018, 0x1063, 0x0018, 0x2003, 0x0018, 0x2004};
    CTS_PUT_NUMBERS(to, {DCM_StartTrim, 1}, {DCM_StopTrim, object->n_frames},
                    {DCM_RecommendedDisplayFrameRate, 1000 / FRAME_MS}, {DCM_CineRate, 1000 / FRAME_MS},
                    {DCM_FrameTime, FRAME_MS}, {DCM_NumberOfFrames, object->n_frames});
    if (angles_fit) {
        cts_put_numbers(to, DCM_FramePrimaryAngleVector, object->azimuth_deg, (size_t)object->n_frames);
        cts_put_numbers(to, DCM_FrameSecondaryAngleVector, object->elevation_deg, (size_t)object->n_frames);
    }
    cts_put_numbers(to, DCM_FrameIncrementPointer, steps, angles_fit ? 6 : 2);
}

static void put_pixel_format(CtsRecords *to, const CtsScObject *object)
{
    const int bits = object->grey ? 16 : 8;
    CTS_PUT_TEXTS(to, {DCM_PhotometricInterpretation, object->grey ? "MONOCHROME2" : "RGB"});
    CTS_PUT_NUMBERS(to, {DCM_SamplesPerPixel, object->grey ? 1 : 3}, {DCM_Rows, object->height},
                    {DCM_Columns, object->width}, {DCM_BitsAllocated, bits}, {DCM_BitsStored, bits},
                    {DCM_HighBit, bits - 1}, {DCM_PixelRepresentation, 0});
    if (!object->grey) {
        CTS_PUT_NUMBERS(to, {DCM_PlanarConfiguration, 0});
        cts_put_profile(to);
    } else if (object->n_frames == 1) { /* black at 0, white at 65535 */
        CTS_PUT_NUMBERS(to, {DCM_WindowCenter, 32768}, {DCM_WindowWidth, 65536});
    } else {
        CTS_PUT_TEXTS(to, {DCM_RescaleType, "US"}, {DCM_PresentationLUTShape, "IDENTITY"});
        CTS_PUT_NUMBERS(to, {DCM_RescaleIntercept, 0}, {DCM_RescaleSlope, 1});
    }
}

CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsTempFile *file, CtsError *err)
{
    CtsRecords to = {0};
    const bool deidentified = object->names->pseudonym[0];
    put_series_and_equipment(&to, object);
    put_lossy(&to, object->lossy);
    put_image(&to, object);
    if (deidentified)
        put_pseudonym(&to, object->names->pseudonym);
    else
        put_references(&to, object);
    if (object->n_frames > 1)
        put_frames(&to, object);
    put_pixel_format(&to, object);
    const CtsReaderOrder order = {.syntax_number = cts_syntax_number(cts_syntax_find(object->syntax_uid)),
                                  .deidentified = deidentified,
                                  .body_side = true};
    return cts_records_write(&to, order, object->source->slices[0], file, err);
}
