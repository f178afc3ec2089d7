/* Work on bytes from outside, in a process of its own: codecs, unpackers.
 *
 * A sandbox is one child process, for one thread: it gets a stream in memory that both share, and answers there or with
 * a reason. When it dies, asks for too much memory, computes too long or makes a forbidden system call, that stream is
 * refused and the next one starts another child; one that is killed from outside gets a second chance. It sees no file,
 * and can be taken over by a damaged stream without harm to the program.
 *
 * With two slots the next stream is handed over while the child works: it goes on at once when it has answered, and
 * need not wait until its caller has been woken.
 *
 * The child is a fork of the helper (base/helper_process.h), for a library cannot know a program to run instead. A
 * child that hangs at its start, on a lock that was taken when the helper was forked, is given up, and the helper with
 * it; DCMTK's locks are free then (pthread_atfork() in dcm_start.cc), and the C library makes its own whole again.
 *
 * A child ends when its socket is closed, whatever way the program ends. */
#ifndef CTS_BASE_SANDBOX_H
#define CTS_BASE_SANDBOX_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum { CTS_SANDBOX_SLOTS = 2, CTS_SANDBOX_ORDER_BYTES = 64 };

/* What the child does: n bytes of a stream become n_answer bytes. order is a copy of what was sent; a pointer in it is
 * good where it points to a constant, which a fork has at the same place. CTS_ERR_MEMORY means that the stream asks for
 * too much. */
typedef CtsStatus (*cts_sandbox_work_fn)(const void *order, const uint8_t *stream, size_t n, void *answer,
                                         size_t n_answer, CtsError *err);

/* One stream; places are offsets into the shared memory. */
typedef struct CtsSandboxJob {
    uint64_t order[CTS_SANDBOX_ORDER_BYTES / sizeof(uint64_t)];
    size_t stream, n, answer, n_answer;
} CtsSandboxJob;

typedef struct CtsSandbox {
    cts_sandbox_work_fn work;
    CtsStatus (*prepare)(CtsError *err); /* what a child needs before it is shut in, such as a library; NULL: nothing */
    const char *name;                    /* for messages: "decoder" */
    bool own_bytes; /* what it reads comes from this program: no walls, and it may have threads */
    int n_slots;    /* streams at a time, 1 to CTS_SANDBOX_SLOTS */
    pid_t pid;      /* 0: no child now */
    CtsStatus (*prepared)(CtsError *err); /* what the child has behind it */
    int socket;                           /* to the child */
    int memory_id;
    void *shared; /* slots, each of a stream, then its answer */
    size_t stream_capacity, answer_capacity;
    CtsSandboxJob jobs[CTS_SANDBOX_SLOTS]; /* handed over and not taken yet, the oldest first */
    int n_jobs, next_slot;
    int cpu_limit_s;     /* for one stream; 0: as long as its answer's size lets expect */
    int quiet_limit_s;   /* without any computing, a lock that nobody will open; 0: a minute */
    size_t memory_limit; /* what a child may take; 0: as much as the room's size lets expect */
} CtsSandbox;

/* A sandbox without a child, for foreign bytes; name is a constant. */
CtsSandbox cts_sandbox_make(cts_sandbox_work_fn work, const char *name);

/* The same on the heap and with n_slots, where *sandbox is NULL; and gone again. */
CtsStatus cts_sandbox_new(CtsSandbox **sandbox, cts_sandbox_work_fn work, const char *name, int n_slots, CtsError *err);
void cts_sandbox_free(CtsSandbox **sandbox);

/* Whether another stream has room beside those that have been handed over. */
bool cts_sandbox_fits(const CtsSandbox *sandbox, size_t n, size_t n_answer);

/* Make room for a stream of n bytes and its answer, starting a child when there is none, its room is too small, or it
 * is not prepared. The caller puts the bytes at *stream. While streams are under way only where the next fits. */
CtsStatus cts_sandbox_room(CtsSandbox *sandbox, size_t n, size_t n_answer, uint8_t **stream, CtsError *err);

/* Hand over the n bytes at stream, which lies inside the room, with n_order bytes that say what they are, or
 * none. */
void cts_sandbox_send(CtsSandbox *sandbox, const void *order, size_t n_order, const uint8_t *stream, size_t n,
                      size_t n_answer);

/* Wait for the oldest stream that was handed over. *answer lies in shared memory and is valid until the next is made
 * room for. CTS_ERR_PIXELS, with the reason, for everything that the stream can do to its child. */
CtsStatus cts_sandbox_take(CtsSandbox *sandbox, const void **answer, CtsError *err);

/* End the child; what it has answered stays, what is under way is dropped. */
void cts_sandbox_end(CtsSandbox *sandbox);

/* End the child and free the memory; the sandbox may be used again. */
void cts_sandbox_stop(CtsSandbox *sandbox);

#endif
