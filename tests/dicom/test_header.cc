/* The header reader agrees with DCMTK on a data set's attributes: as in the file, and rewritten with implicit VR and in
 * big endian. */
#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_attributes.hpp"
#include "dicom/header/dcm_read.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <ftw.h>
#include <string>
#include <vector>

namespace
{

int n_read, n_values, n_wrong;

std::string trimmed(std::string text)
{
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0'))
        text.pop_back();
    text.erase(0, text.find_first_not_of(' '));
    return text;
}

void expect(bool same, const char *path, const char *how, const DcmTagKey &tag)
{
    n_values++;
    if (!same && n_wrong++ < 20)
        std::printf("%s, %s: (%04x,%04x) is read otherwise than by DCMTK\n", path, how, tag.getGroup(),
                    tag.getElement());
}

void compare(DcmItem &theirs, CtsAttributes &ours, const char *path, const char *how)
{
    static const DcmTagKey texts[] = {DCM_SpecificCharacterSet,
                                      DCM_ImageType,
                                      DCM_SOPClassUID,
                                      DCM_SOPInstanceUID,
                                      DCM_StudyDate,
                                      DCM_AcquisitionTime,
                                      DCM_ContentTime,
                                      DCM_Modality,
                                      DCM_SeriesDescription,
                                      DCM_PatientName,
                                      DCM_PatientID,
                                      DCM_IssuerOfPatientID,
                                      DCM_PatientBirthDate,
                                      DCM_PatientSex,
                                      DCM_KVP,
                                      DCM_TriggerTime,
                                      DCM_StudyInstanceUID,
                                      DCM_SeriesInstanceUID,
                                      DCM_SeriesNumber,
                                      DCM_AcquisitionNumber,
                                      DCM_InstanceNumber,
                                      DCM_ImagePositionPatient,
                                      DCM_ImageOrientationPatient,
                                      DCM_FrameOfReferenceUID,
                                      DCM_TemporalPositionIdentifier,
                                      DCM_PhotometricInterpretation,
                                      DCM_NumberOfFrames,
                                      DCM_PixelSpacing,
                                      DCM_BurnedInAnnotation,
                                      DCM_RescaleIntercept,
                                      DCM_RescaleSlope,
                                      DCM_RescaleType,
                                      DCM_LossyImageCompression};
    static const DcmTagKey words[] = {DCM_SamplesPerPixel,    DCM_Rows,       DCM_Columns,
                                      DCM_BitsAllocated,      DCM_BitsStored, DCM_HighBit,
                                      DCM_PixelRepresentation};
    for (const DcmTagKey &tag : texts) {
        DcmElement *element = nullptr;
        char *text = nullptr;
        Uint32 n = 0;
        std::string expected;
        if (theirs.findAndGetElement(tag, element).good() && element->getString(text, n).good() && text)
            expected = trimmed(std::string(text, n));
        expect(expected == std::string(cts_attribute_text(ours, tag)) &&
                   cts_attribute_has(ours, tag) == (theirs.tagExists(tag) != 0),
               path, how, tag);
    }
    for (const DcmTagKey &tag : words) {
        DcmElement *element = nullptr;
        Uint16 expected = 0;
        int found = 0;
        const bool there = theirs.findAndGetElement(tag, element).good() && element->ident() == EVR_US &&
                           element->getVM() == 1 && element->getUint16(expected).good();
        expect(cts_attribute_word(ours, tag, &found) == there && (!there || found == expected), path, how, tag);
    }
    for (const DcmTagKey &tag : {DCM_PixelPaddingValue, DCM_PixelPaddingRangeLimit}) {
        DcmElement *element = nullptr;
        Uint16 u = 0;
        Sint16 s = 0;
        unsigned pattern = 0;
        const bool there = theirs.findAndGetElement(tag, element).good() && element->getLength() == 2;
        if (there && element->getUint16(u).bad() && element->getSint16(s).good())
            u = static_cast<Uint16>(s);
        expect(cts_attribute_pattern(ours, tag, &pattern) == there && (!there || pattern == u), path, how, tag);
    }
}

void compare_bytes(DcmItem &theirs, const uint8_t *bytes, size_t n, const CtsSyntax *native, const char *path,
                   const char *how)
{
    static CtsDataScan scan;
    if (cts_scan_data(bytes, n, n, 0, native, CTS_MAX_HEADER_BYTES, &scan) != CTS_SCAN_DONE)
        return;
    const CtsDataSet set = {bytes, scan.header_end, &scan, native};
    CtsAttributes ours{set};
    compare(theirs, ours, path, how);
}

void compare_rewritten(DcmDataset &data, E_TransferSyntax syntax, size_t room, const char *path, const char *how)
{
    std::vector<uint8_t> bytes(room);
    DcmOutputBufferStream out(bytes.data(), static_cast<offile_off_t>(bytes.size()));
    data.remove(DCM_PixelData);
    data.transferInit();
    const OFCondition written = data.write(out, syntax, EET_UndefinedLength, nullptr);
    data.transferEnd();
    void *first = nullptr;
    offile_off_t n = 0;
    out.flushBuffer(first, n);
    if (written.good())
        compare_bytes(data, static_cast<const uint8_t *>(first), static_cast<size_t>(n),
                      cts_syntax_find(DcmXfer(syntax).getXferID()), path, how);
}

int visit(const char *path, const struct stat *info, int type, struct FTW *)
{
    CtsMetaScan meta;
    static CtsDataScan scan;
    if (type != FTW_F || info->st_size < 132 || std::strstr(path, "/uid-control")) /* refused; DCMTK mends it */
        return 0;
    std::vector<uint8_t> bytes(static_cast<size_t>(info->st_size));
    FILE *file = std::fopen(path, "rbe");
    const bool read = file && std::fread(bytes.data(), 1, bytes.size(), file) == bytes.size();
    if (file)
        std::fclose(file);
    if (!read || cts_scan_meta(bytes.data(), bytes.size(), bytes.size(), &meta) != CTS_SCAN_DONE)
        return 0;
    const CtsSyntax *named = cts_syntax_find(meta.syntax_uid);
    if (!named || named->deflated)
        return 0;
    const CtsSyntax *native = cts_syntax_native(named->explicit_vr, named->big_endian);
    const uint8_t *const start = bytes.data() + meta.data_offset;
    if (cts_scan_data(start, bytes.size() - meta.data_offset, UINT64_MAX, 0, native, CTS_MAX_HEADER_BYTES, &scan) !=
        CTS_SCAN_DONE)
        return 0;
    DcmDataset data;
    DcmInputBufferStream in;
    in.setBuffer(start, static_cast<offile_off_t>(scan.header_end));
    in.setEos();
    data.transferInit();
    const OFCondition parsed = data.read(in, DcmXfer(native->uid).getXfer(), EGL_noChange);
    data.transferEnd();
    if (parsed.bad())
        return 0;
    n_read++;
    const size_t room = 2 * scan.header_end + 1024;
    compare_bytes(data, start, scan.header_end, native, path, "as it is");
    compare_rewritten(data, EXS_LittleEndianImplicit, room, path, "with implicit VR");
    compare_rewritten(data, EXS_BigEndianExplicit, room, path, "in big endian");
    return 0;
}

} // namespace

int main(int argc, char **argv)
{
    CtsError err = {};
    if (argc != 2 || cts_dcm_start(&err) || nftw(argv[1], visit, 16, FTW_PHYS)) {
        std::printf("test_header TESTDATA: %s\n", err.text);
        return 1;
    }
    std::printf("%d files, %d values, %d of them wrong\n", n_read, n_values, n_wrong);
    return n_wrong || n_values < 10000;
}
