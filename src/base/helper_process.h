/* The helper process, which forks all others (ctsplat/helper.h). It has no threads and no volumes, so that forking it
 * is cheap and no lock is held; functions and constants have the same addresses as in the program. */
#pragma once

#include "ctsplat/helper.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { CTS_HELPER_ORDER_BYTES = 64 };

/* The purpose of a process to be forked. */
typedef struct CtsHelperOrder {
    CtsStatus (*prepare)(CtsError *err);         /* in the helper, before the fork: loads a library, once; or NULL */
    void (*live)(const void *order, int socket); /* the process's whole life */
    uint64_t order[CTS_HELPER_ORDER_BYTES / sizeof(uint64_t)];
} CtsHelperOrder;

/* Fork a process for the order, which has the other end of *socket (SOCK_SEQPACKET) and no other file once it has
 * called cts_isolation_enter(). */
CtsStatus cts_helper_fork(const CtsHelperOrder *order, pid_t *pid, int *socket, CtsError *err);

/* Kills a process unless it has ended, and reaps it: its wait status. Adds its CPU time (cts_cpu_ms()). Killing the
 * helper kills its processes. */
int cts_helper_end(pid_t pid);

/* Replaces the helper for the next fork: its processes find a lock that was taken when it was forked. */
void cts_helper_renew(void);

/* To be called early by a program that will call cts_helper_stop(): the helper is then its child process, so that the
 * CPU time of helpers counts as the program's. */
void cts_helper_keep(void);
void cts_helper_stop(void);
