/* The process that forks the library's other processes. */
#ifndef CTSPLAT_HELPER_H
#define CTSPLAT_HELPER_H

#include "ctsplat/status.h"

CTS_API_BEGIN

/* Compressed pixels, deflated headers and zip files are read by processes of their own, which one helper process forks.
 * The helper is forked once, when the first of them is wanted. A program with threads calls this before it starts them
 * (or forks anything else), so that the helper is forked from a process that is at rest; a second call does nothing.
 *
 * The helper is nobody's child: the program may wait for all its children, or ignore SIGCHLD. It holds no file of the
 * program's and ends with it. A process that the program forks has a helper of its own. Thread-safe. */
CtsStatus cts_helper_start(CtsError *err);

CTS_API_END
#endif
