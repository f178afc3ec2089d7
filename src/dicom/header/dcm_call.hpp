/* Calls into DCMTK: its locks, and exceptions as statuses; shared by the C++ files of dicom. */
#ifndef CTS_DICOM_DCM_CALL_HPP
#define CTS_DICOM_DCM_CALL_HPP

#include "ctsplat/status.h"

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <new>
#include <shared_mutex>

class OFCondition;

/* Lock held while a thread is inside DCMTK, so that no lock of DCMTK is taken during a fork (base/sandbox.h). */
std::shared_mutex &cts_dcm_in_use();
using CtsDcmUse = std::shared_lock<std::shared_mutex>;

/* To be called before the first look-up of a tag; once, by one thread. */
CtsStatus cts_dcm_load_dictionary(CtsError *err);

/* Status for a failure of DCMTK: out of memory, or `otherwise`. */
CtsStatus cts_dcm_status(const OFCondition &why, CtsStatus otherwise);

/* Status of the exception being handled, since C callers cannot catch any. */
inline CtsStatus cts_dcm_caught(CtsError *err, CtsStatus otherwise)
try {
    throw;
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
} catch (...) {
    return cts_fail(err, otherwise, "unexpected failure in DCMTK");
}

/* Calls into DCMTK under the lock, with exceptions as statuses. */
template <typename Call> CtsStatus cts_dcm_guarded(CtsError *err, CtsStatus otherwise, Call call)
try {
    const CtsDcmUse use(cts_dcm_in_use());
    return call();
} catch (...) {
    return cts_dcm_caught(err, otherwise);
}

#endif
