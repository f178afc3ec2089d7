#define _GNU_SOURCE
#include "input/codec/decoder.h"

#include "input/header/dcm_read.h"
#include "base/sandbox.h"
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum {
    BASE_MEMORY = 256 << 20, /* what a codec may take for any frame */
    PIXEL_MEMORY = 48,       /* and for each pixel: OpenJPEG holds it a few times as 32 bits */
    STREAM_MEMORY = 4,       /* and for each byte of the stream */
    BASE_CPU_S = 10,
    PIXELS_PER_CPU_S = 200000, /* a fiftieth of what the slowest codec does */
    QUIET_S = 60,
    START_QUIET_S = 5,
    START_TRIES = 4, /* another fork may well meet other locks */
    ROOM_STEP = 1 << 20
};

typedef struct Answer {
    CtsStatus status;
    char text[240];
} Answer;

CtsDecoder cts_decoder_make(cts_decode_fn decode)
{
    return (CtsDecoder){.decode = decode, .name = "decoder", .n_slots = 1, .socket = -1};
}

CtsStatus cts_decoder_new(CtsDecoder **decoder, cts_decode_fn decode, int n_slots, CtsError *err)
{
    if (*decoder)
        return CTS_OK;
    if (!(*decoder = malloc(sizeof **decoder)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    **decoder = cts_decoder_make(decode);
    (*decoder)->n_slots = n_slots;
    return CTS_OK;
}

static size_t slot_bytes(const CtsDecoder *d)
{
    return d->stream_capacity + d->pixel_capacity;
}

static bool receive(int socket, void *message, size_t n)
{
    ssize_t got;
    do
        got = recv(socket, message, n, 0);
    while (got < 0 && errno == EINTR);
    return got == (ssize_t)n;
}

static bool transmit(int socket, const void *message, size_t n)
{
    ssize_t put;
    do
        put = send(socket, message, n, MSG_NOSIGNAL);
    while (put < 0 && errno == EINTR);
    return put == (ssize_t)n;
}

/* The child's whole life. The first answer says whether the walls stand. */
static _Noreturn void serve(const CtsDecoder *d, int socket, size_t n_memory)
{
    CtsDecoderJob job;
    Answer a = {CTS_OK, ""};
    const int wall = d->own_bytes ? cts_sandbox_leave_all(socket) : cts_sandbox_enter(socket, n_memory);
    if (wall) {
        a.status = CTS_ERR_INTERNAL;
        snprintf(a.text, sizeof a.text, "%s", strerror(wall));
    }
    while (transmit(socket, &a, sizeof a) && !wall && receive(socket, &job, sizeof job)) {
        CtsError why = {0};
        a.status = d->decode(&job.format, (const uint8_t *)d->shared + job.stream, job.n,
                             (uint8_t *)d->shared + job.pixels, &why);
        snprintf(a.text, sizeof a.text, "%.*s", (int)sizeof a.text - 1, why.text);
    }
    _exit(wall ? 1 : 0);
}

/* The child's wait status, or -1 when somebody else has taken it. */
static int end_child(CtsDecoder *d, bool kill_it)
{
    int status = -1;
    if (!d->pid)
        return -1;
    if (d->socket >= 0)
        close(d->socket);
    d->socket = -1;
    if (kill_it)
        kill(d->pid, SIGKILL);
    while (waitpid(d->pid, &status, 0) < 0)
        if (errno != EINTR) {
            status = -1;
            break;
        }
    d->pid = 0;
    return status;
}

void cts_decoder_end(CtsDecoder *d)
{
    end_child(d, d->n_jobs > 0);
    d->n_jobs = 0;
}

void cts_decoder_stop(CtsDecoder *d)
{
    cts_decoder_end(d);
    if (d->shared)
        munmap(d->shared, (size_t)d->n_slots * slot_bytes(d));
    d->shared = NULL;
}

void cts_decoder_free(CtsDecoder **decoder)
{
    if (*decoder)
        cts_decoder_stop(*decoder);
    free(*decoder);
    *decoder = NULL;
}

static double cpu_seconds(pid_t pid)
{
    clockid_t clock;
    struct timespec t = {0};
    return clock_getcpuclockid(pid, &clock) || clock_gettime(clock, &t) ? 0
                                                                        : (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Whether an answer came; not when the child has gone, or (*still) has done nothing for quiet_s. */
static bool await(const CtsDecoder *d, Answer *a, int quiet_s, bool *still)
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

static CtsStatus fork_child(CtsDecoder *d, size_t n_memory, CtsError *err)
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends))
        return cts_fail(err, CTS_ERR_MEMORY, "a decoder process cannot be reached: %s", strerror(errno));
    const pid_t pid = cts_dcm_fork();
    if (pid == 0)
        serve(d, ends[1], n_memory);
    const int why = errno;
    close(ends[1]);
    if (pid < 0) {
        close(ends[0]);
        return cts_fail(err, CTS_ERR_MEMORY, "a decoder process cannot be started: %s", strerror(why));
    }
    d->pid = pid;
    d->socket = ends[0];
    return CTS_OK;
}

/* What a child may take. */
static size_t memory_limit(const CtsDecoder *d)
{
    return d->memory_limit ? d->memory_limit
                           : BASE_MEMORY + d->pixel_capacity / 2 * PIXEL_MEMORY + d->stream_capacity * STREAM_MEMORY;
}

static CtsStatus start_child(CtsDecoder *d, CtsError *err)
{
    CtsStatus st = cts_dcm_start_decoders(err);
    Answer a = {CTS_ERR_INTERNAL, "it ended at once"};
    bool still = true;
    for (int tries = 0; !st && still && tries < START_TRIES; tries++) {
        if ((st = fork_child(d, memory_limit(d), err)))
            return st;
        if (await(d, &a, START_QUIET_S, &still) && !a.status)
            return CTS_OK;
        end_child(d, true);
    }
    return st ? st
              : cts_fail(err, CTS_ERR_INTERNAL,
                         "compressed pixels are not decoded, for a decoder process cannot be shut in: %.*s (convert "
                         "them with dcmdjpeg or gdcmconv --raw)",
                         (int)sizeof a.text, still ? "it stands still" : a.text);
}

static size_t round_up(size_t n, size_t step)
{
    return (n + step - 1) / step * step;
}

/* DCMTK asks for an even number of bytes. */
static size_t pixel_bytes(const CtsFrameFormat *format)
{
    return cts_frame_bytes(format) + 1;
}

static bool slots_hold(const CtsDecoder *d, const CtsFrameFormat *format, size_t n)
{
    return d->shared && n <= d->stream_capacity && pixel_bytes(format) <= d->pixel_capacity;
}

/* A child that was forked for other syntaxes: what decodes a slice must not depend on what came before. */
static bool lacks_htj2k(const CtsDecoder *d, const CtsFrameFormat *format)
{
    return !d->with_htj2k && format->syntax && format->syntax->codec == CTS_CODEC_HTJ2K;
}

bool cts_decoder_fits(const CtsDecoder *d, const CtsFrameFormat *format, size_t n)
{
    return d->n_jobs == 0 || (d->pid && d->n_jobs < d->n_slots && slots_hold(d, format, n) && !lacks_htj2k(d, format));
}

CtsStatus cts_decoder_room(CtsDecoder *d, const CtsFrameFormat *format, size_t n, uint8_t **stream, CtsError *err)
{
    if (!slots_hold(d, format, n))
        cts_decoder_stop(d);
    if (!d->shared) {
        d->stream_capacity = round_up(n, ROOM_STEP);
        d->pixel_capacity = round_up(pixel_bytes(format), ROOM_STEP);
        const size_t needed = (size_t)d->n_slots * slot_bytes(d);
        void *shared = mmap(NULL, needed, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (shared == MAP_FAILED)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory: %zu bytes asked for", needed);
        d->shared = shared;
        d->next_slot = 0;
    }
    *stream = (uint8_t *)d->shared + (size_t)d->next_slot * slot_bytes(d);
    if (lacks_htj2k(d, format)) {
        cts_decoder_end(d);
        cts_htj2k_prepare();
        d->with_htj2k = true;
    }
    return d->pid ? CTS_OK : start_child(d, err);
}

/* The child dies of SIGXCPU when the oldest frame takes longer. CPU time, for a busy machine is no fault of the file's.
 */
static int limit_cpu(const CtsDecoder *d, const CtsFrameFormat *format)
{
    const int pixels_s = (int)((size_t)format->columns * (size_t)format->rows / PIXELS_PER_CPU_S);
    const int limit_s = d->cpu_limit_s ? d->cpu_limit_s : BASE_CPU_S + pixels_s;
    const struct rlimit limit = {(rlim_t)cpu_seconds(d->pid) + (rlim_t)limit_s + 1, RLIM_INFINITY};
    prlimit(d->pid, RLIMIT_CPU, &limit, NULL); /* fails only when the child is gone, which the answer tells */
    return limit_s;
}

static CtsStatus tell_death(const char *name, int status, int limit_s, CtsError *err)
{
    if (status == -1)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s ended without an answer", name);
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

/* The oldest frame's answer. *killed: by somebody or a system without memory, and hardly by what the stream made of it:
 * codecs do not send SIGKILL. */
static CtsStatus await_oldest(CtsDecoder *d, bool *killed, CtsError *err)
{
    Answer a;
    bool still = false;
    const CtsFrameFormat *format = &d->jobs[0].format;
    const int limit_s = limit_cpu(d, format), quiet_s = d->quiet_limit_s ? d->quiet_limit_s : QUIET_S;
    *killed = false;
    if (!await(d, &a, quiet_s, &still)) {
        const int status = end_child(d, true);
        *killed = !still && status != -1 && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
        return still ? cts_fail(err, CTS_ERR_PIXELS, "its %s stood still for %d s", d->name, quiet_s)
                     : tell_death(d->name, status, limit_s, err);
    }
    if (a.status == CTS_ERR_MEMORY)
        return cts_fail(err, CTS_ERR_PIXELS, "its %s asks for more memory than a picture of %d x %d needs", d->name,
                        format->columns, format->rows);
    return a.status ? cts_fail(err, a.status == CTS_ERR_SYNTAX ? CTS_ERR_SYNTAX : CTS_ERR_PIXELS, "%.*s",
                               (int)sizeof a.text - 1, a.text)
                    : CTS_OK;
}

/* A child that is gone is found out when its answer is waited for. */
static void send_job(const CtsDecoder *d, const CtsDecoderJob *job)
{
    transmit(d->socket, job, sizeof *job);
}

void cts_decoder_send(CtsDecoder *d, const CtsFrameFormat *format, const uint8_t *stream, size_t n)
{
    CtsDecoderJob *job = &d->jobs[d->n_jobs++];
    *job = (CtsDecoderJob){*format, (size_t)(stream - (const uint8_t *)d->shared), n,
                           (size_t)d->next_slot * slot_bytes(d) + d->stream_capacity};
    d->next_slot = (d->next_slot + 1) % d->n_slots;
    if (d->n_jobs == 1)
        limit_cpu(d, format);
    send_job(d, job);
}

/* Another child for all that is under way. */
static CtsStatus send_again(CtsDecoder *d, CtsError *err)
{
    const CtsStatus st = start_child(d, err);
    for (int i = 0; !st && i < d->n_jobs; i++)
        send_job(d, &d->jobs[i]);
    return st;
}

CtsStatus cts_decoder_take(CtsDecoder *d, const void **pixels, CtsError *err)
{
    bool killed = false;
    CtsStatus st = d->pid ? CTS_OK : send_again(d, err);
    if (!st)
        st = await_oldest(d, &killed, err);
    if (killed && !(st = send_again(d, err)))
        st = await_oldest(d, &killed, err);
    *pixels = (const uint8_t *)d->shared + d->jobs[0].pixels;
    d->n_jobs--;
    for (int i = 0; i < d->n_jobs; i++)
        d->jobs[i] = d->jobs[i + 1];
    return st;
}

CtsStatus cts_decoder_run(CtsDecoder *d, const CtsFrameFormat *format, const uint8_t *stream, size_t n,
                          const void **pixels, CtsError *err)
{
    cts_decoder_send(d, format, stream, n);
    return cts_decoder_take(d, pixels, err);
}
