#include "base/sandbox.h"

#include "base/clock.h"
#include "base/libexec.h"
#include "base/sandbox_worker.h"
#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/pidfd.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum {
    PROGRAM_MEMORY = 128 << 20, /* address space of a program and its libraries; measured: 55 MiB with DCMTK */
    BASE_MEMORY = 256 << 20,    /* memory of a codec for any stream */
    ANSWER_MEMORY = 24,         /* and for each byte of the answer: OpenJPEG holds a pixel a few times as 32 bits */
    STREAM_MEMORY = 4,          /* and for each byte of the stream */
    BASE_CPU_S = 10,
    BYTES_PER_CPU_S = 400000, /* a fiftieth of the speed of the slowest codec */
    QUIET_S = 60,
    ROOM_STEP = 1 << 20
};

CtsSandbox cts_sandbox_make(const char *program, int task, const char *name)
{
    return (CtsSandbox){.program = program, .task = task, .name = name, .n_slots = 1, .socket = -1};
}

CtsStatus cts_sandbox_new(CtsSandbox **sandbox, const char *program, int task, const char *name, int n_slots,
                          CtsError *err)
{
    if (*sandbox)
        return CTS_OK;
    if (!(*sandbox = malloc(sizeof **sandbox)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    **sandbox = cts_sandbox_make(program, task, name);
    (*sandbox)->n_slots = n_slots;
    return CTS_OK;
}

static size_t slot_bytes(const CtsSandbox *d)
{
    return d->stream_capacity + d->answer_capacity;
}

static void close_process(CtsSandbox *d)
{
    close(d->socket);
    close(d->lifeline);
    if (d->handle >= 0)
        close(d->handle);
    d->pid = 0;
}

/* Ends the process: how it ended, all zero where the program has reaped it before. */
static siginfo_t end_child(CtsSandbox *d)
{
    siginfo_t how = {0};
    if (!d->pid)
        return how;
    const bool by_number = d->handle < 0;
    if (by_number)
        kill(d->pid, SIGKILL);
    else
        pidfd_send_signal(d->handle, SIGKILL, NULL, 0);
    if (TEMP_FAILURE_RETRY(waitid(by_number ? P_PID : P_PIDFD, (id_t)(by_number ? d->pid : d->handle), &how, WEXITED)))
        how = (siginfo_t){0};
    close_process(d);
    return how;
}

/* A process that this program's parent has started is the parent's, with its memory. */
static void leave_inherited(CtsSandbox *d)
{
    if (d->owner == getpid() || !(d->pid || d->shared))
        return;
    if (d->pid)
        close_process(d);
    if (d->shared)
        shmdt(d->shared);
    d->shared = NULL;
    d->n_jobs = 0;
}

void cts_sandbox_end(CtsSandbox *d)
{
    leave_inherited(d);
    end_child(d);
    d->n_jobs = 0;
}

void cts_sandbox_stop(CtsSandbox *d)
{
    cts_sandbox_end(d);
    if (d->shared)
        shmdt(d->shared);
    d->shared = NULL;
}

void cts_sandbox_free(CtsSandbox **sandbox)
{
    if (*sandbox)
        cts_sandbox_stop(*sandbox);
    free(*sandbox);
    *sandbox = NULL;
}

static double cpu_seconds(pid_t pid)
{
    clockid_t clock;
    struct timespec t = {0};
    return clock_getcpuclockid(pid, &clock) || clock_gettime(clock, &t) ? 0
                                                                        : (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* CPU time is limited for each stream, since a busy machine is not the file's fault. */
static int cpu_limit(const CtsSandbox *d)
{
    return d->cpu_limit_s ? d->cpu_limit_s : BASE_CPU_S + (int)(d->jobs[0].n_answer / BYTES_PER_CPU_S);
}

static int quiet_limit(const CtsSandbox *d)
{
    return d->quiet_limit_s ? d->quiet_limit_s : QUIET_S;
}

static bool receive(CtsSandbox *d, CtsSandboxAnswer *a)
{
    ssize_t n = TEMP_FAILURE_RETRY(recv(d->socket, a, sizeof *a, 0));
    if (n < 0 && errno == ECONNRESET) /* it ended with jobs unread; its last answer follows */
        n = TEMP_FAILURE_RETRY(recv(d->socket, a, sizeof *a, 0));
    if (n != (ssize_t)sizeof *a)
        return false;
    if (a->cpu_us > d->cpu_us)
        cts_cpu_add((double)(a->cpu_us - d->cpu_us) * 1e-3, a->peak_kib);
    d->cpu_us = a->cpu_us;
    a->text[sizeof a->text - 1] = 0;
    for (char *c = a->text; *c; c++) /* of a process that a stream may control */
        *c = (unsigned char)*c < ' ' || *c == 0x7F ? '?' : *c;
    return true;
}

typedef enum Outcome { ANSWERED, ENDED, SILENT, OVERDUE } Outcome;

/* The next message; the time of the stream began with the message before. */
static Outcome await(CtsSandbox *d, CtsSandboxAnswer *a)
{
    double before = -1;
    for (int quiet = 0; quiet < quiet_limit(d);) {
        struct pollfd wait = {.fd = d->socket, .events = POLLIN};
        const int n = poll(&wait, 1, 1000);
        if (n > 0)
            return receive(d, a) ? ANSWERED : ENDED;
        if (n < 0 && errno != EINTR)
            return ENDED;
        const double now = cpu_seconds(d->pid);
        if (now - (double)d->cpu_us * 1e-6 > cpu_limit(d))
            return OVERDUE;
        quiet = n == 0 && now <= before ? quiet + 1 : 0;
        before = now;
    }
    return SILENT;
}

/* Memory limit of the process: its address space. */
static size_t memory_limit(const CtsSandbox *d)
{
    const size_t for_stream =
        d->memory_limit ? d->memory_limit
                        : BASE_MEMORY + d->answer_capacity * ANSWER_MEMORY + d->stream_capacity * STREAM_MEMORY;
    return PROGRAM_MEMORY + (size_t)d->n_slots * slot_bytes(d) + for_stream;
}

/* Starts the process with its ends of socket and pipe. */
static CtsStatus start_with(CtsSandbox *d, const int theirs[2], CtsError *err)
{
    char argument[128];
    snprintf(argument, sizeof argument, "%s %d %d %d %d %zu", CTS_VERSION, d->task, theirs[0], theirs[1], d->memory_id,
             memory_limit(d));
    const CtsStatus st = cts_libexec_start(d->program, argument, theirs, 2, &d->pid, err);
    if (st)
        return cts_context(err, "a %s process is missing", d->name);
    d->handle = pidfd_open(d->pid, 0);
    d->started_task = d->task;
    d->started = false;
    d->cpu_us = 0;
    return CTS_OK;
}

static CtsStatus start_child(CtsSandbox *d, CtsError *err)
{
    int sockets[2], pipes[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, sockets))
        return cts_fail(err, CTS_ERR_MEMORY, "a %s process cannot be reached: %s", d->name, strerror(errno));
    CtsStatus st = pipe2(pipes, O_CLOEXEC)
                       ? cts_fail(err, CTS_ERR_MEMORY, "a %s process cannot be reached: %s", d->name, strerror(errno))
                       : CTS_OK;
    if (!st) {
        st = start_with(d, (int[]){sockets[1], pipes[0]}, err);
        close(pipes[0]);
        if (st)
            close(pipes[1]);
    }
    close(sockets[1]);
    if (st) {
        close(sockets[0]);
        d->pid = 0;
        return st;
    }
    d->socket = sockets[0];
    d->lifeline = pipes[1];
    return CTS_OK;
}

static size_t round_up(size_t n, size_t step)
{
    return (n + step - 1) / step * step;
}

static bool slots_hold(const CtsSandbox *d, size_t n, size_t n_answer)
{
    return d->shared && n <= d->stream_capacity && n_answer <= d->answer_capacity;
}

bool cts_sandbox_fits(CtsSandbox *d, size_t n, size_t n_answer)
{
    leave_inherited(d);
    return d->n_jobs == 0 ||
           (d->pid && d->n_jobs < d->n_slots && slots_hold(d, n, n_answer) && d->task == d->started_task);
}

/* Anonymous shared memory, freed with the last process that has it. A file would be subject to the limits on files. */
static CtsStatus share(CtsSandbox *d, size_t needed, CtsError *err)
{
    d->memory_id = shmget(IPC_PRIVATE, needed, 0600 | SHM_NORESERVE);
    void *shared = d->memory_id < 0 ? (void *)-1 : shmat(d->memory_id, NULL, 0);
    const int why = errno;
    if (d->memory_id >= 0)
        shmctl(d->memory_id, IPC_RMID, NULL);
    if (shared == (void *)-1)
        return cts_fail(err, CTS_ERR_MEMORY, "%zu bytes cannot be shared with a %s process: %s", needed, d->name,
                        strerror(why));
    d->shared = shared;
    return CTS_OK;
}

CtsStatus cts_sandbox_room(CtsSandbox *d, size_t n, size_t n_answer, uint8_t **stream, CtsError *err)
{
    leave_inherited(d);
    if (!slots_hold(d, n, n_answer))
        cts_sandbox_stop(d);
    if (d->pid && d->task != d->started_task)
        cts_sandbox_end(d);
    d->owner = getpid();
    if (!d->shared) {
        d->stream_capacity = round_up(n, ROOM_STEP);
        d->answer_capacity = round_up(n_answer, ROOM_STEP);
        const size_t needed = (size_t)d->n_slots * slot_bytes(d);
        const CtsStatus st = share(d, needed, err);
        if (st)
            return st;
        d->next_slot = 0;
    }
    *stream = (uint8_t *)d->shared + (size_t)d->next_slot * slot_bytes(d);
    return d->pid ? CTS_OK : start_child(d, err);
}

static CtsStatus report_death(const char *name, const siginfo_t *how, CtsError *err)
{
    if (!how->si_pid)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s ended without an answer", name);
    if (how->si_code == CLD_EXITED && how->si_status == 127) /* of the dynamic linker */
        return cts_fail(err, CTS_ERR_PIXELS, "its %s or a library of it is missing, or there is no memory for it",
                        name);
    if (how->si_code == CLD_EXITED)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s ended without an answer (exit code %d)", name, how->si_status);
    switch (how->si_status) {
    case SIGSYS:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was stopped at a system call that no decoder needs", name);
    case SIGKILL:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was killed", name);
    default:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s crashed (signal %d)", name, how->si_status);
    }
}

/* A message. *killed: the process was, by a user or the OOM killer, and hardly by an effect of the stream, since codecs
 * do not send SIGKILL; or the reason of its end is unknown. */
static CtsStatus await_message(CtsSandbox *d, CtsSandboxAnswer *a, bool *killed, CtsError *err)
{
    const Outcome outcome = await(d, a);
    *killed = false;
    if (outcome == ANSWERED)
        return CTS_OK;
    const siginfo_t how = end_child(d);
    if (outcome == SILENT)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s made no progress for %d s", d->name, quiet_limit(d));
    if (outcome == OVERDUE)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was stopped after %d s of computing", d->name, cpu_limit(d));
    *killed = !how.si_pid || (how.si_code != CLD_EXITED && how.si_status == SIGKILL);
    return report_death(d->name, &how, err);
}

/* Waits until the process reports that it is ready. */
static CtsStatus await_start(CtsSandbox *d, bool *killed, CtsError *err)
{
    CtsSandboxAnswer a;
    CtsError why = {0};
    *killed = false;
    if (d->started)
        return CTS_OK;
    CtsStatus st = await_message(d, &a, killed, &why);
    d->started = !st && !a.status;
    if (d->started)
        return CTS_OK;
    end_child(d);
    return cts_fail(err, st ? CTS_ERR_INTERNAL : a.status, "a %s process does not start: %s", d->name,
                    st ? why.text : a.text);
}

/* The oldest frame's answer. */
static CtsStatus await_oldest(CtsSandbox *d, bool *killed, CtsError *err)
{
    CtsSandboxAnswer a;
    CtsStatus st = await_start(d, killed, err);
    if (st || (st = await_message(d, &a, killed, err)))
        return st;
    if (a.status == CTS_ERR_MEMORY)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s asks for more memory than %zu bytes of pixels need", d->name,
                        d->jobs[0].n_answer);
    return a.status ? cts_fail(err, a.status == CTS_ERR_SYNTAX ? CTS_ERR_SYNTAX : CTS_ERR_PIXELS, "%s", a.text)
                    : CTS_OK;
}

/* A process that has ended is detected when its answer is read. */
static void send_job(const CtsSandbox *d, const CtsSandboxJob *job)
{
    const ssize_t sent = TEMP_FAILURE_RETRY(send(d->socket, job, sizeof *job, MSG_NOSIGNAL));
    (void)sent;
}

void cts_sandbox_send(CtsSandbox *d, const void *order, size_t n_order, const uint8_t *stream, size_t n,
                      size_t n_answer)
{
    CtsSandboxJob *job = &d->jobs[d->n_jobs++];
    assert(n_order <= sizeof job->order);
    *job = (CtsSandboxJob){.stream = (size_t)(stream - (const uint8_t *)d->shared),
                           .n = n,
                           .answer = (size_t)d->next_slot * slot_bytes(d) + d->stream_capacity,
                           .n_answer = n_answer};
    if (n_order)
        memcpy(job->order, order, n_order);
    d->next_slot = (d->next_slot + 1) % d->n_slots;
    send_job(d, job);
}

/* Starts another process for all streams in progress. */
static CtsStatus send_again(CtsSandbox *d, CtsError *err)
{
    const CtsStatus st = start_child(d, err);
    for (int i = 0; !st && i < d->n_jobs; i++)
        send_job(d, &d->jobs[i]);
    return st;
}

CtsStatus cts_sandbox_take(CtsSandbox *d, const void **answer, CtsError *err)
{
    bool killed = false;
    CtsStatus st = d->pid ? CTS_OK : send_again(d, err);
    if (!st)
        st = await_oldest(d, &killed, err);
    if (killed && !(st = send_again(d, err)))
        st = await_oldest(d, &killed, err);
    *answer = (const uint8_t *)d->shared + d->jobs[0].answer;
    d->n_jobs--;
    for (int i = 0; i < d->n_jobs; i++)
        d->jobs[i] = d->jobs[i + 1];
    return st;
}
