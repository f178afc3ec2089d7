/* A thumbnail of the middle frame of any image, as DCMTK renders it. */
#include "dicom/dcmtk/dcmtk_failures.hpp"
#include "dicom/pixels/pixel_tasks.h"
#include "dicom/protocol/dicom_begin.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmimage/diregist.h> /* makes DicomImage take colours */
#include <dcmtk/dcmimgle/dcmimage.h>
#include <memory>
#include <vector>

namespace
{

/* The fragments of a frame, joined: all where there is one frame, else one for each. */
std::vector<uint8_t> frame_stream(DcmPixelSequence &sequence, int frame, int n_frames)
{
    std::vector<uint8_t> stream;
    const unsigned long n = sequence.card() - 1; /* without the offset table */
    for (unsigned long i = 0; i < n; i++) {
        DcmPixelItem *item = nullptr;
        Uint8 *bytes = nullptr;
        if ((n_frames > 1 && (n != static_cast<unsigned long>(n_frames) || i != static_cast<unsigned long>(frame))) ||
            sequence.getItem(item, i + 1).bad() || item->getUint8Array(bytes).bad() || !bytes)
            continue;
        stream.insert(stream.end(), bytes, bytes + item->getLength());
    }
    return stream;
}

int word(DcmItem &data, const DcmTagKey &tag)
{
    Uint16 value = 0;
    data.findAndGetUint16(tag, value);
    return value;
}

/* Replaces the JPEG 2000 pixels, which DCMTK does not decode, by those of one frame. */
CtsStatus unpack_jpeg2000(DcmDataset &data, const CtsSyntax *syntax, int frame, int n_frames, CtsError *err)
{
    DcmElement *element = nullptr;
    DcmPixelSequence *sequence = nullptr;
    CtsFrameFormat f = {};
    f.syntax = syntax;
    f.n_colours = word(data, DCM_SamplesPerPixel) > 1 ? word(data, DCM_SamplesPerPixel) : 0;
    f.columns = word(data, DCM_Columns);
    f.rows = word(data, DCM_Rows);
    f.bits_allocated = word(data, DCM_BitsAllocated);
    f.bits_stored = word(data, DCM_BitsStored);
    f.high_bit = word(data, DCM_HighBit);
    f.is_signed = word(data, DCM_PixelRepresentation);
    f.padding_word = -1;
    if (data.findAndGetElement(DCM_PixelData, element).bad() || element->ident() != EVR_PixelData ||
        static_cast<DcmPixelData *>(element)->getEncapsulatedRepresentation(EXS_JPEG2000, nullptr, sequence).bad() ||
        (f.bits_allocated != 8 && f.bits_allocated != 16) || f.n_colours > 3)
        return cts_fail(err, CTS_ERR_PIXELS, "its JPEG 2000 pixels are not in frames of 8 or 16 bits");
    const std::vector<uint8_t> stream = frame_stream(*sequence, frame, n_frames);
    std::vector<uint16_t> pixels(cts_frame_bytes(&f) / 2 + 1);
    const CtsStatus st = cts_jpeg2000_decode(&f, stream.data(), stream.size(), pixels.data(), err);
    if (st)
        return st;
    data.findAndDeleteElement(DCM_PixelData);
    const unsigned long n = static_cast<unsigned long>(cts_frame_bytes(&f));
    OFString colours;
    data.findAndGetOFString(DCM_PhotometricInterpretation, colours);
    if (colours == "YBR_RCT" || colours == "YBR_ICT")
        data.putAndInsertString(DCM_PhotometricInterpretation, "RGB");
    data.putAndInsertUint16(DCM_PlanarConfiguration, 0);
    data.putAndInsertString(DCM_NumberOfFrames, "1");
    const OFCondition put =
        f.bits_allocated == 8
            ? data.putAndInsertUint8Array(DCM_PixelData, reinterpret_cast<Uint8 *>(pixels.data()), n + n % 2)
            : data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), n / 2);
    return put.good() ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

/* The image within the box, with square pixels. */
std::unique_ptr<DicomImage> reduced(const DicomImage &image, const CtsImageBox &box)
{
    const double columns = static_cast<double>(image.getWidth()), ratio = image.getHeightWidthRatio();
    const double rows = static_cast<double>(image.getHeight()) * (ratio > 0 && std::isfinite(ratio) ? ratio : 1);
    const double scale = std::min({1.0, box.width / columns, box.height / rows});
    const auto side = [=](double n, int most) {
        return static_cast<unsigned long>(std::clamp(std::lround(n * scale), 1L, static_cast<long>(most)));
    };
    return std::unique_ptr<DicomImage>(image.createScaledImage(side(columns, box.width), side(rows, box.height), 1, 0));
}

/* The first window or VOI LUT of the header, else the values without a hundredth at either end. */
void choose_values(DicomImage &image)
{
    const double outliers = 0.01;
    image.hideAllOverlays();
    if (!image.isMonochrome() || (image.getWindowCount() && image.setWindow(0)) ||
        (image.getVoiLutCount() && image.setVoiLut(0)))
        return;
    if (!image.setHistogramWindow(outliers))
        image.setMinMaxWindow();
}

CtsStatus render(DcmDataset &data, E_TransferSyntax xfer, int frame, const CtsImageBox &box, void *answer,
                 CtsError *err)
{
    DicomImage image(&data, xfer, CIF_UsePartialAccessToPixelData | CIF_NeverAccessEmbeddedOverlays,
                     static_cast<unsigned long>(frame), 1);
    if (image.getStatus() != EIS_Normal)
        return cts_fail(err, CTS_ERR_PIXELS, "DCMTK cannot show its pixels (%s)",
                        DicomImage::getString(image.getStatus()));
    const std::unique_ptr<DicomImage> small = reduced(image, box);
    if (!small || small->getStatus() != EIS_Normal)
        return cts_fail(err, CTS_ERR_PIXELS, "DCMTK cannot reduce its pixels");
    choose_values(*small);
    const auto *const values = static_cast<const uint8_t *>(small->getOutputData(8));
    if (!values)
        return cts_fail(err, CTS_ERR_PIXELS, "DCMTK cannot show its pixels");
    const CtsImageBox size = {static_cast<int>(small->getWidth()), static_cast<int>(small->getHeight())};
    std::memcpy(answer, &size, sizeof size);
    auto *const rgb = static_cast<uint8_t *>(answer) + sizeof size;
    const size_t n = small->getWidth() * small->getHeight(), per_pixel = small->isMonochrome() ? 1 : 3;
    for (size_t i = 0; i < 3 * n; i++)
        rgb[i] = values[per_pixel == 3 ? i : i / 3];
    return CTS_OK;
}

} // namespace

CtsStatus cts_dcm_start_images(CtsError *err)
{
    const CtsStatus st = cts_dcm_start(err);
    return st ? st : cts_dcm_start_decoders(err);
}

CtsStatus cts_pixels_image(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                           CtsError *err)
try {
    CtsMetaScan meta;
    DcmDataset data;
    CtsImageBox box;
    std::memcpy(&box, order, sizeof box);
    if (box.width < 1 || box.height < 1 || n_answer < cts_image_bytes(box))
        return cts_fail(err, CTS_ERR_INTERNAL, "its thumbnail has no room");
    const CtsSyntax *syntax =
        cts_scan_meta(stream, n, n, &meta) == CTS_SCAN_DONE ? cts_syntax_find(meta.syntax_uid) : nullptr;
    if (!syntax && !meta.syntax_uid[0])
        syntax = cts_scan_guess(stream + meta.data_offset, n - meta.data_offset);
    const bool is_2000 = syntax && syntax->codec == CTS_CODEC_JPEG_2000;
    const E_TransferSyntax xfer = is_2000 ? EXS_JPEG2000 : syntax ? DcmXfer(syntax->uid).getXfer() : EXS_Unknown;
    if (xfer == EXS_Unknown)
        return cts_fail(err, CTS_ERR_PIXELS, "its transfer syntax cannot be decoded by this build");
    DcmInputBufferStream in;
    in.setBuffer(stream + meta.data_offset, static_cast<offile_off_t>(n - meta.data_offset));
    in.setEos();
    data.transferInit();
    const OFCondition parsed = data.read(in, xfer);
    data.transferEnd();
    if (parsed.bad())
        return cts_fail(err, CTS_ERR_PIXELS, "DCMTK cannot read it (%s)", parsed.text());
    Sint32 n_frames = 1;
    if (data.findAndGetSint32(DCM_NumberOfFrames, n_frames).bad() || n_frames < 1)
        n_frames = 1;
    const CtsStatus st = is_2000 ? unpack_jpeg2000(data, syntax, n_frames / 2, n_frames, err) : CTS_OK;
    return st ? st
              : render(data, is_2000 ? EXS_LittleEndianExplicit : xfer, is_2000 ? 0 : n_frames / 2, box, answer, err);
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_PIXELS);
}
