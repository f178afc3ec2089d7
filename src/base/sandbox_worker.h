/* The other side of a sandbox (base/sandbox.h): the main loop of a program of libexec, and its messages. */
#pragma once

#include "base/sandbox.h"

/* The work of a task: n bytes of a stream become n_answer bytes. order: a copy of the caller's parameters.
 * CTS_ERR_MEMORY: the stream needs too much. */
typedef CtsStatus (*cts_sandbox_work_fn)(const void *order, const uint8_t *stream, size_t n, void *answer,
                                         size_t n_answer, CtsError *err);

/* One row of a program's table, which the number of the task indexes. */
typedef struct CtsSandboxTask {
    cts_sandbox_work_fn work;
    CtsStatus (*prepare)(CtsError *err); /* before the isolation: what opens files; NULL: nothing */
} CtsSandboxTask;

/* The program's main function: serves streams of one task until the socket closes. Returns the exit code. */
int cts_sandbox_serve(int argc, char **argv, const CtsSandboxTask *tasks, int n_tasks);

/* Argument of the program: version, task, socket, lifeline, memory and its limit. */
#define CTS_SANDBOX_ARGUMENT "%15s %d %d %d %d %zu"

/* Answer to a stream, and first of all, without a stream, whether the isolation succeeded. */
typedef struct CtsSandboxAnswer {
    CtsStatus status;
    int64_t cpu_us, peak_kib; /* of the process until now */
    char text[240];
} CtsSandboxAnswer;
