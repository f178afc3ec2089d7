/* What the C++ files of the door share. */
#ifndef CTS_DICOM_DCM_CALL_HPP
#define CTS_DICOM_DCM_CALL_HPP

#include "ctsplat/status.h"

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <new>
#include <shared_mutex>

class OFCondition;

/* Warnings and errors that DCMTK logged in this thread since the last reset, and the first one's text. */
struct CtsDcmLog {
    unsigned n;
    char first[120];
};

CtsDcmLog &cts_dcm_log();
void cts_dcm_log_reset();

/* Held for as long as a thread is inside DCMTK, so that a fork finds none of its locks taken (base/sandbox.h). */
std::shared_mutex &cts_dcm_in_use();
using CtsDcmUse = std::shared_lock<std::shared_mutex>;

/* Before anything looks up a tag; once, by one thread. */
CtsStatus cts_dcm_load_dictionary(CtsError *err);

/* What to answer when DCMTK says no. */
CtsStatus cts_dcm_status(const OFCondition &why, CtsStatus otherwise);

/* No exception comes through a door: what each that is caught there becomes. */
inline CtsStatus cts_dcm_caught(CtsError *err, CtsStatus otherwise)
try {
    throw;
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
} catch (...) {
    return cts_fail(err, otherwise, "unexpected failure in DCMTK");
}

/* A call into DCMTK. */
template <typename Call> CtsStatus cts_dcm_guarded(CtsError *err, CtsStatus otherwise, Call call)
try {
    const CtsDcmUse use(cts_dcm_in_use());
    return call();
} catch (...) {
    return cts_dcm_caught(err, otherwise);
}

#endif
