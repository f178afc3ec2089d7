/* DCMTK data set -> slice record. */
#include <dcmtk/config/osconfig.h>

#include "input/header/dcm_door.hpp"
#include "input/header/dcm_parsed.hpp"
#include "input/header/dcm_read.h"

CtsStatus cts_dcm_parse_header(const uint8_t *bytes, size_t n, const CtsSyntax *native, CtsTexts *texts,
                               char class_uid[65], CtsSlice *slice, CtsError *err)
try {
    const CtsStatus st = cts_dcm_start(err);
    if (st)
        return st;
    const CtsDcmUse use(cts_dcm_in_use());
    DcmDataset data_set;
    const OFCondition result = cts_dcm_parse(data_set, bytes, n, native);
    if (result.bad())
        return cts_fail(err, cts_dcm_status(result, CTS_ERR_READ), "cannot be parsed as DICOM: %s", result.text());
    CtsParsedAttributes parsed(data_set);
    cts_dcm_read_object(parsed, *texts, class_uid, slice);
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_READ);
}
