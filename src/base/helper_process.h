/* One process that forks all others (ctsplat/helper.h). It has no threads and no volumes, so a fork of it is cheap and
 * meets no lock that somebody holds; its caller's functions and constants stand at the same places in it. */
#ifndef CTS_BASE_HELPER_PROCESS_H
#define CTS_BASE_HELPER_PROCESS_H

#include "ctsplat/helper.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { CTS_HELPER_ORDER_BYTES = 64 };

/* What a process is forked for. */
typedef struct CtsHelperOrder {
    CtsStatus (*prepare)(CtsError *err);         /* in the helper, before the fork: loads a library, once; or NULL */
    void (*live)(const void *order, int socket); /* the process's whole life */
    uint64_t order[CTS_HELPER_ORDER_BYTES / sizeof(uint64_t)];
} CtsHelperOrder;

/* Fork a process for the order, which has the other end of *socket (SOCK_SEQPACKET) and no other file once it has
 * called cts_walls_enter(). */
CtsStatus cts_helper_fork(const CtsHelperOrder *order, pid_t *pid, int *socket, CtsError *err);

/* Kill a process unless it has ended, and wait for it: its wait status. Its computing counts from now on
 * (cts_cpu_ms()). Processes are killed when the helper is. */
int cts_helper_end(pid_t pid);

/* The helper's processes are no good, for they meet a lock that was taken when it was forked: the next is another. */
void cts_helper_renew(void);

/* Said early by a program that will call cts_helper_stop(): its helper is then its child, and what helpers compute
 * counts as the program's to whoever waits for the program. */
void cts_helper_keep(void);
void cts_helper_stop(void);

#endif
