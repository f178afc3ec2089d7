/* Text of any DICOM character set in UTF-8. */
#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"

#include <cstring>
#include <dcmtk/dcmdata/dcspchrs.h>

char *cts_dcm_convert(const char *text, const char *charset)
try {
    if (cts_dcm_start(nullptr) || !DcmSpecificCharacterSet::isConversionAvailable())
        return nullptr;
    const CtsDcmUse use(cts_dcm_in_use());
    OFString out;
    DcmSpecificCharacterSet converter;
    if (converter.selectCharacterSet(charset).bad() || converter.convertString(text, out).bad())
        return nullptr;
    return strdup(out.c_str());
} catch (...) {
    return nullptr;
}
