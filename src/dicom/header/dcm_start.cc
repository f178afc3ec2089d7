/* DCMTK made ready: log and dictionary. */
#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"

#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>
#include <mutex>
#include <new>
#include <pthread.h>

CtsStatus cts_dcm_status(const OFCondition &why, CtsStatus otherwise)
{
    return why == EC_MemoryExhausted ? CTS_ERR_MEMORY : otherwise;
}

namespace
{

bool silence()
{
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    /* A forked process must find DCMTK's locks free. This lock is recreated there, since it records its owner by a
     * thread number that differs after a fork. */
    return pthread_atfork([] { cts_dcm_in_use().lock(); }, [] { cts_dcm_in_use().unlock(); },
                          [] { new (&cts_dcm_in_use()) std::shared_mutex; }) == 0;
}

} // namespace

std::shared_mutex &cts_dcm_in_use()
{
    static std::shared_mutex mutex;
    return mutex;
}

CtsStatus cts_dcm_start(CtsError *err)
try {
    static const bool silent = silence();
    static std::mutex mutex;
    static bool loaded;
    const std::lock_guard<std::mutex> alone(mutex);
    const CtsStatus st = !silent  ? cts_fail(err, CTS_ERR_INTERNAL, "DCMTK could not be started")
                         : loaded ? CTS_OK
                                  : cts_dcm_load_dictionary(err);
    loaded = !st;
    return st;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}
