/* Isolation of a process that runs codecs on untrusted bytes. */
#pragma once

#include "base/sanitized.h"
#include <stdbool.h>
#include <stddef.h>

/* Environment variable: with "1" files are read without a sandbox where the system refuses one. */
#define CTS_ISOLATION_WAIVED "CTSPLAT_NO_SANDBOX"
bool cts_isolation_is_waived(void);

/* Isolates the calling process for good: only the descriptors of keep stay open, its address space is limited to
 * n_bytes, and only system calls for memory, transfer over open descriptors and exit remain; opening a file fails, and
 * any other call ends it with SIGSYS. It ignores signals to the program's process group. 0, or an errno. Builds with
 * sanitizers, which map and open files freely, keep only the limits on processes, programs and the network
 * (CTS_SANITIZED). */
int cts_isolation_enter(const int keep[2], size_t n_bytes);
