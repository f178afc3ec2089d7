/* A render job in words, and the one call that runs it: what `ctsplat render` takes, makes the same picture here. */
#ifndef CTSPLAT_JOB_H
#define CTSPLAT_JOB_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/state.h"
#include "ctsplat/status.h"
#include <signal.h>

#ifdef __cplusplus
extern "C" {
#endif
#pragma GCC visibility push(default)

/* The words of a job. name: an option of `ctsplat render` as ctsplat(1) has it, without its dashes ("preset", "view",
 * "size"), or "path": what to search for series, which may stand there several times, as "output" may; of other names
the
 * last one holds, but one preset and one view are all that a picture has. value: its argument; "" for an option that
takes
 * none, such as "force".
 *
Searches, reads, renders, writes all outputs and sends them: the whole of `ctsplat render`, with its defaults. picture
 * (may be NULL): the picture in memory too, as the files have it, background and marks included, to be freed with
 * cts_picture_free(); not for a rotation, which has many. Without picture there must be an output. What is odd about
the
 * input stands in report->findings (report may be NULL). *stop (stop may be NULL), set by a signal handler or another
 * thread, ends it with CTS_ERR_INTERRUPTED. */
CtsStatus cts_words_run(const CtsWord *words, int n_words, const volatile sig_atomic_t *stop, CtsPicture **picture,
                        CtsReport *report, CtsError *err);

#pragma GCC visibility pop
#ifdef __cplusplus
}
#endif
#endif
