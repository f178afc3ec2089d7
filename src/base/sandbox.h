/* Sandboxed processing of untrusted bytes: codecs, unpackers.
 *
 * A sandbox is one child process, for one thread: it gets a stream in shared memory, and answers there or with an
 * error. When it crashes, exceeds its memory or time, or makes a forbidden system call, that stream is refused and a
 * new process is started for the next one; if it is killed from outside, the stream is tried again. It has no access to
 * files, and a stream that takes control of it can do no harm to the program.
 *
 * With two slots the next stream is passed while the process works, so that it continues at once after an answer,
 * without waiting for its caller to wake up.
 *
 * The process is a fork of the helper (base/helper_process.h), since a library cannot know a program to execute
 * instead. A process that hangs at its start, on a lock that was held when the helper was forked, is abandoned together
 * with the helper; DCMTK's locks are free then (pthread_atfork() in dcm_start.cc), and the C library resets its own. A
 * process ends when its socket is closed, however the program ends. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { CTS_SANDBOX_SLOTS = 2, CTS_SANDBOX_ORDER_BYTES = 64 };

/* The work of the process: n bytes of a stream become n_answer bytes. order: a copy of the caller's; pointers in it
 * must point to constants, which have the same address after a fork. CTS_ERR_MEMORY: the stream needs too much. */
typedef CtsStatus (*cts_sandbox_work_fn)(const void *order, const uint8_t *stream, size_t n, void *answer,
                                         size_t n_answer, CtsError *err);

/* One stream; places are offsets into the shared memory. */
typedef struct CtsSandboxJob {
    uint64_t order[CTS_SANDBOX_ORDER_BYTES / sizeof(uint64_t)];
    size_t stream, n, answer, n_answer;
} CtsSandboxJob;

typedef struct CtsSandbox {
    cts_sandbox_work_fn work;
    CtsStatus (*prepare)(CtsError *err);  /* preparation before the isolation, such as loading a library; NULL: none */
    const char *name;                     /* for messages: "decoder" */
    bool own_bytes;                       /* trusted input from this program: no isolation, and threads are allowed */
    int n_slots;                          /* streams at a time, 1 to CTS_SANDBOX_SLOTS */
    pid_t pid;                            /* 0: no process */
    CtsStatus (*prepared)(CtsError *err); /* the preparation that the process has done */
    int socket;                           /* to the process */
    int memory_id;
    void *shared; /* slots, each of a stream, then its answer */
    size_t stream_capacity, answer_capacity;
    CtsSandboxJob jobs[CTS_SANDBOX_SLOTS]; /* passed and not yet answered, the oldest first */
    int n_jobs, next_slot;
    int cpu_limit_s;     /* for one stream; 0: as long as its answer's size lets expect */
    int quiet_limit_s;   /* idle time that counts as a deadlock; 0: a minute */
    size_t memory_limit; /* memory limit of the process; 0: derived from the room's size */
} CtsSandbox;

/* A sandbox for untrusted bytes, without a process yet; name is a constant. */
CtsSandbox cts_sandbox_make(cts_sandbox_work_fn work, const char *name);

/* Allocates one with n_slots, where *sandbox is NULL; and frees it. */
CtsStatus cts_sandbox_new(CtsSandbox **sandbox, cts_sandbox_work_fn work, const char *name, int n_slots, CtsError *err);
void cts_sandbox_free(CtsSandbox **sandbox);

/* True if another stream fits beside those in progress. */
bool cts_sandbox_fits(const CtsSandbox *sandbox, size_t n, size_t n_answer);

/* Makes room for a stream of n bytes and its answer; starts a process when there is none, its room is too small, or it
 * is not prepared. The caller writes the bytes to *stream. With streams in progress only allowed where
 * cts_sandbox_fits(). */
CtsStatus cts_sandbox_room(CtsSandbox *sandbox, size_t n, size_t n_answer, uint8_t **stream, CtsError *err);

/* Passes the n bytes at stream, within the room, with n_order bytes of parameters, or none. */
void cts_sandbox_send(CtsSandbox *sandbox, const void *order, size_t n_order, const uint8_t *stream, size_t n,
                      size_t n_answer);

/* Waits for the oldest stream's answer. *answer is in shared memory and valid until room is made for the next.
 * CTS_ERR_PIXELS, with the reason, for every failure that a stream can cause. */
CtsStatus cts_sandbox_take(CtsSandbox *sandbox, const void **answer, CtsError *err);

/* Ends the process; answers remain, streams in progress are dropped. */
void cts_sandbox_end(CtsSandbox *sandbox);

/* Ends the process and frees the memory; the sandbox may be used again. */
void cts_sandbox_stop(CtsSandbox *sandbox);
