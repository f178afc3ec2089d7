/* Isolation of a process that runs codecs on untrusted bytes. */
#pragma once

#include "base/sanitized.h"
#include <stddef.h>

/* Isolates the calling process for good: only keep_fd stays open, its memory may grow by n_bytes, and only system calls
 * for memory, transfer over keep_fd and exit remain; opening a file fails, and any other call ends it with SIGSYS. It
 * ignores signals to the program's process group. 0, or an errno. Builds with sanitizers, which map and open files
 * freely, keep only the limits on processes, programs and the network (CTS_SANITIZED). */
int cts_isolation_enter(int keep_fd, size_t n_bytes);

/* Only the separation of a child process from its parent: signals, files, no core files. */
int cts_isolation_leave_all(int keep_fd);
