/* The process that forks the library's other processes. */
#ifndef CTSPLAT_HELPER_H
#define CTSPLAT_HELPER_H

#include "ctsplat/status.h"

CTS_API_BEGIN

/* Compressed pixels, deflated headers and zip files are decoded by sandboxed processes, which one helper process forks.
 * The helper is forked once, when the first of them is needed. A program with threads should call this before it starts
 * them (or forks otherwise), so that the helper is forked from a single-threaded process; a second call does nothing.
 *
 * The helper is not a child of the program: the program may wait for all its child processes, or ignore SIGCHLD. It
 * keeps no file of the program's open and ends with it. A process that the program forks has a helper of its own.
 * Thread-safe. */
CtsStatus cts_helper_start(CtsError *err);

CTS_API_END
#endif
