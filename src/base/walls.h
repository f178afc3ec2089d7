/* Walls around a process that runs codecs on foreign bytes. */
#ifndef CTS_BASE_WALLS_H
#define CTS_BASE_WALLS_H

#include "base/sanitized.h"
#include <stddef.h>

/* Shut the calling process in for good: of its files only keep_fd stays open, its memory may grow by n_bytes, and of
 * the system calls only those are left that ask for memory, move bytes over keep_fd and end the process; a file cannot
 * be opened, and any other call ends it with SIGSYS. Signals sent to the program's group leave it alone. 0, or an
 * errno. Builds with sanitizers, which map and open what they like, keep the limits on processes, programs and the
 * network alone (CTS_SANITIZED). */
int cts_walls_enter(int keep_fd, size_t n_bytes);

/* Of that only what keeps a child apart from its parent: signals, files, no core. */
int cts_walls_leave_all(int keep_fd);

/* For a process that a peer talks to: it runs no program and reaches nobody else. 0, or an errno. */
int cts_walls_stay_inside(void);

#endif
