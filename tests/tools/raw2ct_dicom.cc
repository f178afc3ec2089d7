#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcmetinf.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dcrlerp.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <dcmtk/dcmjpls/djrparam.h>

#include "jpeg2000_stream.h"
#include "raw2ct.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <sys/stat.h>
#include <vector>

namespace
{

using Pixels = std::vector<Uint16>;

E_TransferSyntax syntax_of(const std::string &name)
{
    static const struct {
        const char *name;
        E_TransferSyntax xfer;
    } syntaxes[] = {
        {"implicit", EXS_LittleEndianImplicit},
        {"explicit", EXS_LittleEndianExplicit},
        {"big", EXS_BigEndianExplicit},
        {"deflated", EXS_DeflatedLittleEndianExplicit},
        {"rle", EXS_RLELossless},
        {"jpeg-lossless", EXS_JPEGProcess14SV1},
        {"jpeg-ls", EXS_JPEGLSLossless},
        {"jpeg-2000", EXS_JPEG2000LosslessOnly},
    };
    for (const auto &s : syntaxes)
        if (name == s.name)
            return s.xfer;
    throw std::runtime_error("--syntax " + name + ": there is no such transfer syntax");
}

/* 128 bits of FNV-1a in two lanes: not for secrets, only so that other content gets another UID. */
class Hash
{
  public:
    void add(const std::string &text)
    {
        for (const char c : text)
            add_byte(static_cast<unsigned char>(c));
        add_byte(0);
    }
    void add(unsigned v)
    {
        for (int i = 0; i < 4; i++)
            add_byte(static_cast<unsigned char>(v >> 8 * i));
    }
    /* A UID derived from a UUID (2.25, PS3.5 B.2) of version 8. */
    std::string uid() const
    {
        uint64_t high = (a & ~0xf000ull) | 0x8000u, low = (b & 0x3fffffffffffffffull) | 0x8000000000000000ull;
        std::string digits;
        while (high || low) { /* long division of the 128-bit number by ten */
            const uint64_t upper = (high % 10) << 32 | low >> 32, lower = (upper % 10) << 32 | (low & 0xffffffffu);
            high /= 10;
            low = (upper / 10) << 32 | lower / 10;
            digits.insert(digits.begin(), static_cast<char>('0' + lower % 10));
        }
        return "2.25." + digits;
    }

  private:
    void add_byte(unsigned char byte)
    {
        a = (a ^ byte) * 0x100000001b3u;
        b = (b ^ byte) * 0x880355f21e6d1965u + 0x9e3779b97f4a7c15u;
    }
    uint64_t a = 0xcbf29ce484222325u, b = 0x6c62272e07bb0142u;
};

std::string uid_of(const std::string &what)
{
    Hash h;
    h.add("ctsplat test data");
    h.add(what);
    return h.uid();
}

/* A decimal string of at most 16 characters (VR DS), as exact as that allows. */
std::string decimal(double v)
{
    char text[40];
    for (int digits = 15; digits > 0; digits--) {
        std::snprintf(text, sizeof text, "%.*g", digits, std::fabs(v) < 1e-12 ? 0 : v);
        if (std::strlen(text) <= 16)
            break;
    }
    return text;
}

template <typename... Rest> std::string decimals(double first, Rest... rest)
{
    std::string joined = decimal(first);
    ((joined += "\\" + decimal(rest)), ...);
    return joined;
}

void check(const OFCondition &condition, const std::string &what)
{
    if (condition.bad())
        throw std::runtime_error(what + ": " + condition.text());
}

void put(DcmItem &item, const DcmTagKey &tag, const std::string &value)
{
    check(item.putAndInsertString(tag, value.c_str()), tag.toString().c_str());
}

void put(DcmItem &item, const DcmTagKey &tag, int value)
{
    check(item.putAndInsertUint16(tag, static_cast<Uint16>(value)), tag.toString().c_str());
}

/* Padding is US or SS by PixelRepresentation; both hold the same 16 bits. */
void put_padding(DcmItem &item, const Options &o, const DcmTagKey &tag, double value)
{
    const int v = static_cast<int>(value);
    check(o.is_unsigned ? item.putAndInsertUint16(DcmTag(tag, EVR_US), static_cast<Uint16>(v))
                        : item.putAndInsertSint16(DcmTag(tag, EVR_SS), static_cast<Sint16>(v)),
          tag.toString().c_str());
}

void put_patient_and_study(DcmDataset &d, const Options &o)
{
    put(d, DCM_PatientName, o.patient);
    put(d, DCM_PatientID, o.patient_id);
    put(d, DCM_PatientBirthDate, "");
    put(d, DCM_PatientSex, "O");
    put(d, DCM_StudyInstanceUID, uid_of(std::string("study ") + o.study));
    put(d, DCM_StudyID, std::string(o.study).substr(0, 16));
    for (const DcmTagKey &date : {DCM_StudyDate, DCM_ContentDate, DCM_AcquisitionDate})
        put(d, date, "20000101");
    for (const DcmTagKey &time : {DCM_StudyTime, DCM_ContentTime, DCM_AcquisitionTime})
        put(d, time, "120000");
    put(d, DCM_AccessionNumber, "");
    put(d, DCM_ReferringPhysicianName, "");
    put(d, DCM_StudyDescription, "made-up data, no patient");
}

void put_series(DcmDataset &d, const Options &o, const std::string &series_uid)
{
    put(d, DCM_Modality, "CT");
    put(d, DCM_SeriesInstanceUID, series_uid);
    put(d, DCM_SeriesNumber, std::to_string(o.series_number));
    put(d, DCM_SeriesDescription, o.description);
    put(d, DCM_BodyPartExamined, "HEAD");
    put(d, DCM_PatientPosition, "HFS");
    put(d, DCM_FrameOfReferenceUID, uid_of(std::string("frame ") + o.study));
    put(d, DCM_PositionReferenceIndicator, "");
    put(d, DCM_Manufacturer, "ctsplat tests");
    put(d, DCM_KVP, "120");
    put(d, DCM_AcquisitionNumber, std::to_string(o.acquisition));
    put(d, DCM_GantryDetectorTilt, decimal(o.tilt_deg));
}

void put_image(DcmDataset &d, const Options &o, const Stack &s, int k)
{
    const double *row = s.direction[0], *column = s.direction[1];
    double at[3];
    stack_position(&o, &s, k, at);
    put(d, DCM_ImageType, o.image_type);
    put(d, DCM_InstanceNumber, std::to_string(o.first_instance + k));
    put(d, DCM_ImagePositionPatient, decimals(at[0], at[1], at[2]));
    put(d, DCM_ImageOrientationPatient, decimals(row[0], row[1], row[2], column[0], column[1], column[2]));
    put(d, DCM_PixelSpacing, decimals(s.spacing_mm[1], s.spacing_mm[0]));
    put(d, DCM_SliceThickness, decimal(o.thickness_mm > 0 ? o.thickness_mm : s.spacing_mm[2]));
    put(d, DCM_SamplesPerPixel, 1);
    put(d, DCM_PhotometricInterpretation, "MONOCHROME2");
    put(d, DCM_Rows, s.n[1]);
    put(d, DCM_Columns, s.n[0]);
    put(d, DCM_BitsAllocated, 16);
    put(d, DCM_BitsStored, o.bits_stored);
    put(d, DCM_HighBit, o.high_bit);
    put(d, DCM_PixelRepresentation, o.is_unsigned ? 0 : 1);
    put(d, DCM_RescaleSlope, decimal(pick(&o.slopes, k)));
    put(d, DCM_RescaleIntercept, decimal(pick(&o.intercepts, k)));
    put(d, DCM_RescaleType, "HU");
    put(d, DCM_WindowCenter, "40");
    put(d, DCM_WindowWidth, "400");
    if (o.padding.n > 0)
        put_padding(d, o, DCM_PixelPaddingValue, o.padding.v[0]);
    if (o.padding.n > 1)
        put_padding(d, o, DCM_PixelPaddingRangeLimit, o.padding.v[1]);
}

/* The meta header is filled here and kept by saveFile(), so that the bytes contain no DCMTK version. */
void put_meta(DcmMetaInfo &m, E_TransferSyntax xfer, const std::string &instance_uid)
{
    const Uint8 version[2] = {0, 1};
    check(m.putAndInsertUint32(DCM_FileMetaInformationGroupLength, 0), "meta header");
    check(m.putAndInsertUint8Array(DCM_FileMetaInformationVersion, version, 2), "meta header");
    put(m, DCM_MediaStorageSOPClassUID, UID_CTImageStorage);
    put(m, DCM_MediaStorageSOPInstanceUID, instance_uid);
    put(m, DCM_TransferSyntaxUID, DcmXfer(xfer).getXferID());
    put(m, DCM_ImplementationClassUID, uid_of("raw2ct"));
    put(m, DCM_ImplementationVersionName, "CTSPLAT_RAW2CT");
    check(m.computeGroupLengthAndPadding(EGL_withGL, EPD_noChange, EXS_LittleEndianExplicit, EET_ExplicitLength),
          "meta header");
}

/* DCMTK's JPEG-LS encoder leaves the byte that makes a fragment's length even uninitialised. */
void clear_pad_byte(DcmDataset &d, E_TransferSyntax xfer)
{
    DcmElement *element = nullptr;
    DcmPixelSequence *sequence = nullptr;
    DcmPixelItem *fragment = nullptr;
    Uint8 *bytes = nullptr;
    check(d.findAndGetElement(DCM_PixelData, element), "PixelData");
    E_TransferSyntax found = EXS_Unknown;
    const DcmRepresentationParameter *parameter = nullptr;
    DcmPixelData *pixels = static_cast<DcmPixelData *>(element);
    pixels->getCurrentRepresentationKey(found, parameter);
    check(pixels->getEncapsulatedRepresentation(xfer, parameter, sequence), "fragments");
    check(sequence->getItem(fragment, 1), "fragment");
    check(fragment->getUint8Array(bytes), "fragment");
    const Uint32 n = fragment->getLength();
    if (n > 2 && bytes[n - 3] == 0xff && bytes[n - 2] == 0xd9)
        bytes[n - 1] = 0;
}

/* DCMTK cannot write JPEG 2000: the stream is encoded here and split into two fragments, as some writers do. */
void put_jpeg2000(DcmDataset &d, const Options &o, const Stack &s, const Pixels &words)
{
    const Jpeg2000 shape = {s.n[0], s.n[1], o.bits_stored, 1, !o.is_unsigned, false};
    std::vector<int32_t> samples(words.size());
    for (size_t i = 0; i < words.size(); i++)
        samples[i] = o.is_unsigned ? words[i] : static_cast<Sint16>(words[i]);
    Jpeg2000Bytes stream = jpeg2000_stream(&shape, samples.data());
    if (stream.n == 0)
        throw std::runtime_error("the pixels cannot be encoded as JPEG 2000");
    std::vector<Uint8> bytes(stream.data, stream.data + stream.n);
    free(stream.data);
    if (bytes.size() % 2)
        bytes.push_back(0);
    DcmPixelSequence *sequence = new DcmPixelSequence(DcmTag(DCM_PixelData, EVR_OB));
    const size_t ends[] = {0, 0, bytes.size() / 4 * 2, bytes.size()};
    for (int i = 0; i < 3; i++) {
        DcmPixelItem *item = new DcmPixelItem(DcmTag(DCM_Item, EVR_OB));
        const size_t n = ends[i + 1] - ends[i];
        if (n)
            check(item->putUint8Array(bytes.data() + ends[i], static_cast<unsigned long>(n)), "fragment");
        check(sequence->insert(item), "fragment");
    }
    DcmPixelData *pixels = new DcmPixelData(DcmTag(DCM_PixelData, EVR_OB));
    pixels->putOriginalRepresentation(EXS_JPEG2000LosslessOnly, nullptr, sequence);
    check(d.insert(pixels, OFTrue), "PixelData");
}

void encode(DcmDataset &d, E_TransferSyntax xfer)
{
    const DJLSRepresentationParameter jpeg_ls(0, OFTrue);
    const DJ_RPLossless jpeg(1, 0);
    const DcmRLERepresentationParameter rle;
    const DcmRepresentationParameter *parameter = nullptr;
    if (xfer == EXS_JPEGLSLossless)
        parameter = &jpeg_ls;
    else if (xfer == EXS_JPEGProcess14SV1)
        parameter = &jpeg;
    else if (xfer == EXS_RLELossless)
        parameter = &rle;
    check(d.chooseRepresentation(xfer, parameter), "the pixels cannot be encoded");
    if (xfer == EXS_JPEGLSLossless)
        clear_pad_byte(d, xfer);
}

/* Everything a viewer can see in a series decides its UID. */
std::string content_uid(const Options &o, const Stack &s)
{
    Hash h;
    h.add(o.syntax);
    Pixels pixels(static_cast<size_t>(s.n[0]) * static_cast<size_t>(s.n[1]));
    for (int k = 0; k < s.n[2]; k++) {
        DcmDataset d;
        put_patient_and_study(d, o);
        put_series(d, o, "");
        put_image(d, o, s, k);
        for (DcmObject *e = nullptr; (e = d.nextInContainer(e)) != nullptr;) {
            OFString value;
            check(static_cast<DcmElement *>(e)->getOFStringArray(value), "header");
            h.add(e->getTag().toString().c_str());
            h.add(value.c_str());
        }
        stack_pixels(&o, &s, k, pixels.data());
        for (const Uint16 v : pixels)
            h.add(v);
    }
    return h.uid();
}

void write_slice(const Options &o, const Stack &s, const std::string &series_uid, int k, int number)
{
    const E_TransferSyntax xfer = syntax_of(o.syntax);
    DcmFileFormat file;
    DcmDataset &d = *file.getDataset();
    Pixels pixels(static_cast<size_t>(s.n[0]) * static_cast<size_t>(s.n[1]));
    stack_pixels(&o, &s, k, pixels.data());
    Hash instance;
    instance.add(series_uid);
    instance.add(static_cast<unsigned>(o.first_instance + k));
    instance.add(o.image_type);
    put(d, DCM_SOPClassUID, UID_CTImageStorage);
    put(d, DCM_SOPInstanceUID, instance.uid());
    put_patient_and_study(d, o);
    put_series(d, o, series_uid);
    put_image(d, o, s, k);
    check(d.putAndInsertUint16Array(DCM_PixelData, pixels.data(), static_cast<unsigned long>(pixels.size())),
          "PixelData");
    if (xfer == EXS_JPEG2000LosslessOnly)
        put_jpeg2000(d, o, s, pixels);
    else
        encode(d, xfer);
    put_meta(*file.getMetaInfo(), xfer, instance.uid());
    char name[32];
    std::snprintf(name, sizeof name, "%04d", number);
    const std::string path = std::string(o.folder) + "/" + o.prefix + name + o.suffix;
    check(file.saveFile(path.c_str(), xfer, EET_ExplicitLength, EGL_withoutGL, EPD_withoutPadding, 0, 0,
                        EWM_dontUpdateMeta),
          path);
}

bool skipped(const Options &o, int k)
{
    for (int i = 0; i < o.skip.n; i++)
        if (o.skip.v[i] == k)
            return true;
    return false;
}

} // namespace

bool write_series(const Options *o, const Stack *stack)
try {
    OFLog::configure(OFLogger::ERROR_LOG_LEVEL);
    DcmRLEEncoderRegistration::registerCodecs();
    DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_never);
    DJLSEncoderRegistration::registerCodecs();
    const std::string series_uid = *o->series_uid ? o->series_uid : content_uid(*o, *stack);
    if (mkdir(o->folder, 0777) && errno != EEXIST)
        throw std::runtime_error(std::string(o->folder) + ": cannot be made: " + std::strerror(errno));
    int number = o->first_instance;
    for (int k = 0; k < stack->n[2]; k++)
        if (!skipped(*o, k))
            write_slice(*o, *stack, series_uid, k, number++);
    DJLSEncoderRegistration::cleanup();
    DJEncoderRegistration::cleanup();
    DcmRLEEncoderRegistration::cleanup();
    return true;
} catch (const std::exception &e) {
    std::fprintf(stderr, "raw2ct: %s\n", e.what());
    return false;
}
