#include "dicom/objects/objects.h"

/* sRGB (IEC 61966-2-1) as a display profile of ICC version 4.3, in the sequence of ICC.1:2010: header (class scnr, RGB
 * to XYZ, D50); tags desc, cprt, wtpt, chad (D65 to D50 by Bradford's method), rXYZ, gXYZ, bXYZ (the primaries adapted
 * with it), and one parametric curve of type 3 (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045) for rTRC, gTRC and
 * bTRC. Numbers are s15Fixed16, big-endian. */
const uint8_t cts_icc_srgb[CTS_ICC_BYTES] = {
#include <srgb.inc>
};
