/* DCMTK made ready: log, decoders, dictionary; and how it is handed bytes. */
#include <dcmtk/config/osconfig.h>

#include "dicom/header/dcm_call.hpp"
#include "dicom/header/dcm_read.h"

#include <cstdio>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <dcmtk/oflog/oflog.h>
#include <dcmtk/oflog/spi/logevent.h>
#include <mutex>
#include <new>
#include <pthread.h>

namespace log4cplus = dcmtk::log4cplus;

CtsStatus cts_dcm_status(const OFCondition &why, CtsStatus otherwise)
{
    return why == EC_MemoryExhausted ? CTS_ERR_MEMORY : otherwise;
}

namespace
{

/* The key under which each thread keeps its log; throws std::bad_alloc. */
pthread_key_t log_key()
{
    static const pthread_key_t key = [] {
        pthread_key_t made;
        if (pthread_key_create(&made, nullptr))
            throw std::bad_alloc();
        return made;
    }();
    return key;
}

class CountingAppender : public log4cplus::Appender
{
  public:
    ~CountingAppender() override
    {
        destructorImpl();
    }
    void close() override
    {
        closed = true;
    }

  protected:
    void append(const log4cplus::spi::InternalLoggingEvent &event) override
    {
        auto *const log = static_cast<CtsDcmLog *>(pthread_getspecific(log_key()));
        if (log && log->n++ == 0)
            std::snprintf(log->first, sizeof log->first, "%s", event.getMessage().c_str());
    }
};

/* Lives until exit: DCMTK's list of codecs does not free them. */
class Decoders final
{
  public:
    Decoders()
    {
        DcmRLEDecoderRegistration::registerCodecs();
        DJDecoderRegistration::registerCodecs();
        DJLSDecoderRegistration::registerCodecs();
    }
    ~Decoders()
    {
        DJLSDecoderRegistration::cleanup();
        DJDecoderRegistration::cleanup();
        DcmRLEDecoderRegistration::cleanup();
    }
    Decoders(const Decoders &) = delete;
    Decoders &operator=(const Decoders &) = delete;
};

bool start_decoders()
{
    OFLog::configure(OFLogger::WARN_LOG_LEVEL);
    log_key(); /* made here, so that an appender never throws */
    log4cplus::Logger root = log4cplus::Logger::getRoot();
    /* Silenced, not removed: an appender's destructor allocates, and without memory ends the program. */
    for (const log4cplus::SharedAppenderPtr &appender : root.getAllAppenders())
        appender->setThreshold(log4cplus::OFF_LOG_LEVEL);
    root.addAppender(log4cplus::SharedAppenderPtr(new CountingAppender));
    static const Decoders decoders;
    /* A forked process must find DCMTK's locks free. This lock is recreated there, since it records its owner by a
     * thread number that differs after a fork. */
    return pthread_atfork([] { cts_dcm_in_use().lock(); }, [] { cts_dcm_in_use().unlock(); },
                          [] { new (&cts_dcm_in_use()) std::shared_mutex; }) == 0;
}

} // namespace

bool cts_dcm_log_into(CtsDcmLog *log)
{
    return pthread_setspecific(log_key(), log) == 0;
}

std::shared_mutex &cts_dcm_in_use()
{
    static std::shared_mutex mutex;
    return mutex;
}

CtsStatus cts_dcm_start_decoders(CtsError *err)
try {
    static const bool started = start_decoders();
    return started ? CTS_OK : cts_fail(err, CTS_ERR_INTERNAL, "DCMTK could not be started");
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}

CtsStatus cts_dcm_start(CtsError *err)
try {
    CtsStatus st = cts_dcm_start_decoders(err);
    if (st)
        return st;
    static std::mutex mutex;
    static bool loaded;
    const std::lock_guard<std::mutex> alone(mutex);
    if (!loaded && (st = cts_dcm_load_dictionary(err)))
        return st;
    loaded = true;
    return CTS_OK;
} catch (...) {
    return cts_dcm_caught(err, CTS_ERR_INTERNAL);
}
