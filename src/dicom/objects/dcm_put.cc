#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_call.hpp"
#include "dicom/objects/dcm_put.hpp"

#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <memory>
#include <string>
#include <vector>

namespace
{

/* Names this implementation of DICOM writing (PS3.7 D.3.3.2); made once, like any UID. */
const char *const implementation_uid = "2.25.67028870792169200667320284542246776385";
const size_t piece_bytes = 1 << 20; /* of one write; changes no file */

void drop_private(DcmItem &item)
{
    for (unsigned long i = item.card(); i-- > 0;) {
        DcmElement *element = item.getElement(i);
        if (element->getTag().isPrivate())
            delete item.remove(i);
        else if (DcmSequenceOfItems *sequence = dynamic_cast<DcmSequenceOfItems *>(element))
            for (unsigned long k = 0; k < sequence->card(); k++)
                drop_private(*sequence->getItem(k));
    }
}

/* Without memory for a value, DCMTK may omit it and report success. */
bool whole(DcmItem &item)
{
    for (unsigned long i = 0; i < item.card(); i++) {
        DcmElement *element = item.getElement(i);
        if (DcmSequenceOfItems *sequence = dynamic_cast<DcmSequenceOfItems *>(element)) {
            for (unsigned long k = 0; k < sequence->card(); k++)
                if (!whole(*sequence->getItem(k)))
                    return false;
        } else if (element->loadAllDataIntoMemory().bad() || !element->valueLoaded())
            return false;
    }
    return true;
}

/* Zeros with which some devices pad texts are not valid in any character set (PS3.5 6.1.3): each value is truncated at
 * its first zero. */
OFCondition drop_zeros(DcmItem &item)
{
    OFCondition state = EC_Normal;
    for (unsigned long i = 0; i < item.card() && state.good(); i++)
        state = cts_dcm_drop_zeros(*item.getElement(i));
    return state;
}

bool has_meta(DcmMetaInfo &meta)
{
    for (const DcmTagKey &tag :
         {DCM_FileMetaInformationGroupLength, DCM_FileMetaInformationVersion, DCM_MediaStorageSOPClassUID,
          DCM_MediaStorageSOPInstanceUID, DCM_TransferSyntaxUID, DCM_ImplementationClassUID})
        if (!meta.tagExistsWithValue(tag))
            return false;
    return true;
}

/* DCMTK fills the meta header with names of its own; these are ours. */
OFCondition put_meta(DcmFileFormat &file, E_TransferSyntax syntax)
{
    char version[17];
    std::snprintf(version, sizeof version, "CTSPLAT_%.8s", CTS_VERSION);
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

} // namespace

OFCondition cts_dcm_drop_zeros(DcmElement &element)
{
    if (DcmSequenceOfItems *sequence = dynamic_cast<DcmSequenceOfItems *>(&element)) {
        OFCondition state = EC_Normal;
        for (unsigned long k = 0; k < sequence->card() && state.good(); k++)
            state = drop_zeros(*sequence->getItem(k));
        return state;
    }
    DcmByteString *text = dynamic_cast<DcmByteString *>(&element);
    char *bytes = nullptr;
    Uint32 n = 0;
    if (!text || text->getString(bytes, n).bad() || !bytes || !std::memchr(bytes, 0, n))
        return EC_Normal;
    std::string clean;
    bool padding = false;
    for (Uint32 i = 0; i < n; i++) {
        padding = bytes[i] == 0 || (padding && bytes[i] != '\\');
        if (!padding)
            clean += bytes[i];
    }
    return text->putString(clean.c_str(), static_cast<Uint32>(clean.size()));
}

std::string cts_dcm_decimal(double value)
{
    char digits[64];
    for (int precision = 16; precision > 0; precision--) {
        OFStandard::ftoa(digits, sizeof digits, value, 0, 0, precision);
        if (std::strlen(digits) <= 16)
            break;
    }
    return digits;
}

void cts_dcm_copy(Put &put, DcmItem &from, const DcmTagKey &tag, bool filled)
{
    DcmElement *found = nullptr;
    if (from.findAndGetElement(tag, found).bad() || !found)
        return;
    std::unique_ptr<DcmElement> copy(dynamic_cast<DcmElement *>(found->clone()));
    if (!copy || copy->compare(*found) != 0) { /* without memory for it, a copy's value is left empty in silence */
        put.keep(EC_MemoryExhausted);
        return;
    }
    if (DcmSequenceOfItems *sequence = dynamic_cast<DcmSequenceOfItems *>(copy.get()))
        for (unsigned long k = 0; k < sequence->card(); k++)
            drop_private(*sequence->getItem(k));
    put.keep(cts_dcm_drop_zeros(*copy));
    if (!filled || copy->getLength() > 0)
        put.element(copy.release());
}

Put &cts_dcm_put_profile(Put &put, const DcmTagKey &tag)
{
    return put.bytes(tag, cts_icc_srgb, CTS_ICC_BYTES);
}

const char *cts_dcm_text(DcmItem &item, const DcmTagKey &tag)
{
    const char *text = nullptr;
    return item.findAndGetString(tag, text).good() && text ? text : "";
}

CtsStatus cts_dcm_load(DcmDataset &data, const CtsDataSet &set, CtsError *err)
{
    DcmInputBufferStream in;
    in.setBuffer(set.bytes, static_cast<offile_off_t>(set.n));
    in.setEos();
    data.transferInit();
    const OFCondition state = data.read(in, DcmXfer(set.native->uid).getXfer(), EGL_noChange);
    data.transferEnd();
    return state.good() ? CTS_OK
                        : cts_fail(err, cts_dcm_status(state, CTS_ERR_READ),
                                   "a slice cannot be read for a DICOM output: %s", state.text());
}

CtsStatus cts_dcm_stream(DcmFileFormat &file, E_TransferSyntax syntax, CtsScSink sink, void *context, CtsError *err)
{
    std::vector<char> buffer(piece_bytes);
    DcmOutputBufferStream out(buffer.data(), static_cast<offile_off_t>(buffer.size()));
    CtsStatus st = CTS_OK;
    OFCondition state = put_meta(file, syntax);
    if (state.good() && !(has_meta(*file.getMetaInfo()) && whole(*file.getMetaInfo()) && whole(*file.getDataset())))
        state = EC_MemoryExhausted;
    if (state.good())
        file.transferInit();
    while (state.good() && st == CTS_OK) {
        void *piece = nullptr;
        offile_off_t n = 0;
        const OFCondition written = file.write(out, syntax, EET_ExplicitLength, nullptr, EGL_withoutGL,
                                               EPD_withoutPadding, 0, 0, 0, EWM_dontUpdateMeta);
        out.flushBuffer(piece, n);
        if (n > 0)
            st = sink(context, piece, static_cast<size_t>(n), err);
        if (written.good())
            break;
        if (written != EC_StreamNotifyClient)
            state = written;
    }
    file.transferEnd();
    return st || state.good() ? st
                              : cts_fail(err, cts_dcm_status(state, CTS_ERR_OUTPUT),
                                         "the DICOM object cannot be encoded: %s", state.text());
}
