/* The colours of ctsplat's pictures in words that colour management knows: an ICC profile of sRGB. */
#ifndef CTS_EXPORT_ICC_H
#define CTS_EXPORT_ICC_H

#include <stddef.h>
#include <stdint.h>

enum { CTS_ICC_BYTES = 600 };

/* An ICC profile, version 4.3, of the input class, as DICOM wants it (PS3.3 C.11.15): sRGB (IEC 61966-2-1). Returns its
 * length, which is a multiple of 4. The same bytes each time. */
size_t cts_icc_srgb(uint8_t profile[CTS_ICC_BYTES]);

#endif
