/* A frame's format as attributes, for DCMTK's codecs. */
#pragma once

#include "dicom/dcmtk/dcmtk_failures.hpp"
#include "dicom/pixels/pixel_tasks.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <utility>

/* The attributes that codecs use, as the frame has them: a file's header may have others. Explicit VRs avoid look-ups
 * in the dictionary. Throws as cts_dcm_check() does. */
inline void cts_dcm_describe_frame(DcmItem &data, const CtsFrameFormat &f)
{
    const std::pair<DcmTagKey, int> numbers[] = {{DCM_SamplesPerPixel, f.n_colours > 0 ? f.n_colours : 1},
                                                 {DCM_PlanarConfiguration, 0},
                                                 {DCM_Rows, f.rows},
                                                 {DCM_Columns, f.columns},
                                                 {DCM_BitsAllocated, f.bits_allocated},
                                                 {DCM_BitsStored, f.bits_stored},
                                                 {DCM_HighBit, f.high_bit},
                                                 {DCM_PixelRepresentation, f.is_signed ? 1 : 0}};
    cts_dcm_check(data.putAndInsertString(DcmTag(DCM_PhotometricInterpretation, EVR_CS),
                                          f.n_colours > 0 ? "RGB" : "MONOCHROME2"));
    for (const auto &[tag, value] : numbers)
        cts_dcm_check(data.putAndInsertUint16(DcmTag(tag, EVR_US), static_cast<Uint16>(value)));
}
