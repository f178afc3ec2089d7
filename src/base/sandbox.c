#include "base/sandbox.h"

#include "base/helper_process.h"
#include "base/isolation.h"
#include <assert.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum {
    BASE_MEMORY = 256 << 20, /* memory of a codec for any stream */
    ANSWER_MEMORY = 24,      /* and for each byte of the answer: OpenJPEG holds a pixel a few times as 32 bits */
    STREAM_MEMORY = 4,       /* and for each byte of the stream */
    BASE_CPU_S = 10,
    BYTES_PER_CPU_S = 400000, /* a fiftieth of the speed of the slowest codec */
    QUIET_S = 60,
    START_QUIET_S = 5,
    GONE_MS = 10000,
    START_TRIES = 4, /* another helper may well meet other locks */
    ROOM_STEP = 1 << 20
};

/* Parameters of a sandbox process. */
typedef struct Order {
    cts_sandbox_work_fn work;
    size_t n_memory;
    int memory_id;
    bool own_bytes;
} Order;

typedef struct Answer {
    CtsStatus status;
    char text[240];
} Answer;

CtsSandbox cts_sandbox_make(cts_sandbox_work_fn work, const char *name)
{
    return (CtsSandbox){.work = work, .name = name, .n_slots = 1, .socket = -1};
}

CtsStatus cts_sandbox_new(CtsSandbox **sandbox, cts_sandbox_work_fn work, const char *name, int n_slots, CtsError *err)
{
    if (*sandbox)
        return CTS_OK;
    if (!(*sandbox = malloc(sizeof **sandbox)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    **sandbox = cts_sandbox_make(work, name);
    (*sandbox)->n_slots = n_slots;
    return CTS_OK;
}

static size_t slot_bytes(const CtsSandbox *d)
{
    return d->stream_capacity + d->answer_capacity;
}

static bool receive(int socket, void *message, size_t n)
{
    return TEMP_FAILURE_RETRY(recv(socket, message, n, 0)) == (ssize_t)n;
}

static bool transmit(int socket, const void *message, size_t n)
{
    return TEMP_FAILURE_RETRY(send(socket, message, n, MSG_NOSIGNAL)) == (ssize_t)n;
}

/* Main function of the sandbox process. Its first answer says whether the isolation succeeded. */
static void serve(const void *order, int socket)
{
    Order o;
    CtsSandboxJob job;
    Answer a = {CTS_OK, ""};
    memcpy(&o, order, sizeof o);
    uint8_t *const shared = shmat(o.memory_id, NULL, 0);
    int wall = shared == (void *)-1 ? errno : 0;
    if (!wall)
        wall = o.own_bytes ? cts_isolation_leave_all(socket) : cts_isolation_enter(socket, o.n_memory);
    if (wall) {
        a.status = CTS_ERR_INTERNAL;
        snprintf(a.text, sizeof a.text, "%s", strerror(wall));
    }
    while (transmit(socket, &a, sizeof a) && !wall && receive(socket, &job, sizeof job)) {
        CtsError why = {0};
        a.status = o.work(job.order, shared + job.stream, job.n, shared + job.answer, job.n_answer, &why);
        snprintf(a.text, sizeof a.text, "%.*s", (int)sizeof a.text - 1, why.text);
    }
    _exit(wall ? 1 : 0);
}

/* The process's wait status. Killing a helper kills its processes, but a moment later and without reaping: one that
 * still has its socket may write where the next one puts its answer. */
static int end_child(CtsSandbox *d)
{
    if (!d->pid)
        return 0;
    shutdown(d->socket, SHUT_WR);
    const int status = cts_helper_end(d->pid);
    struct pollfd gone = {.fd = d->socket};
    TEMP_FAILURE_RETRY(poll(&gone, 1, GONE_MS));
    close(d->socket);
    d->socket = -1;
    d->pid = 0;
    return status;
}

void cts_sandbox_end(CtsSandbox *d)
{
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

/* True if an answer arrived; false when the process has ended, or (*still) has been idle for quiet_s. */
static bool await(const CtsSandbox *d, Answer *a, int quiet_s, bool *still)
{
    double before = -1;
    *still = false;
    for (int quiet = 0; quiet < quiet_s;) {
        struct pollfd wait = {.fd = d->socket, .events = POLLIN};
        const int n = poll(&wait, 1, 1000);
        if (n > 0)
            return receive(d->socket, a, sizeof *a);
        if (n < 0 && errno != EINTR)
            return false;
        const double now = cpu_seconds(d->pid);
        quiet = n == 0 && now <= before ? quiet + 1 : 0;
        before = now;
    }
    *still = true;
    return false;
}

/* Memory limit of the process. */
static size_t memory_limit(const CtsSandbox *d)
{
    return d->memory_limit ? d->memory_limit
                           : BASE_MEMORY + d->answer_capacity * ANSWER_MEMORY + d->stream_capacity * STREAM_MEMORY;
}

static CtsStatus fork_child(CtsSandbox *d, CtsError *err)
{
    const Order o = {
        .work = d->work, .n_memory = memory_limit(d), .memory_id = d->memory_id, .own_bytes = d->own_bytes};
    CtsHelperOrder order = {.prepare = d->prepare, .live = serve};
    _Static_assert(sizeof o <= sizeof order.order, "an order has room");
    memcpy(order.order, &o, sizeof o);
    const CtsStatus st = cts_helper_fork(&order, &d->pid, &d->socket, err);
    if (st) {
        d->pid = 0;
        return cts_context(err, "a %s process cannot be started", d->name);
    }
    d->prepared = d->prepare;
    return CTS_OK;
}

static CtsStatus start_child(CtsSandbox *d, CtsError *err)
{
    Answer a = {CTS_ERR_INTERNAL, "it ended at once"};
    bool still = true;
    for (int tries = 0; still && tries < START_TRIES; tries++) {
        const CtsStatus st = fork_child(d, err);
        if (st)
            return st;
        if (await(d, &a, START_QUIET_S, &still) && !a.status)
            return CTS_OK;
        end_child(d);
        if (still)
            cts_helper_renew();
    }
    return cts_fail(
        err, CTS_ERR_INTERNAL,
        "compressed pixels are not decoded, because a %s process cannot be sandboxed: %.*s (convert them with "
        "dcmdjpeg or gdcmconv --raw)",
        d->name, (int)sizeof a.text, still ? "it makes no progress" : a.text);
}

static size_t round_up(size_t n, size_t step)
{
    return (n + step - 1) / step * step;
}

static bool slots_hold(const CtsSandbox *d, size_t n, size_t n_answer)
{
    return d->shared && n <= d->stream_capacity && n_answer <= d->answer_capacity;
}

/* The result for a stream must not depend on earlier streams. */
static bool is_prepared(const CtsSandbox *d)
{
    return !d->prepare || d->prepare == d->prepared;
}

bool cts_sandbox_fits(const CtsSandbox *d, size_t n, size_t n_answer)
{
    return d->n_jobs == 0 || (d->pid && d->n_jobs < d->n_slots && slots_hold(d, n, n_answer) && is_prepared(d));
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
    if (!slots_hold(d, n, n_answer))
        cts_sandbox_stop(d);
    if (!is_prepared(d))
        cts_sandbox_end(d);
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

/* SIGXCPU ends the process when the oldest frame takes too long. CPU time is limited, since a busy machine is not the
 * file's fault. */
static int limit_cpu(const CtsSandbox *d)
{
    const int limit_s = d->cpu_limit_s ? d->cpu_limit_s : BASE_CPU_S + (int)(d->jobs[0].n_answer / BYTES_PER_CPU_S);
    const struct rlimit limit = {(rlim_t)cpu_seconds(d->pid) + (rlim_t)limit_s + 1, RLIM_INFINITY};
    /* fails only when the process has ended, which reading the answer detects */
    prlimit(d->pid, RLIMIT_CPU, &limit, NULL);
    return limit_s;
}

static CtsStatus report_death(const char *name, int status, int limit_s, CtsError *err)
{
    if (!WIFSIGNALED(status))
        return cts_fail(err, CTS_ERR_PIXELS, "its %s ended without an answer (exit code %d)", name,
                        WEXITSTATUS(status));
    switch (WTERMSIG(status)) {
    case SIGXCPU:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was stopped after %d s of computing", name, limit_s);
    case SIGSYS:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was stopped at a system call that no decoder needs", name);
    case SIGKILL:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s was killed", name);
    default:
        return cts_fail(err, CTS_ERR_PIXELS, "its %s crashed (signal %d)", name, WTERMSIG(status));
    }
}

/* The oldest frame's answer. *killed: by a user or the OOM killer, and hardly by an effect of the stream: codecs do not
 * send SIGKILL. */
static CtsStatus await_oldest(CtsSandbox *d, bool *killed, CtsError *err)
{
    Answer a;
    bool still = false;
    const int limit_s = limit_cpu(d), quiet_s = d->quiet_limit_s ? d->quiet_limit_s : QUIET_S;
    *killed = false;
    if (!await(d, &a, quiet_s, &still)) {
        const int status = end_child(d);
        *killed = !still && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
        return still ? cts_fail(err, CTS_ERR_PIXELS, "its %s made no progress for %d s", d->name, quiet_s)
                     : report_death(d->name, status, limit_s, err);
    }
    if (a.status == CTS_ERR_MEMORY)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s asks for more memory than %zu bytes of pixels need", d->name,
                        d->jobs[0].n_answer);
    return a.status ? cts_fail(err, a.status == CTS_ERR_SYNTAX ? CTS_ERR_SYNTAX : CTS_ERR_PIXELS, "%.*s",
                               (int)sizeof a.text - 1, a.text)
                    : CTS_OK;
}

/* A process that has ended is detected when its answer is read. */
static void send_job(const CtsSandbox *d, const CtsSandboxJob *job)
{
    transmit(d->socket, job, sizeof *job);
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
    if (d->n_jobs == 1)
        limit_cpu(d);
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
