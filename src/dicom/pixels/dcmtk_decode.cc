/* Decodes one RLE, JPEG or JPEG-LS frame with DCMTK's codecs. */
#include "dicom/pixels/dcmtk_frame.hpp"

#include <cstdio>
#include <cstring>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/oflog.h>
#include <dcmtk/oflog/spi/logevent.h>
#include <memory>

namespace log4cplus = dcmtk::log4cplus;

namespace
{

/* DCMTK's warnings and errors about one frame, and the first one's text. */
struct Complaints {
    unsigned n = 0;
    char first[120] = "";
};

/* Counts in place of printing. */
class CountingAppender : public log4cplus::Appender
{
  public:
    ~CountingAppender() override
    {
        destructorImpl();
    }
    void close() override
    {
        closed = true;
    }
    static Complaints complaints; /* of this process, which has one thread */

  protected:
    void append(const log4cplus::spi::InternalLoggingEvent &event) override
    {
        if (complaints.n++ == 0)
            std::snprintf(complaints.first, sizeof complaints.first, "%s", event.getMessage().c_str());
    }
};
Complaints CountingAppender::complaints;

/* The stream as the single fragment of a frame. */
void wrap(DcmPixelSequence &sequence, const uint8_t *stream, size_t n)
{
    DcmOffsetList offsets;
    std::unique_ptr<DcmPixelItem> table(new DcmPixelItem(DcmTag(DCM_Item, EVR_OB)));
    cts_dcm_check(sequence.insert(table.get()));
    table.release();
    cts_dcm_check(sequence.storeCompressedFrame(offsets, const_cast<Uint8 *>(stream), static_cast<Uint32>(n), 0));
}

} // namespace

CtsStatus cts_dcm_start_decoders(CtsError *err)
try {
    OFLog::configure(OFLogger::WARN_LOG_LEVEL);
    log4cplus::Logger root = log4cplus::Logger::getRoot();
    /* Silenced, not removed: an appender's destructor allocates, and without memory ends the program. */
    for (const log4cplus::SharedAppenderPtr &appender : root.getAllAppenders())
        appender->setThreshold(log4cplus::OFF_LOG_LEVEL);
    root.addAppender(log4cplus::SharedAppenderPtr(new CountingAppender));
    DcmRLEDecoderRegistration::registerCodecs();
    DJDecoderRegistration::registerCodecs();
    DJLSDecoderRegistration::registerCodecs();
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}

CtsStatus cts_dcm_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
try {
    if (n > 0xFFFFFFF0u)
        return cts_fail(err, CTS_ERR_PIXELS, "its compressed frame has more than 4 GiB");
    const E_TransferSyntax xfer = DcmXfer(format->syntax->uid).getXfer();
    DcmDataset data_set;
    std::unique_ptr<DcmPixelSequence> sequence(new DcmPixelSequence(DcmTag(DCM_PixelData, EVR_OB)));
    wrap(*sequence, stream, n);
    cts_dcm_describe_frame(data_set, *format);
    DcmPixelData pixel_data(DcmTag(DCM_PixelData, EVR_OB));
    pixel_data.putOriginalRepresentation(xfer, nullptr, sequence.release());
    const size_t n_bytes = cts_frame_bytes(format);
    Uint32 fragment = 0;
    OFString colour_model;
    const Complaints &complaints = CountingAppender::complaints = Complaints();
    const OFCondition result = pixel_data.getUncompressedFrame(
        &data_set, 0, fragment, pixels, static_cast<Uint32>(n_bytes + n_bytes % 2), colour_model);
    if (result.bad())
        return cts_fail(err, result == EC_MemoryExhausted ? CTS_ERR_MEMORY : CTS_ERR_PIXELS,
                        "its compressed pixels cannot be decoded: %s", result.text());
    if (format->n_colours > 0 && colour_model != "RGB")
        return cts_fail(err, CTS_ERR_PIXELS, "its pixels decode to %s, not to RGB", colour_model.c_str());
    if (complaints.n > 0)
        return cts_fail(err, CTS_ERR_PIXELS, "its compressed pixels are damaged: %s", complaints.first);
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_PIXELS);
}
