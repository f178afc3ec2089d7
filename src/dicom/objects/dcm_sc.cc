/* Secondary captures written with DCMTK (PS3.3 A.8.1, A.8.4 and A.8.5). */
#include <dcmtk/config/osconfig.h>

#include "base/load_plugin.h"
#include "dicom/header/dcm_call.hpp"
#include "dicom/objects/dcm_put.hpp"

#include "dicom/header/dcm_read.h"
#include <memory>
#include <stdio.h>
#include <string.h>
#include <string>

namespace
{

const int frame_ms = 100; /* 36 frames of a rotation last 3.6 s */

/* Body parts of PS3.16 Annex L that are paired, or parts of a limb. */
bool is_paired(const char *part)
{
    static const char parts[] =
        " ACJOINT ADRENAL ANKLE ARM AXILLA CALCANEUS CALF CAROTID CLAVICLE CLAVICLE_ACROMION EAR ELBOW EXTREMITY EYE "
        "EYELID FEMUR FINGER FOOT FOREARM FOREFOOT HAND HINDFOOT HIP HUMERUS IAC ILIUM INNEREAR IPJOINT KIDNEY KNEE "
        "LEG LOWERARM LOWERLEG LOWERLIMB LUNG MASTOID OPTICCANAL ORBIT OVARY PAROTID PATELLA RADIUS RADIUSULNA RIB "
        "SCAPULA SCJOINT SHOULDER SIJOINT SUBCLAVIAN TESTIS THIGH THUMB TIBFIB TIBIA TMJ TOE ULNA UPPERARM UPPERLIMB "
        "WRIST ZYGOMA ";
    const std::string word = std::string(" ") + part + " ";
    return *part && strstr(parts, word.c_str());
}

/* Laterality is required for paired parts, or empty where it is unknown (C.7.3.1.1.1); for all others ImageLaterality
 * is U. */
void put_side(Put &put, DcmItem &source)
{
    const char *part = cts_dcm_text(source, DCM_BodyPartExamined);
    if (*part)
        cts_dcm_copy(put, source, DCM_BodyPartExamined);
    if (source.tagExistsWithValue(DCM_Laterality))
        cts_dcm_copy(put, source, DCM_Laterality);
    else if (source.tagExistsWithValue(DCM_ImageLaterality))
        cts_dcm_copy(put, source, DCM_ImageLaterality);
    else if (is_paired(part))
        put.text(DCM_Laterality, "");
    else /* an axial slice contains both breasts */
        put.text(DCM_ImageLaterality, strcmp(part, "BREAST") == 0 ? "B" : "U");
}

const char *class_uid(const CtsScObject &object)
{
    if (object.n_frames == 1)
        return UID_SecondaryCaptureImageStorage;
    return object.grey ? UID_MultiframeGrayscaleWordSecondaryCaptureImageStorage
                       : UID_MultiframeTrueColorSecondaryCaptureImageStorage;
}

void put_series_and_equipment(Put &put, const CtsScObject &object)
{
    put.text(DCM_StudyInstanceUID, object.names->study_uid).text(DCM_SeriesInstanceUID, object.names->series_uid);
    put.text(DCM_SOPInstanceUID, object.names->sop_uid).text(DCM_SOPClassUID, class_uid(object));
    put.text(DCM_Modality, object.source->modality[0] ? object.source->modality : "CT");
    put.number(DCM_SeriesNumber, object.names->series_number).number(DCM_InstanceNumber, object.names->instance_number);
    put.text(DCM_SeriesDescription, object.words->series_description).text(DCM_ConversionType, "WSD");
    /* SeriesDate and SeriesTime would have to be those of views that were made before. */
    for (const DcmTagKey &tag : {DCM_InstanceCreationDate, DCM_ContentDate, DCM_DateOfSecondaryCapture})
        if (*object.date)
            put.text(tag, object.date);
    for (const DcmTagKey &tag : {DCM_InstanceCreationTime, DCM_ContentTime, DCM_TimeOfSecondaryCapture})
        if (*object.time)
            put.text(tag, object.time);
    for (const DcmTagKey &tag : {DCM_Manufacturer, DCM_ManufacturerModelName, DCM_SecondaryCaptureDeviceManufacturer,
                                 DCM_SecondaryCaptureDeviceManufacturerModelName})
        put.text(tag, "ctsplat");
    put.text(DCM_SoftwareVersions, CTS_VERSION).text(DCM_SecondaryCaptureDeviceSoftwareVersions, CTS_VERSION);
    put.text(DCM_DeviceSerialNumber, "0");
}

/* Once lossy, always lossy. */
CtsStatus put_lossy(Put &put, const CtsScObject &object, CtsError *err)
{
    put.text(DCM_LossyImageCompression, object.lossy ? "01" : "00");
    if (!object.lossy)
        return CTS_OK;
    DcmDataset lossy;
    const CtsStatus st = cts_dcm_load(lossy, *object.lossy, err);
    if (st)
        return st;
    cts_dcm_copy(put, lossy, DCM_LossyImageCompressionRatio);
    cts_dcm_copy(put, lossy, DCM_LossyImageCompressionMethod);
    return CTS_OK;
}

void put_image(Put &put, const CtsScObject &object)
{
    char image_type[64];
    snprintf(image_type, sizeof image_type, "DERIVED\\SECONDARY\\%s", object.words->image_type);
    put.text(DCM_ImageType, image_type).text(DCM_PatientOrientation, object.words->patient_orientation);
    put.text(DCM_DerivationDescription, object.words->derivation);
    put.code(DCM_DerivationCodeSequence, object.words->mode);
    put.code(DCM_ViewCodeSequence, object.words->view);
    if (object.mm_per_pixel > 0) {
        const double spacing_mm[2] = {object.mm_per_pixel, object.mm_per_pixel};
        put.decimals(DCM_PixelSpacing, spacing_mm, 2).text(DCM_PixelSpacingCalibrationType, "GEOMETRY");
        put.text(DCM_PixelSpacingCalibrationDescription, "orthographic projection, one scale at all depths");
    }
    put.text(DCM_BurnedInAnnotation, object.burned_in ? "YES" : "NO");
    put.text(DCM_RecognizableVisualFeatures, object.recognizable ? "YES" : "NO");
}

/* Every slice the picture was made of. An enhanced object is one instance with many slices. */
void put_references(Put &put, const CtsScObject &object)
{
    const CtsSeries &source = *object.source;
    bool named = false;
    cts_dcm_each_instance(source, [&](const char *) { named = true; });
    DcmItem *series = named ? put.item(DCM_ReferencedSeriesSequence) : nullptr;
    if (!series)
        return;
    Put in_series(*series);
    in_series.text(DCM_SeriesInstanceUID, source.uid);
    const CtsScCode purpose = {"121322", "DCM", "Source image for image processing operation"};
    cts_dcm_each_instance(source, [&](const char *uid) {
        in_series.reference(DCM_ReferencedInstanceSequence, object.source->slices[0]->class_uid, uid);
        if (DcmItem *image = put.reference(DCM_SourceImageSequence, object.source->slices[0]->class_uid, uid)) {
            Put to(*image);
            to.text(DCM_SpatialLocationsPreserved, "NO").code(DCM_PurposeOfReferenceCodeSequence, purpose);
            put.keep(to.state());
        }
    });
    put.keep(in_series.state());
}

/* FrameTime is the increment and comes first, since some viewers know nothing else. The angles are separate vectors
 * that must be listed beside it (C.8.6.4). A text value is shorter than 64 KiB. */
void put_frames(Put &put, const CtsScObject &object)
{
    const bool angles_fit = object.n_frames <= 0xFFFE / 17;
    const Uint16 steps[] = {0x0018, 0x1063, 0x0018, 0x2003, 0x0018, 0x2004};
    put.number(DCM_StartTrim, 1).number(DCM_StopTrim, object.n_frames);
    put.number(DCM_RecommendedDisplayFrameRate, 1000 / frame_ms).number(DCM_CineRate, 1000 / frame_ms);
    put.number(DCM_FrameTime, frame_ms).number(DCM_NumberOfFrames, object.n_frames);
    if (angles_fit) {
        put.decimals(DCM_FramePrimaryAngleVector, object.azimuth_deg, object.n_frames);
        put.decimals(DCM_FrameSecondaryAngleVector, object.elevation_deg, object.n_frames);
    }
    std::unique_ptr<DcmAttributeTag> pointer(new DcmAttributeTag(DcmTag(DCM_FrameIncrementPointer)));
    put.keep(pointer->putUint16Array(steps, angles_fit ? 3 : 1));
    put.element(pointer.release());
}

void put_pixels(Put &put, const CtsScObject &object)
{
    const int bits = object.grey ? 16 : 8;
    put.word(DCM_SamplesPerPixel, object.grey ? 1 : 3);
    put.text(DCM_PhotometricInterpretation, object.grey ? "MONOCHROME2" : object.reversible_ycc ? "YBR_RCT" : "RGB");
    if (!object.grey)
        put.word(DCM_PlanarConfiguration, 0);
    put.word(DCM_Rows, object.height).word(DCM_Columns, object.width).word(DCM_BitsAllocated, bits);
    put.word(DCM_BitsStored, bits).word(DCM_HighBit, bits - 1).word(DCM_PixelRepresentation, 0);
    if (object.grey && object.n_frames == 1) /* black at 0, white at 65535 */
        put.text(DCM_WindowCenter, "32768").text(DCM_WindowWidth, "65536");
    if (object.grey && object.n_frames > 1) {
        put.text(DCM_RescaleIntercept, "0").text(DCM_RescaleSlope, "1").text(DCM_RescaleType, "US");
        put.text(DCM_PresentationLUTShape, "IDENTITY");
    }
    if (!object.grey)
        cts_dcm_put_profile(put, DCM_ICCProfile).text(DCM_ColorSpace, "SRGB");
}

CtsStatus write_object(const CtsScObject &object, CtsScSink sink, void *context, CtsError *err)
{
    DcmFileFormat file;
    DcmDataset source;
    CtsStatus st = cts_dcm_start(err);
    if (st || (st = cts_dcm_load(source, *object.header, err)))
        return st;
    const char *const pseudonym = object.names->pseudonym;
    Put put(*file.getDataset());
    cts_dcm_put_study(put, source, *pseudonym ? pseudonym : nullptr);
    put_side(put, source);
    put_series_and_equipment(put, object);
    if ((st = put_lossy(put, object, err)))
        return st;
    put_image(put, object);
    if (!*pseudonym) {
        put_references(put, object);
        if (object.labels)
            cts_dcm_put_label_series(put, *object.labels, object.names->study_uid);
    }
    if (object.n_frames > 1)
        put_frames(put, object);
    put_pixels(put, object);
    if (put.state().bad())
        return cts_fail(err, cts_dcm_status(put.state(), CTS_ERR_OUTPUT), "the secondary capture cannot be encoded: %s",
                        put.state().text());
    return cts_dcm_stream(file, DcmXfer(object.syntax_uid).getXfer(), sink, context, err);
}

} // namespace

extern "C" CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsScSink sink, void *context, CtsError *err)
{
    return cts_dcm_guarded(err, CTS_ERR_OUTPUT, [&] { return write_object(*object, sink, context, err); });
}

extern "C" {
CTS_PLUGIN_TABLE(CtsDcmWriters, cts_dcm_writers, cts_dcm_sc_write, cts_dcm_sc_encode, cts_dcm_state_write)
}
