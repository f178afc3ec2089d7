/* Secondary captures written with DCMTK (PS3.3 A.8.1, A.8.4 and A.8.5). */
#include <dcmtk/config/osconfig.h>

#include "dicom/dcm_sc.h"

#include "dicom/dcm_read.h"
#include "dicom/file_bytes.h"
#include <cerrno>
#include <dcmtk/dcmdata/dcistrmf.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dcrlerp.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <memory>
#include <mutex>
#include <new>
#include <stdio.h>
#include <string.h>
#include <string>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

namespace
{

/* Names this implementation of DICOM writing (PS3.7 D.3.3.2); made once, like any UID. */
const char *const implementation_uid = "2.25.67028870792169200667320284542246776385";
const size_t piece_bytes = 1 << 20;
const int frame_ms = 100;

/* Puts values into an item; the first failure is kept and ends all further work. */
class Put
{
  public:
    explicit Put(DcmItem &item) : item_(item)
    {
    }

    Put &text(const DcmTagKey &tag, const char *value)
    {
        if (state_.good())
            state_ = item_.putAndInsertString(DcmTag(tag), value);
        return *this;
    }

    Put &number(const DcmTagKey &tag, long value)
    {
        char digits[24];
        snprintf(digits, sizeof digits, "%ld", value);
        return text(tag, digits);
    }

    Put &word(const DcmTagKey &tag, int value)
    {
        if (state_.good())
            state_ = item_.putAndInsertUint16(DcmTag(tag), static_cast<Uint16>(value));
        return *this;
    }

    /* Takes the element over. */
    Put &element(DcmElement *element)
    {
        if (state_.good())
            state_ = element ? item_.insert(element) : EC_MemoryExhausted;
        if (state_.bad())
            delete element;
        return *this;
    }

    /* A new item at the end of a sequence; NULL after a failure. */
    DcmItem *item(const DcmTagKey &sequence)
    {
        DcmItem *made = nullptr;
        if (state_.good())
            state_ = item_.findOrCreateSequenceItem(DcmTag(sequence), made, -2);
        return state_.good() ? made : nullptr;
    }

    Put &keep(const OFCondition &state)
    {
        if (state_.good())
            state_ = state;
        return *this;
    }

    Put &code(const DcmTagKey &sequence, const char *value, const char *meaning)
    {
        if (DcmItem *made = item(sequence))
            keep(Put(*made)
                     .text(DCM_CodeValue, value)
                     .text(DCM_CodingSchemeDesignator, "DCM")
                     .text(DCM_CodeMeaning, meaning)
                     .state());
        return *this;
    }

    const OFCondition &state() const
    {
        return state_;
    }

  private:
    DcmItem &item_;
    OFCondition state_ = EC_Normal;
};

const char *string_of(DcmItem &item, const DcmTagKey &tag)
{
    const char *text = nullptr;
    return item.findAndGetString(tag, text).good() && text ? text : "";
}

/* A path for what DCMTK is to read: an archive's member is put into a file without a name, up to its pixels. */
class SourcePath
{
  public:
    explicit SourcePath(const CtsSlice &slice) : path_(slice.path)
    {
        if (!slice.memory)
            return;
        const uint64_t n = slice.syntax && slice.syntax->deflated ? slice.file_bytes : slice.pixel_offset;
        fd_ = memfd_create("slice", MFD_CLOEXEC);
        path_ = "/proc/self/fd/" + std::to_string(fd_);
        for (uint64_t done = 0; fd_ >= 0 && done < n;) {
            const ssize_t put = write(fd_, slice.memory + done, static_cast<size_t>(n - done));
            if (put < 0 && errno != EINTR)
                break;
            done += put > 0 ? static_cast<uint64_t>(put) : 0;
        }
    }
    ~SourcePath()
    {
        if (fd_ >= 0)
            close(fd_);
    }
    SourcePath(const SourcePath &) = delete;
    SourcePath &operator=(const SourcePath &) = delete;
    const char *text() const
    {
        return path_.c_str();
    }

  private:
    std::string path_;
    int fd_ = -1;
};

/* The file must be the one that was scanned: its framing was looked over then, before DCMTK first saw it. */
CtsStatus load_header(DcmFileFormat &file, const CtsSlice &slice, CtsError *err)
{
    CtsFileBytes now;
    const CtsStatus st = cts_slice_open(&slice, &now, err);
    cts_file_bytes_close(&now);
    if (st)
        return cts_context(err, "%s", slice.path);
    const SourcePath path(slice);
    const OFCondition state =
        file.loadFileUntilTag(path.text(), EXS_Unknown, EGL_noChange, DCM_MaxReadLength, ERM_autoDetect, DCM_PixelData);
    return state.good() ? CTS_OK
                        : cts_fail(err, CTS_ERR_READ, "%s: cannot be read for a secondary capture: %s", slice.path,
                                   state.text());
}

/* An element as it stands in the source, value bytes and all. */
void copy_element(Put &put, DcmItem &from, const DcmTagKey &tag)
{
    DcmElement *found = nullptr;
    if (from.findAndGetElement(tag, found).good() && found)
        put.element(dynamic_cast<DcmElement *>(found->clone()));
}

/* The same, but empty where the source has none: type 2. */
void copy_or_empty(Put &put, DcmItem &from, const DcmTagKey &tag)
{
    if (from.tagExists(tag))
        copy_element(put, from, tag);
    else
        put.text(tag, "");
}

const DcmTagKey identity_type2[] = {DCM_PatientName,    DCM_PatientID, DCM_PatientBirthDate,       DCM_PatientSex,
                                    DCM_StudyDate,      DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID,
                                    DCM_AccessionNumber};
const DcmTagKey identity_type3[] = {DCM_SpecificCharacterSet,
                                    DCM_IssuerOfPatientID,
                                    DCM_IssuerOfPatientIDQualifiersSequence,
                                    DCM_OtherPatientIDsSequence,
                                    DCM_PatientAge,
                                    DCM_PatientSize,
                                    DCM_PatientWeight,
                                    DCM_PatientSpeciesDescription,
                                    DCM_PatientSpeciesCodeSequence,
                                    DCM_StudyDescription,
                                    DCM_IssuerOfAccessionNumberSequence,
                                    DCM_PatientIdentityRemoved,
                                    DCM_DeidentificationMethod,
                                    DCM_DeidentificationMethodCodeSequence,
                                    DCM_LongitudinalTemporalInformationModified};

/* Body parts of PS3.16 Annex L of which there is one. */
bool is_unpaired(const char *part)
{
    static const char parts[] =
        " ABDOMEN ABDOMENPELVIS AORTA BACK BLADDER BRAIN CHEST CHESTABDOMEN CHESTABDPELVIS CIRCLEOFWILLIS "
        "COCCYX COLON CORONARYARTERY CSPINE CTSPINE DUODENUM ESOPHAGUS FACE GALLBLADDER HEAD HEADNECK "
        "HEART JAW LARYNX LIVER LSPINE LSSPINE MAXILLA MEDIASTINUM MOUTH NECK NECKCHEST NECKCHESTABDOMEN "
        "NECKCHESTABDPELV NOSE PANCREAS PELVIS PHARYNX PROSTATE RECTUM SKULL SPINE SPLEEN SSPINE STERNUM "
        "STOMACH THYMUS THYROID TLSPINE TONGUE TRACHEA TSPINE UTERUS WHOLEBODY ";
    const std::string word = std::string(" ") + part + " ";
    return *part && strstr(parts, word.c_str());
}

void put_identity(Put &put, const CtsScObject &object, DcmItem &source)
{
    if (object.pseudonym) {
        for (const DcmTagKey &tag : identity_type2)
            put.text(tag, "");
        put.text(DCM_PatientName, (std::string("Anonymous^") + object.pseudonym).c_str());
        put.text(DCM_PatientID, object.pseudonym);
        put.text(DCM_PatientIdentityRemoved, "YES").text(DCM_LongitudinalTemporalInformationModified, "REMOVED");
        put.text(DCM_DeidentificationMethod, "ctsplat: identity and dates replaced, new UIDs, pixels unchanged");
    } else {
        for (const DcmTagKey &tag : identity_type2)
            copy_or_empty(put, source, tag);
        for (const DcmTagKey &tag : identity_type3)
            copy_element(put, source, tag);
    }
    /* Which side is meant must be said, or left empty where nobody knows, unless there is only one of it. */
    const char *part = string_of(source, DCM_BodyPartExamined);
    copy_element(put, source, DCM_BodyPartExamined);
    if (!is_unpaired(part))
        put.text(DCM_Laterality, string_of(source, DCM_Laterality));
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
    put.text(DCM_StudyInstanceUID, object.study_uid).text(DCM_SeriesInstanceUID, object.series_uid);
    put.text(DCM_SOPInstanceUID, object.sop_uid).text(DCM_SOPClassUID, class_uid(object));
    put.text(DCM_Modality, object.source->modality[0] ? object.source->modality : "CT");
    put.number(DCM_SeriesNumber, object.series_number).number(DCM_InstanceNumber, object.instance_number);
    put.text(DCM_SeriesDescription, object.series_description).text(DCM_ConversionType, "WSD");
    for (const DcmTagKey &tag : {DCM_InstanceCreationDate, DCM_SeriesDate, DCM_ContentDate, DCM_DateOfSecondaryCapture})
        put.text(tag, object.date);
    for (const DcmTagKey &tag : {DCM_InstanceCreationTime, DCM_SeriesTime, DCM_ContentTime, DCM_TimeOfSecondaryCapture})
        put.text(tag, object.time);
    for (const DcmTagKey &tag : {DCM_Manufacturer, DCM_ManufacturerModelName, DCM_SecondaryCaptureDeviceManufacturer,
                                 DCM_SecondaryCaptureDeviceManufacturerModelName})
        put.text(tag, "ctsplat");
    put.text(DCM_SoftwareVersions, object.version).text(DCM_SecondaryCaptureDeviceSoftwareVersions, object.version);
    put.text(DCM_DeviceSerialNumber, "0");
}

/* Once lossy, always lossy. */
CtsStatus put_lossy(Put &put, const CtsScObject &object, CtsError *err)
{
    put.text(DCM_LossyImageCompression, object.lossy ? "01" : "00");
    if (!object.lossy)
        return CTS_OK;
    DcmFileFormat lossy;
    const CtsStatus st = load_header(lossy, *object.lossy, err);
    if (st)
        return st;
    copy_element(put, *lossy.getDataset(), DCM_LossyImageCompressionRatio);
    copy_element(put, *lossy.getDataset(), DCM_LossyImageCompressionMethod);
    return CTS_OK;
}

void put_image(Put &put, const CtsScObject &object)
{
    char image_type[64];
    snprintf(image_type, sizeof image_type, "DERIVED\\SECONDARY\\%s", object.image_type);
    put.text(DCM_ImageType, image_type).text(DCM_PatientOrientation, object.patient_orientation);
    put.text(DCM_DerivationDescription, object.derivation);
    put.code(DCM_DerivationCodeSequence, object.derivation_code, object.derivation_meaning);
    put.text(DCM_BurnedInAnnotation, object.burned_in ? "YES" : "NO");
    put.text(DCM_RecognizableVisualFeatures, object.recognizable ? "YES" : "NO");
}

bool has_instance_uids(const CtsSeries &series)
{
    for (int i = 0; i < series.n_slices; i++)
        if (*series.slices[i].sop_uid)
            return true;
    return false;
}

/* Every slice the picture was made of. An enhanced object is one instance with many slices. */
void put_references(Put &put, const CtsScObject &object)
{
    const CtsSeries &source = *object.source;
    DcmItem *series = has_instance_uids(source) ? put.item(DCM_ReferencedSeriesSequence) : nullptr;
    if (!series)
        return;
    Put in_series(*series);
    in_series.text(DCM_SeriesInstanceUID, source.uid);
    const char *last = "";
    for (int i = 0; i < source.n_slices; i++) {
        const char *uid = source.slices[i].sop_uid;
        if (!*uid || strcmp(uid, last) == 0)
            continue;
        last = uid;
        if (DcmItem *instance = in_series.item(DCM_ReferencedInstanceSequence)) {
            Put to(*instance);
            to.text(DCM_ReferencedSOPClassUID, object.source_class_uid).text(DCM_ReferencedSOPInstanceUID, uid);
            in_series.keep(to.state());
        }
        if (DcmItem *image = put.item(DCM_SourceImageSequence)) {
            Put to(*image);
            to.text(DCM_ReferencedSOPClassUID, object.source_class_uid).text(DCM_ReferencedSOPInstanceUID, uid);
            to.text(DCM_SpatialLocationsPreserved, "NO");
            to.code(DCM_PurposeOfReferenceCodeSequence, "121322", "Source image for image processing operation");
            put.keep(to.state());
        }
    }
    put.keep(in_series.state());
}

/* Only FrameTime steps the frames: viewers stumble over vectors of angles or labels. */
void put_frames(Put &put, const CtsScObject &object)
{
    put.number(DCM_StartTrim, 1).number(DCM_StopTrim, object.n_frames);
    put.number(DCM_RecommendedDisplayFrameRate, 1000 / frame_ms).number(DCM_CineRate, 1000 / frame_ms);
    put.number(DCM_FrameTime, frame_ms).number(DCM_NumberOfFrames, object.n_frames);
    std::unique_ptr<DcmAttributeTag> pointer(new DcmAttributeTag(DcmTag(DCM_FrameIncrementPointer)));
    put.keep(pointer->putTagVal(DCM_FrameTime));
    put.element(pointer.release());
}

void put_pixels(Put &put, const CtsScObject &object)
{
    const int bits = object.grey ? 16 : 8;
    put.word(DCM_SamplesPerPixel, object.grey ? 1 : 3);
    put.text(DCM_PhotometricInterpretation, object.grey ? "MONOCHROME2" : "RGB");
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
    /* The value stays in its file and is read piece by piece. */
    std::unique_ptr<DcmPixelData> pixels(new DcmPixelData(DcmTag(DCM_PixelData)));
    put.keep(pixels->createValueFromTempFile(new DcmInputFileStreamFactory(object.pixel_path, 0),
                                             static_cast<Uint32>(object.pixel_bytes), gLocalByteOrder));
    put.keep(pixels->setVR(object.grey ? EVR_OW : EVR_OB));
    put.element(pixels.release());
}

/* The encoders are registered once and stay: DCMTK's list of codecs is the process's. */
void register_encoders()
{
    static std::once_flag once;
    std::call_once(once, [] {
        DcmRLEEncoderRegistration::registerCodecs();
        DJEncoderRegistration::registerCodecs();
    });
}

OFCondition compress(DcmDataset &data, E_TransferSyntax syntax)
{
    register_encoders();
    const DcmRLERepresentationParameter rle;
    const DJ_RPLossless jpeg;
    OFCondition state = EC_Normal;
    if (syntax == EXS_RLELossless)
        state = data.chooseRepresentation(syntax, &rle);
    else if (syntax == EXS_JPEGProcess14SV1)
        state = data.chooseRepresentation(syntax, &jpeg);
    return state.good() && !data.canWriteXfer(syntax) ? EC_UnsupportedEncoding : state;
}

/* DCMTK fills the meta header with names of its own; these are ours. */
OFCondition put_meta(DcmFileFormat &file, E_TransferSyntax syntax)
{
    char version[17];
    snprintf(version, sizeof version, "CTSPLAT_%.8s", CTS_VERSION);
    for (char *c = version; *c; c++)
        *c = *c == '.' ? '_' : *c;
    const OFCondition state = file.validateMetaInfo(syntax);
    DcmMetaInfo *meta = file.getMetaInfo();
    Put put(*meta);
    put.keep(state).text(DCM_ImplementationClassUID, implementation_uid).text(DCM_ImplementationVersionName, version);
    return put
        .keep(meta->computeGroupLengthAndPadding(EGL_recalcGL, EPD_noChange, EXS_LittleEndianExplicit,
                                                 EET_ExplicitLength))
        .state();
}

/* Hands the encoded file to the sink piece by piece, so that it never stands in memory as a whole a second time. */
CtsStatus stream(DcmFileFormat &file, E_TransferSyntax syntax, CtsScSink sink, void *context, OFCondition &state,
                 CtsError *err)
{
    std::vector<char> buffer(piece_bytes);
    DcmOutputBufferStream out(buffer.data(), static_cast<offile_off_t>(buffer.size()));
    CtsStatus st = CTS_OK;
    file.transferInit();
    do {
        void *piece = nullptr;
        offile_off_t n = 0;
        state = file.write(out, syntax, EET_ExplicitLength, nullptr, EGL_withoutGL, EPD_withoutPadding, 0, 0, 0,
                           EWM_dontUpdateMeta);
        out.flushBuffer(piece, n);
        if (n > 0)
            st = sink(context, piece, static_cast<size_t>(n), err);
    } while (st == CTS_OK && state == EC_StreamNotifyClient);
    file.transferEnd();
    return st;
}

CtsStatus write_object(const CtsScObject &object, CtsScSink sink, void *context, CtsError *err)
{
    DcmFileFormat source, file;
    CtsStatus st = cts_dcm_start(err);
    if (st || (st = load_header(source, object.source->slices[0], err)))
        return st;
    DcmDataset &data = *file.getDataset();
    Put put(data);
    put_identity(put, object, *source.getDataset());
    put_series_and_equipment(put, object);
    if ((st = put_lossy(put, object, err)))
        return st;
    put_image(put, object);
    if (!object.pseudonym)
        put_references(put, object);
    if (object.n_frames > 1)
        put_frames(put, object);
    put_pixels(put, object);
    const E_TransferSyntax syntax = DcmXfer(object.syntax_uid).getXfer();
    OFCondition state = put.state();
    if (state.good())
        state = compress(data, syntax);
    if (state.good()) /* the JPEG encoder writes its own story in front */
        state = Put(data).text(DCM_DerivationDescription, object.derivation).state();
    if (state.good())
        state = put_meta(file, syntax);
    if (state.good())
        st = stream(file, syntax, sink, context, state, err);
    if (!st && state.bad())
        st = cts_fail(err, CTS_ERR_OUTPUT, "the secondary capture cannot be encoded: %s", state.text());
    return st;
}

void copy_text(char *to, size_t size, const char *text)
{
    snprintf(to, size, "%s", text);
}

CtsStatus read_source(const CtsSlice &slice, CtsScSource *source, CtsError *err)
{
    DcmFileFormat file;
    CtsStatus st = cts_dcm_start(err);
    if (st || (st = load_header(file, slice, err)))
        return st;
    DcmDataset &data = *file.getDataset();
    copy_text(source->study_uid, sizeof source->study_uid, string_of(data, DCM_StudyInstanceUID));
    copy_text(source->sop_class_uid, sizeof source->sop_class_uid, string_of(data, DCM_SOPClassUID));
    cts_dcm_parse_is(string_of(data, DCM_SeriesNumber), strlen(string_of(data, DCM_SeriesNumber)),
                     &source->series_number);
    source->burned_in = strcmp(string_of(data, DCM_BurnedInAnnotation), "YES") == 0;
    return CTS_OK;
}

} // namespace

extern "C" CtsStatus cts_dcm_sc_source(const CtsSlice *slice, CtsScSource *source, CtsError *err)
try {
    *source = CtsScSource{};
    return read_source(*slice, source, err);
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", slice->path);
} catch (...) {
    return cts_fail(err, CTS_ERR_READ, "%s: unexpected failure in DCMTK", slice->path);
}

extern "C" CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsScSink sink, void *context, CtsError *err)
try {
    return write_object(*object, sink, context, err);
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory while a secondary capture is encoded");
} catch (...) {
    return cts_fail(err, CTS_ERR_OUTPUT, "unexpected failure in DCMTK while a secondary capture is encoded");
}
