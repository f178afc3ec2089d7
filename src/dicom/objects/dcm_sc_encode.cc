/* One frame of a secondary capture compressed with DCMTK, so that no more than a frame is in memory. */
#include <dcmtk/config/osconfig.h>

#include "dicom/objects/objects.h"

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"
#include "dicom/objects/dcm_put.hpp"
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

/* Lives until exit, like the decoders (dcm_start.cc). */
class Encoders final
{
  public:
    Encoders()
    {
        DcmRLEEncoderRegistration::registerCodecs();
        DJEncoderRegistration::registerCodecs();
    }
    ~Encoders()
    {
        DJEncoderRegistration::cleanup();
        DcmRLEEncoderRegistration::cleanup();
    }
    Encoders(const Encoders &) = delete;
    Encoders &operator=(const Encoders &) = delete;
};

/* The minimal attributes for DCMTK's encoders. */
OFCondition describe(DcmDataset &data, const CtsScFrame &frame)
{
    const int bits = frame.grey ? 16 : 8;
    Put put(data);
    put.text(DCM_SOPClassUID, UID_SecondaryCaptureImageStorage).text(DCM_SOPInstanceUID, "2.25.0");
    put.word(DCM_SamplesPerPixel, frame.grey ? 1 : 3).word(DCM_PixelRepresentation, 0);
    put.text(DCM_PhotometricInterpretation, frame.grey ? "MONOCHROME2" : "RGB");
    if (!frame.grey)
        put.word(DCM_PlanarConfiguration, 0);
    put.word(DCM_Rows, frame.height).word(DCM_Columns, frame.width).word(DCM_BitsAllocated, bits);
    put.word(DCM_BitsStored, bits).word(DCM_HighBit, bits - 1);
    std::unique_ptr<DcmPixelData> pixels(new DcmPixelData(DcmTag(DCM_PixelData)));
    if (frame.grey)
        put.keep(pixels->putUint16Array(static_cast<const Uint16 *>(frame.samples),
                                        static_cast<unsigned long>(frame.n_samples_bytes / 2)));
    else
        put.keep(pixels->putUint8Array(static_cast<const Uint8 *>(frame.samples),
                                       static_cast<unsigned long>(frame.n_samples_bytes)));
    if (!pixels->valueLoaded())
        put.keep(EC_MemoryExhausted);
    return put.element(pixels.release()).state();
}

CtsStatus hand_over(DcmPixelSequence &fragments, CtsScSink sink, void *context, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (unsigned long i = 1; i < fragments.card() && !st; i++) { /* 0 is the table of offsets */
        DcmPixelItem *item = nullptr;
        Uint8 *bytes = nullptr;
        if (fragments.getItem(item, i).bad() || item->getUint8Array(bytes).bad() || !bytes)
            return cts_fail(err, CTS_ERR_OUTPUT, "a compressed frame cannot be taken from DCMTK");
        st = sink(context, bytes, item->getLength(), err);
    }
    return st;
}

CtsStatus encode(const char *syntax_uid, const CtsScFrame &frame, CtsScSink sink, void *context, CtsError *err)
{
    const CtsStatus st = cts_dcm_start(err);
    if (st)
        return st;
    static const Encoders encoders;
    const E_TransferSyntax syntax = DcmXfer(syntax_uid).getXfer();
    const DcmRLERepresentationParameter rle;
    const DJ_RPLossless jpeg;
    const DcmRepresentationParameter *parameter = &rle;
    if (syntax == EXS_JPEGProcess14SV1)
        parameter = &jpeg;
    DcmDataset data;
    DcmElement *element = nullptr;
    DcmPixelSequence *fragments = nullptr;
    OFCondition state = describe(data, frame);
    if (state.good())
        state = data.chooseRepresentation(syntax, parameter);
    if (state.good())
        state = data.findAndGetElement(DCM_PixelData, element);
    DcmPixelData *pixels = dynamic_cast<DcmPixelData *>(element);
    if (state.good())
        state = pixels ? pixels->getEncapsulatedRepresentation(syntax, parameter, fragments) : EC_UnsupportedEncoding;
    return state.good() && fragments
               ? hand_over(*fragments, sink, context, err)
               : cts_fail(err, CTS_ERR_OUTPUT, "a frame of %d x %d pixels cannot be compressed: %s", frame.width,
                          frame.height, state.text());
}

} // namespace

extern "C" CtsStatus cts_dcm_sc_encode(const char *syntax_uid, const CtsScFrame *frame, CtsScSink sink, void *context,
                                       CtsError *err)
{
    return cts_dcm_guarded(err, CTS_ERR_OUTPUT, [&] { return encode(syntax_uid, *frame, sink, context, err); });
}
