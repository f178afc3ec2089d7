/* Secondary captures read with DCMTK. */
#include <dcmtk/config/osconfig.h>

#include "output/objects/dcm_sc_read.h"

#include "ctsplat/bounds.h"
#include "input/header/dcm_door.hpp"
#include "input/header/dcm_read.h"
#include <dcmtk/dcmdata/dctk.h>
#include <string.h>

namespace
{

int word_of(DcmItem &item, const DcmTagKey &tag, int missing)
{
    Uint16 value = 0;
    return item.findAndGetUint16(tag, value).good() ? value : missing;
}

CtsStatus refuse(CtsError *err, const char *why)
{
    return cts_fail(err, CTS_ERR_READ, "is no picture that can be read: %s", why);
}

CtsStatus read_header(DcmDataset &data, CtsScHeader *h, CtsError *err)
{
    OFString colours;
    Sint32 n_frames = 1;
    data.findAndGetOFString(DCM_PhotometricInterpretation, colours);
    if (data.tagExists(DCM_NumberOfFrames) && data.findAndGetSint32(DCM_NumberOfFrames, n_frames).bad())
        return refuse(err, "its number of frames is no number");
    *h = CtsScHeader{word_of(data, DCM_Columns, 0),
                     word_of(data, DCM_Rows, 0),
                     n_frames,
                     word_of(data, DCM_SamplesPerPixel, 1),
                     word_of(data, DCM_BitsAllocated, 0),
                     word_of(data, DCM_BitsStored, 0),
                     word_of(data, DCM_PlanarConfiguration, 0) == 1,
                     colours == "MONOCHROME1"};
    if (h->width < 1 || h->height < 1 || h->width > CTS_MAX_SIDE || h->height > CTS_MAX_SIDE || n_frames < 1)
        return refuse(err, "its size is not within what a picture can have");
    const bool colour = h->n_samples == 3 && h->bits_allocated == 8 && h->bits_stored == 8 &&
                        (colours == "RGB" || colours == "YBR_RCT");
    const bool grey = h->n_samples == 1 && (h->bits_allocated == 8 || h->bits_allocated == 16) && h->bits_stored >= 1 &&
                      h->bits_stored <= h->bits_allocated && (colours == "MONOCHROME1" || colours == "MONOCHROME2");
    if ((!colour && !grey) || word_of(data, DCM_PixelRepresentation, 0) != 0 ||
        word_of(data, DCM_HighBit, h->bits_stored - 1) != h->bits_stored - 1)
        return refuse(err, "its pixels are neither RGB of 8 bits nor unsigned grey");
    return CTS_OK;
}

} // namespace

extern "C" CtsStatus cts_dcm_sc_header(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsScHeader *header,
                                       CtsError *err)
try {
    DcmDataset data;
    const CtsStatus st = cts_dcm_start(err);
    if (st)
        return st;
    const CtsDcmUse use(cts_dcm_in_use());
    const OFCondition result = cts_dcm_parse(data, data_set, n, native);
    if (result.bad())
        return cts_fail(err, cts_dcm_status(result, CTS_ERR_READ), "cannot be parsed as DICOM: %s", result.text());
    return read_header(data, header, err);
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}
