/* Values of DICOM headers, and the C interface to DCMTK for reading. No DCMTK type and no exception crosses it. All
 * calls are thread-safe. */
#pragma once

#include "ctsplat/api.h"
#include "ctsplat/status.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Must precede any other use of DCMTK: turns its log off and loads the data dictionary, which takes several ms. Later
 * calls return the first result. */
CtsStatus cts_dcm_start(CtsError *err);

/* Text in a DICOM character set (0008,0005; NULL: ASCII) as UTF-8, at most 64 characters; controls and inconvertible
 * characters become '?'. NULL without memory. */
char *cts_dcm_utf8(const char *text, const char *charset);
/* The same, of any length and with all that is in it; NULL when it cannot, too. Free with free(). */
char *cts_dcm_convert(const char *text, const char *charset);

CTS_C_END
