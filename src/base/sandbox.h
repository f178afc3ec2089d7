/* Sandboxed processing of untrusted bytes: codecs, unpackers.
 *
 * A sandbox is one child process, for one thread: a program of libexec (base/libexec.h) that does one task of its table
 * (base/sandbox_worker.h). It gets a stream in shared memory, and answers there or with an error. When it crashes,
 * exceeds its memory or time, or makes a forbidden system call, that stream is refused and a new process is started for
 * the next one; if it is killed from outside, the stream is tried again. It has no access to files, and a stream that
 * takes control of it can do no harm to the program.
 *
 * With two slots the next stream is passed while the process works, so that it continues at once after an answer,
 * without waiting for its caller to wake up.
 *
 * The program may wait for all its child processes, or ignore SIGCHLD: then only the reason of a process's death is
 * unknown. A process ends when the program closes its sockets, however the program ends. A process that the program
 * forks leaves its parent's sandboxes alone, and starts its own. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { CTS_SANDBOX_SLOTS = 2, CTS_SANDBOX_ORDER_BYTES = 64 };

/* One stream; places are offsets into the shared memory. */
typedef struct CtsSandboxJob {
    uint64_t order[CTS_SANDBOX_ORDER_BYTES / sizeof(uint64_t)];
    size_t stream, n, answer, n_answer;
} CtsSandboxJob;

typedef struct CtsSandbox {
    const char *program; /* of libexec */
    int task;            /* its number in the program's table; another one starts another process */
    const char *name;    /* for messages: "decoder" */
    int n_slots;         /* streams at a time, 1 to CTS_SANDBOX_SLOTS */
    pid_t owner;         /* the process that has this sandbox, when there is a process or memory */
    pid_t pid;           /* 0: no process */
    int handle;          /* pidfd of the process: its number may be another's when it was reaped; -1: none */
    int socket;          /* to the process */
    int lifeline;        /* pipe to the process, which is killed when it closes */
    int started_task;    /* the process's task */
    bool started;        /* it has reported that it is ready */
    int64_t cpu_us;      /* that the process has reported */
    int memory_id;
    void *shared; /* slots, each of a stream, then its answer */
    size_t stream_capacity, answer_capacity;
    CtsSandboxJob jobs[CTS_SANDBOX_SLOTS]; /* passed and not yet answered, the oldest first */
    int n_jobs, next_slot;
    int cpu_limit_s;     /* for one stream; 0: as long as its answer's size lets expect */
    int quiet_limit_s;   /* idle time that counts as a deadlock; 0: a minute */
    size_t memory_limit; /* memory for a stream beside the room; 0: derived from the room's size */
} CtsSandbox;

/* A sandbox without a process yet; program and name are constants. */
CtsSandbox cts_sandbox_make(const char *program, int task, const char *name);

/* Allocates one with n_slots, where *sandbox is NULL; and frees it. */
CtsStatus cts_sandbox_new(CtsSandbox **sandbox, const char *program, int task, const char *name, int n_slots,
                          CtsError *err);
void cts_sandbox_free(CtsSandbox **sandbox);

/* True if another stream fits beside those in progress. */
bool cts_sandbox_fits(CtsSandbox *sandbox, size_t n, size_t n_answer);

/* Makes room for a stream of n bytes and its answer; starts a process when there is none, its room is too small, or it
 * has another task, without waiting until it is ready. The caller writes the bytes to *stream. With streams in progress
 * only allowed where cts_sandbox_fits(). */
CtsStatus cts_sandbox_room(CtsSandbox *sandbox, size_t n, size_t n_answer, uint8_t **stream, CtsError *err);

/* Passes the n bytes at stream, within the room, with n_order bytes of parameters, or none. */
void cts_sandbox_send(CtsSandbox *sandbox, const void *order, size_t n_order, const uint8_t *stream, size_t n,
                      size_t n_answer);

/* Waits for the oldest stream's answer. *answer is in shared memory and valid until room is made for the next.
 * CTS_ERR_PIXELS, with the reason, for every failure that a stream can cause; CTS_ERR_INTERNAL or CTS_ERR_MEMORY when
 * the process cannot be started or isolated. */
CtsStatus cts_sandbox_take(CtsSandbox *sandbox, const void **answer, CtsError *err);

/* Ends the process; answers remain, streams in progress are dropped. */
void cts_sandbox_end(CtsSandbox *sandbox);

/* Ends the process and frees the memory; the sandbox may be used again. */
void cts_sandbox_stop(CtsSandbox *sandbox);
