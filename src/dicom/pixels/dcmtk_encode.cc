/* One frame compressed without loss by DCMTK. */
#include "dicom/pixels/dcmtk_frame.hpp"

#include <cstring>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dcrlerp.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <memory>

namespace
{

/* The minimal attributes for DCMTK's encoders, and the samples. */
void put_frame(DcmDataset &data, const CtsFrameFormat &format, const uint8_t *samples, unsigned long n)
{
    std::unique_ptr<DcmPixelData> pixels(new DcmPixelData(DcmTag(DCM_PixelData)));
    cts_dcm_check(data.putAndInsertString(DCM_SOPClassUID, UID_SecondaryCaptureImageStorage));
    cts_dcm_check(data.putAndInsertString(DCM_SOPInstanceUID, "2.25.0"));
    cts_dcm_describe_frame(data, format);
    cts_dcm_check(format.n_colours ? pixels->putUint8Array(samples, n)
                                   : pixels->putUint16Array(reinterpret_cast<const Uint16 *>(samples), n / 2));
    if (!pixels->valueLoaded())
        throw std::bad_alloc();
    cts_dcm_check(data.insert(pixels.get()));
    pixels.release();
}

/* The only fragment of a frame: a size_t, then its bytes. */
CtsStatus take_fragment(DcmPixelSequence &fragments, void *answer, size_t n_answer, CtsError *err)
{
    DcmPixelItem *item = nullptr;
    Uint8 *bytes = nullptr;
    /* 0 is the table of offsets */
    if (fragments.card() != 2 || fragments.getItem(item, 1).bad() || item->getUint8Array(bytes).bad() || !bytes)
        return cts_fail(err, CTS_ERR_OUTPUT, "it cannot be taken from DCMTK");
    const size_t n = item->getLength();
    if (n > n_answer - sizeof n)
        return cts_fail(err, CTS_ERR_OUTPUT, "it grows too much");
    std::memcpy(answer, &n, sizeof n);
    std::memcpy(static_cast<uint8_t *>(answer) + sizeof n, bytes, n);
    return CTS_OK;
}

} // namespace

CtsStatus cts_dcm_start_encoders(CtsError *err)
try {
    const CtsStatus st = cts_dcm_start(err);
    DcmRLEEncoderRegistration::registerCodecs();
    DJEncoderRegistration::registerCodecs();
    return st;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}

CtsStatus cts_pixels_encode(const void *order, const uint8_t *samples, size_t n, void *answer, size_t n_answer,
                            CtsError *err)
try {
    CtsFrameOrder frame;
    std::memcpy(&frame, order, sizeof frame);
    const E_TransferSyntax syntax = DcmXfer(cts_syntax_by_number(frame.syntax_number)->uid).getXfer();
    const DcmRLERepresentationParameter rle;
    const DJ_RPLossless jpeg;
    const DcmRepresentationParameter *parameter = &rle;
    if (syntax == EXS_JPEGProcess14SV1)
        parameter = &jpeg;
    DcmDataset data;
    DcmElement *element = nullptr;
    DcmPixelSequence *fragments = nullptr;
    put_frame(data, frame.format, samples, static_cast<unsigned long>(n));
    cts_dcm_check(data.chooseRepresentation(syntax, parameter));
    cts_dcm_check(data.findAndGetElement(DCM_PixelData, element));
    cts_dcm_check(dynamic_cast<DcmPixelData &>(*element).getEncapsulatedRepresentation(syntax, parameter, fragments));
    return take_fragment(*fragments, answer, n_answer, err);
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_OUTPUT);
}
