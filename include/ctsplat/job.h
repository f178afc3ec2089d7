/* A render job in words, and the one call that runs it: what `ctsplat render` takes, makes the same picture here. */
#ifndef CTSPLAT_JOB_H
#define CTSPLAT_JOB_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/state.h"
#include "ctsplat/status.h"
#include <signal.h>

CTS_API_BEGIN

/* The words of a job. name: an option of `ctsplat render` as ctsplat(1) has it, without its dashes ("preset", "view",
 * "size"), or "path": what to search for series, which may stand there several times, as "output" may; of other names
 * the last one holds, but one preset and one view are all that a picture has. value: its argument; "" for an option
 * that takes none, such as "force".
 *
 * Searches, reads, renders, writes all outputs and sends them: the whole of `ctsplat render`, with its defaults.
 * picture (may be NULL): the picture in memory too, as the files have it, background and marks included, to be freed
 * with cts_picture_free(); not for a rotation, which has many. Without picture there must be an output. What is odd
 * about the input stands in report->findings (report may be NULL). *stop (stop may be NULL), set by a signal handler
 * or another thread, ends it with CTS_ERR_INTERRUPTED. */
CtsStatus cts_words_run(const CtsWord *words, int n_words, const volatile sig_atomic_t *stop, CtsPicture **picture,
                        CtsReport *report, CtsError *err);

/* A series that stays loaded, for many pictures: what was scanned, and the volume that the last picture was made of.
 * One call at a time; sessions know nothing of each other. */
typedef struct CtsSession CtsSession;

/* Finds and reads the series that the words name: "path", "series", "from", "labels" and what belongs to them. Other
 * words are looked at and change nothing. *session is NULL after a failure. */
CtsStatus cts_session_open(CtsSession **session, const CtsWord *words, int n_words, const volatile sig_atomic_t *stop,
                           CtsReport *report, CtsError *err);
/* Of what is there already; *scanned becomes the session's and NULL. It has no patient, so no .dcm outputs. */
CtsStatus cts_session_take(CtsSession **session, CtsScanned **scanned, CtsError *err);
void cts_session_close(CtsSession **session);

/* As cts_words_run(), of this series: "path" is refused, and which series is settled. */
CtsStatus cts_session_run(CtsSession *session, const CtsWord *words, int n_words, const volatile sig_atomic_t *stop,
                          CtsPicture **picture, CtsReport *report, CtsError *err);

/* The same with every picture of a rotation, one after the other, each handed to take as soon as it is made, which
 * frees it and whose failure is that of the call. Called from the thread that called. */
typedef CtsStatus (*CtsPictureSink)(void *context, int frame, CtsPicture *picture, CtsError *err);
CtsStatus cts_session_frames(CtsSession *session, const CtsWord *words, int n_words, const volatile sig_atomic_t *stop,
                             CtsPictureSink take, void *context, CtsReport *report, CtsError *err);

/* What was scanned; the session's. Its `even` may have no grey levels once memory has been too short for a second
 * volume. */
const CtsScanned *cts_session_scanned(const CtsSession *session);
/* The session's too; NULL where it was not read from DICOM. */
const CtsSeries *cts_session_series(const CtsSession *session);

CTS_API_END
#endif
