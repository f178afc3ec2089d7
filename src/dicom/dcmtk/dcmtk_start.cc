#include "dicom/dcmtk/dcmtk_failures.hpp"

#include <atomic>
#include <cstdlib>
#include <dcmtk/dcmdata/dcdicent.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>
#include <new>

namespace
{

struct DictionaryRow {
    Uint16 group, element;
    const char *vr;
};
/* Generated from DCMTK's dictionary. */
const DictionaryRow rows[] = {
#include <dicom_tags.inc>
};

std::atomic<bool> has_failed; /* an allocation */

void note_failure()
{
    has_failed = true;
    throw std::bad_alloc();
}

} // namespace

bool cts_dcm_memory_failed()
{
    return has_failed.exchange(false);
}

CtsStatus cts_dcm_start(CtsError *err)
try {
    std::set_new_handler(note_failure);
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    /* DCMTK's own reader of its dictionary takes 18 ms; these rows take none that can be measured. */
    setenv("DCMDICTPATH", "/dev/null", 1);
    DcmDataDictionary &dictionary = dcmDataDict.wrlock();
    for (const DictionaryRow &row : rows)
        dictionary.addEntry(
            new DcmDictEntry(row.group, row.element, DcmVR(row.vr), "", 1, DcmVariableVM, nullptr, OFFalse, nullptr));
    dcmDataDict.wrunlock();
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}
