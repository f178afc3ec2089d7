/* A render job given by options, and the call that runs it: options of `ctsplat render` give the same picture here. */
#pragma once

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/state.h"
#include "ctsplat/status.h"
#include <signal.h>

CTS_API_BEGIN

/* The options of a job. name: an option of `ctsplat render` as in ctsplat(1), without its dashes ("preset", "view",
 * "size"), or "path": a place to search for series. "path" and "output" may be repeated; of other options the last one
 * applies, but a picture has only one preset and one view. value: the argument; "" for an option without one, such as
 * "force".
 *
 * Searches, reads, renders, writes all outputs and sends them: all that `ctsplat render` does, with its defaults.
 * picture (may be NULL): the picture in memory too, as in the files, with background and marks, and by option "depth"
 * with the depth of its surfaces, to be freed with cts_picture_free(); not for a rotation. Without picture there must
 * be an output. report->diagnostics contains notes and warnings (report may be NULL). *stop (stop may be NULL), set by
 * a signal handler or another thread, ends it with CTS_ERR_INTERRUPTED. */
CtsStatus cts_options_run(const CtsJobOption *options, int n_options, const volatile sig_atomic_t *stop,
                          CtsPicture **picture, CtsReport *report, CtsError *err);

/* A series that stays loaded for many pictures: the scanned slices, the volume of the last picture, and what was
 * prepared of it for the last preset (tables, openness, cells that may be visible: less than the volume). One call at a
 * time; sessions are independent. */
typedef struct CtsSession CtsSession;

/* Finds and reads the series given by "path", "series", "from", "labels" and related options. Other options are checked
 * and have no effect. *session is NULL after a failure. */
CtsStatus cts_session_open(CtsSession **session, const CtsJobOption *options, int n_options,
                           const volatile sig_atomic_t *stop, CtsReport *report, CtsError *err);
/* A session of scanned slices in memory; takes ownership of *scanned. It has no patient, so no .dcm outputs. */
CtsStatus cts_session_take(CtsSession **session, CtsScanned **scanned, CtsError *err);
void cts_session_close(CtsSession **session);

/* As cts_options_run(), for this series: "path" and options that select a series are refused. */
CtsStatus cts_session_run(CtsSession *session, const CtsJobOption *options, int n_options,
                          const volatile sig_atomic_t *stop, CtsPicture **picture, CtsReport *report, CtsError *err);

/* The same with every picture of a rotation: each is passed to take as soon as it is rendered, in the calling thread;
 * take frees it, and its failure ends the call. */
typedef CtsStatus (*CtsPictureSink)(void *context, int frame, CtsPicture *picture, CtsError *err);
CtsStatus cts_session_frames(CtsSession *session, const CtsJobOption *options, int n_options,
                             const volatile sig_atomic_t *stop, CtsPictureSink take, void *context, CtsReport *report,
                             CtsError *err);

/* The scanned slices; the session's. Its `even` may have no grey levels once memory did not suffice for a second
 * volume. */
const CtsScanned *cts_session_scanned(const CtsSession *session);
/* The session's too; NULL where it was not read from DICOM. */
const CtsSeries *cts_session_series(const CtsSession *session);

CTS_API_END
