/* Failures and exceptions of DCMTK as statuses. */
#pragma once

#include "dicom/dcmtk/start_dcmtk.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/ofstd/ofcond.h>
#include <new>
#include <stdexcept>

/* True where an allocation has failed since the last call: without memory DCMTK may omit a value and report success. */
bool cts_dcm_memory_failed();

/* Throws for a failure: std::bad_alloc, or std::runtime_error with DCMTK's reason. */
inline void cts_dcm_check(const OFCondition &state)
{
    if (state == EC_MemoryExhausted)
        throw std::bad_alloc();
    if (state.bad())
        throw std::runtime_error(state.text());
}

/* Status of the exception being handled, since C callers cannot catch any. */
inline CtsStatus cts_dcm_caught(CtsError *err, CtsStatus otherwise)
try {
    throw;
} catch (const std::bad_alloc &) {
    return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
} catch (const std::exception &why) {
    return cts_fail(err, otherwise, "%s", why.what());
}
